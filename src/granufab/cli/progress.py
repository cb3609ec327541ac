"""Progress of a computation on standard error: a bar on a terminal, else a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from granufab.cli.interruption import gently, stop_if_asked

__all__ = ["show_progress"]

SECONDS_BETWEEN_LINES = 5.0
ENOUGH_TO_TELL = 0.02  # fraction of the work after which the time left is worth a guess


@contextmanager
def show_progress(*, gentle: bool = False) -> Iterator[Callable[[str, float], None]]:
    """Give a callable ``progress(text, fraction)`` that shows how far a computation is.

    Once a signal has come the callable raises KeyboardInterrupt; with ``gentle`` only there.
    """
    display = _bar() if sys.stderr.isatty() else nullcontext(_lines())
    with gently(gentle), display as show:

        def report(text: str, fraction: float) -> None:
            stop_if_asked()
            show(text, fraction)

        yield report


@contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        last = 0.0

        def report(text: str, fraction: float) -> None:
            nonlocal last
            if fraction < last:  # another part of the work began
                bar.reset(task)
            last = fraction
            bar.update(task, description=text, completed=fraction)

        yield report


def _lines() -> Callable[[str, float], None]:
    printed = began = time.monotonic()
    first = last = 0.0

    def report(text: str, fraction: float) -> None:
        nonlocal printed, began, first, last
        now = time.monotonic()
        if fraction < last:
            began, first = now, fraction
        last = fraction
        if now - printed < SECONDS_BETWEEN_LINES:
            return
        printed = now
        left = ""
        if fraction - first > ENOUGH_TO_TELL:
            seconds = (now - began) * (1.0 - fraction) / (fraction - first)
            left = f", about {seconds:.0f} s left"
        print(f"{text}: {100 * fraction:.0f} %{left}", file=sys.stderr, flush=True)

    return report
