"""The book of a campaign: state of every case, kept on disk in ``cases.csv``."""

from __future__ import annotations

import csv
import io
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

from granufab.campaign.case_work import Outcome
from granufab.campaign.folder import State
from granufab.campaign.settings import COLUMNS
from granufab.errors import CorruptFile
from granufab.io import write_text

__all__ = ["UNWANTED", "Ledger", "Row", "read_table"]

UNWANTED = "no longer in SWEEP.toml"
SECONDS_BETWEEN_WRITES = 1.0
STATES: tuple[State, ...] = get_args(State)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A case in the table.

    Attributes:
        id: of the case.
        parameters: column → value, as text where it was read from the table.
        seed: of its sample.
        state: waiting, running, done, failed or interrupted.
        reason: why it failed, or that it is no longer wanted.
        seconds: wall time spent on it so far.
    """

    id: str
    parameters: Mapping[str, Any]
    seed: int
    state: State = "waiting"
    reason: str = ""
    seconds: float = 0.0


@dataclass(slots=True)
class Ledger:
    """Rows by id; each change goes to disk, at most once a second unless it matters.

    Attributes:
        path: of the table.
        names: columns of the parameters.
        rows: by id, in the order of the table.
        unwanted: rows of earlier cases, kept at the end of the table.
        shown: called with the ledger after each change and a few times a second; may raise
            KeyboardInterrupt to stop the campaign.
        share: how far running cases are, 0..1, by id.
        text: what running cases are doing, by id.
        lost: how often a worker died with the case.
    """

    path: Path
    names: tuple[str, ...]
    rows: dict[str, Row]
    unwanted: list[Row] = field(default_factory=list)
    shown: Callable[[Ledger], None] | None = None
    share: dict[str, float] = field(default_factory=dict)
    text: dict[str, str] = field(default_factory=dict)
    lost: Counter[str] = field(default_factory=Counter)
    _written: float = float("-inf")

    def write(self) -> None:
        """Rewrite the table, whole or not at all."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        extra = [n for row in self.unwanted for n in row.parameters if n not in self.names]
        names = (*self.names, *dict.fromkeys(extra))
        writer.writerow(("id", *names, "seed", "state", "reason", "seconds"))
        for row in (*self.rows.values(), *self.unwanted):
            values = [row.parameters.get(name, "") for name in names]
            tail = (row.seed, row.state, row.reason, f"{row.seconds:.3f}")
            writer.writerow((row.id, *values, *tail))
        write_text(buffer.getvalue(), self.path)
        self._written = time.monotonic()

    def set(self, identifier: str, **changes: Any) -> None:
        """Change a row."""
        self.rows[identifier] = replace(self.rows[identifier], **changes)
        if time.monotonic() - self._written >= SECONDS_BETWEEN_WRITES:
            self.write()
        self.tick()

    def tick(self) -> None:
        """Show the state; the place where a campaign is stopped."""
        if self.shown is not None:
            self.shown(self)

    def started(self, identifier: str) -> None:
        """A worker has begun with a case."""
        self.share[identifier] = 0.0
        self.set(identifier, state="running", reason="")

    def told(self, identifier: str, text: str, share: float) -> None:
        """A worker tells how far it is."""
        if self.rows[identifier].state == "running":
            self.text[identifier] = text
            self.share[identifier] = min(max(share, 0.0), 1.0)

    def ended(self, identifier: str, outcome: Outcome) -> None:
        """A case has ended."""
        self._forget(identifier)
        spent = self.rows[identifier].seconds + outcome.seconds
        self.set(identifier, state=outcome.state, reason=outcome.reason, seconds=spent)

    def worker_died(self, identifier: str, most: int) -> bool:
        """A worker died with a case; True where it is to be tried again.

        Args:
            identifier: of the case.
            most: deaths after which the case counts as failed.
        """
        self._forget(identifier)
        self.lost[identifier] += 1
        if self.lost[identifier] < most:
            self.set(identifier, state="waiting")
            return True
        reason = (
            f"its worker process ended abruptly {most} times: killed, or out of memory "
            "(use fewer grains or fewer workers)"
        )
        self.set(identifier, state="failed", reason=reason)
        return False

    def stop(self) -> None:
        """What is running counts as interrupted."""
        for identifier, row in self.rows.items():
            if row.state == "running":
                self._forget(identifier)
                self.rows[identifier] = replace(row, state="interrupted")

    def _forget(self, identifier: str) -> None:
        self.share.pop(identifier, None)
        self.text.pop(identifier, None)

    def count(self) -> dict[str, int]:
        """Number of cases in each state."""
        counts = Counter(row.state for row in self.rows.values())
        return {state: counts[state] for state in STATES}

    def in_state(self, *states: State) -> list[Row]:
        """Rows in one of the states."""
        return [row for row in self.rows.values() if row.state in states]

    @property
    def fraction(self) -> float:
        """Part of the cases that is done, running ones by how far they are."""
        over = len(self.in_state("done", "failed")) + sum(self.share.values())
        return over / max(len(self.rows), 1)


def read_table(path: Path) -> list[Row]:
    """Rows of ``cases.csv``; none where there is no such file.

    Raises:
        CorruptFile: it is not such a table.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError) as error:
        raise CorruptFile(f"{path}: cannot be read ({error})") from None
    try:
        return [_row(cells) for cells in csv.DictReader(io.StringIO(text), strict=True)]
    except (csv.Error, KeyError, ValueError, TypeError, AttributeError) as error:
        raise CorruptFile(
            f"{path}: is not the table of a campaign ({error}); delete it: the next sweep finds "
            "what is done from the folders of the cases"
        ) from None


def _row(cells: dict[str, str]) -> Row:
    state = cells["state"]
    if state not in STATES:
        raise ValueError(f"state {state!r}, allowed {', '.join(STATES)}")
    return Row(
        id=_plain_name(cells["id"]),
        parameters={name: cells[name] for name in cells if name not in COLUMNS},
        seed=int(cells["seed"]),
        state=state,
        reason=cells["reason"],
        seconds=float(cells["seconds"]),
    )


def _plain_name(identifier: str) -> str:
    """The id, which is a folder's name and nothing else."""
    if not identifier or identifier.startswith(".") or set(identifier) & set("/\\"):
        raise ValueError(f"id {identifier!r} is no name of a case")
    return identifier
