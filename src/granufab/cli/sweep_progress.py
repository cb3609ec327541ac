"""Progress of a campaign on standard error: a live table on a terminal, else lines."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from granufab.cli.interruption import gently, stop_if_asked

if TYPE_CHECKING:
    from granufab.campaign.ledger import Ledger

__all__ = ["show_campaign", "time_left"]

SECONDS_BETWEEN_LINES = 10.0
SECONDS_BETWEEN_TABLES = 0.25
MOST_ROWS = 16
ENOUGH_TO_TELL = 0.02


@contextmanager
def show_campaign() -> Iterator[Callable[[Ledger], None]]:
    """Give a callable that shows a ledger, and raises KeyboardInterrupt once a signal has come."""
    clock = _Clock()
    with gently(True):
        if not sys.stderr.isatty():
            yield _watched(clock, SECONDS_BETWEEN_LINES, _print_line)
            return
        from rich.console import Console
        from rich.live import Live

        with Live(console=Console(stderr=True), auto_refresh=False, transient=True) as live:

            def draw(ledger: Ledger, left: str) -> None:
                live.update(_table(ledger, left), refresh=True)

            yield _watched(clock, SECONDS_BETWEEN_TABLES, draw)


class _Clock:
    """When the campaign began, and how much was done by then."""

    def __init__(self) -> None:
        self.began = self.shown = time.monotonic()
        self.first: float | None = None


def _watched(
    clock: _Clock, seconds: float, draw: Callable[[Ledger, str], None]
) -> Callable[[Ledger], None]:
    def show(ledger: Ledger) -> None:
        stop_if_asked()
        now = time.monotonic()
        if clock.first is None:
            clock.first = ledger.fraction
        if now - clock.shown >= seconds:
            clock.shown = now
            draw(ledger, time_left(now - clock.began, clock.first, ledger.fraction))

    return show


def time_left(spent: float, first: float, fraction: float) -> str:
    """A guess of the time left: "about 3 min left", or nothing while it is worth nothing.

    Args:
        spent: seconds since the campaign was started or continued.
        first: fraction that was done then.
        fraction: that is done now.
    """
    if fraction - first < ENOUGH_TO_TELL or fraction >= 1.0:
        return ""
    seconds = spent * (1.0 - fraction) / (fraction - first)
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"about {seconds / size:.0f} {unit} left"
    return f"about {seconds:.0f} s left"


def _counts(ledger: Ledger) -> str:
    return ", ".join(f"{count} {state}" for state, count in ledger.count().items() if count)


def _print_line(ledger: Ledger, left: str) -> None:
    tail = f"; {left}" if left else ""
    line = f"{_counts(ledger)}: {100 * ledger.fraction:.0f} %{tail}"
    print(line, file=sys.stderr, flush=True)


def _table(ledger: Ledger, left: str) -> Any:
    from rich.table import Table
    from rich.text import Text

    title = f"{_counts(ledger)} · {100 * ledger.fraction:.0f} %" + (f" · {left}" if left else "")
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in ("case", "state", "done", "doing"):
        table.add_column(name, no_wrap=True, overflow="ellipsis")
    failed, running = ledger.in_state("failed"), ledger.in_state("running")
    for row in [*running, *failed][:MOST_ROWS]:
        share = f"{100 * ledger.share.get(row.id, 0.0):.0f} %" if row.state == "running" else ""
        doing = ledger.text.get(row.id, "") if row.state == "running" else row.reason
        table.add_row(Text(row.id), row.state, share, Text(doing))
    return table
