"""What a worker does: one case into its folder, with a word to say at the end."""

from __future__ import annotations

import contextlib
import os
import time
from dataclasses import dataclass
from pathlib import Path

from granufab.campaign.folder import State, is_finished
from granufab.campaign.identity import digest_of
from granufab.errors import GranufabError
from granufab.history import Run
from granufab.reproduce.case_folder import Progress, RunCase, run_into_folder
from granufab.simulate.settings import Case

__all__ = ["Outcome", "Task", "continue_case", "do_task", "tell_now_and_then"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A case that a worker is given.

    Attributes:
        id: of the case.
        case: what is run.
        folder: where its files go.
        start: folder that the names of files in the case count from.
        threads: of the run.
    """

    id: str
    case: Case
    folder: Path
    start: Path
    threads: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a case ended.

    Attributes:
        state: done, failed or interrupted.
        reason: why it failed, in one line.
        seconds: wall time spent on it.
    """

    state: State
    reason: str = ""
    seconds: float = 0.0


def continue_case(
    case: Case, folder: Path, *, progress: Progress | None, run_case: RunCase | None
) -> Run:
    """Run a case into its folder, from its last checkpoint where it has one."""
    return run_into_folder(case, folder, resume=True, progress=progress, run_case=run_case)


def do_task(task: Task, progress: Progress, run_case: RunCase | None = None) -> Outcome:
    """Run one case; every failure becomes one line. A case that is done is left alone.

    Dask may hand out a task again although it has ended, when its worker dies with the answer.

    Args:
        task: the case.
        progress: told a few times a second; raises KeyboardInterrupt to stop the case.
        run_case: what simulates, see :func:`granufab.reproduce.run_into_folder`.
    """
    if is_finished(task.folder, digest_of(task.id)):
        return Outcome(state="done")
    os.environ["GRANUFAB_THREADS"] = str(task.threads)
    began = time.monotonic()
    state: State = "failed"
    reason = ""
    try:
        with _working_in(task):
            run = continue_case(task.case, task.folder, progress=progress, run_case=run_case)
        state = "interrupted" if run.summary.get("interrupted") else "done"
    except KeyboardInterrupt:
        state = "interrupted"
    except GranufabError as error:
        reason = str(error)
    except MemoryError as error:
        reason = f"not enough memory {error}"
    except Exception as error:  # a campaign goes on where one of its cases cannot
        reason = f"{type(error).__name__}: {error}"
    seconds = time.monotonic() - began
    return Outcome(state=state, reason=" ".join(reason.split()), seconds=seconds)


def _working_in(task: Task) -> contextlib.AbstractContextManager[None]:
    """The folder that names of files count from, for the few cases that name files."""
    if task.case.sample.file is None and task.case.sample.sizes.file is None:
        return contextlib.nullcontext()
    return contextlib.chdir(task.start)


def tell_now_and_then(tell: Progress, seconds: float) -> Progress:
    """``tell``, called at most every so many seconds."""
    last = [float("-inf")]

    def report(text: str, share: float) -> None:
        now = time.monotonic()
        if now - last[0] >= seconds:
            last[0] = now
            tell(text, share)

    return report
