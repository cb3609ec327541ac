"""Stand-ins for what simulates a case: they leave a line for each begin and each end.

Worker processes import this; the file of lines is named by the environment.
"""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from granufab.errors import NotConverged
from granufab.simulate import run_case
from granufab.simulate.settings import Case

LOG = "GRANUFAB_TEST_LOG"


def _note(word: str, case: Case) -> None:
    with Path(os.environ[LOG]).open("a", encoding="utf-8") as file:
        file.write(f"{word} {case.name} {os.getpid()}\n")


def lines(word: str) -> list[tuple[str, int]]:
    """(case, process) of each begin or each end so far."""
    path = Path(os.environ[LOG])
    rows = [line.split() for line in path.read_text().splitlines()] if path.exists() else []
    return [(row[1], int(row[2])) for row in rows if row[0] == word]


def counted(case: Case, **options: Any) -> Any:
    """Simulate, in not less than 0.4 s."""
    _note("begin", case)
    time.sleep(0.4)
    run = run_case(case, **options)
    _note("end", case)
    return run


def odd_seeds_fail(case: Case, **options: Any) -> Any:
    """Simulate even seeds; odd ones fail in two lines."""
    _note("begin", case)
    if case.sample.seed % 2 and not (Path(os.environ[LOG]).parent / "mended").exists():
        raise NotConverged("z_0 = 9 was not\nreached")
    return run_case(case, **options)


def deadly(case: Case, **options: Any) -> Any:
    """The worker dies with seed 1."""
    _note("begin", case)
    if case.sample.seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return run_case(case, **options)


class Killer:
    """Shown a ledger again and again, it kills one worker in the middle of a case.

    Args:
        after: cases that are to have ended before.
    """

    def __init__(self, after: int) -> None:
        self.after = after
        self.victim: str | None = None

    def __call__(self, ledger: Any) -> None:
        ended = {name for name, _ in lines("end")}
        busy = [(name, process) for name, process in lines("begin") if name not in ended]
        if self.victim is None and len(ended) >= self.after and busy:
            self.victim, process = busy[-1]
            os.kill(process, signal.SIGKILL)
