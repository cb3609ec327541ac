"""Checkpoints of a run in its folder: when they are written, and which case goes on from them."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.io import Checkpoint, RunFileWriter, previous_of, read_checkpoint, write_checkpoint
from granufab.simulate.settings import Case

__all__ = ["CHECKPOINT", "Checkpoints", "first_difference", "forget_checkpoints", "held_checkpoint"]

CHECKPOINT = "checkpoint"
"""Name of the file in a run's folder."""


@dataclass(slots=True, kw_only=True, eq=False)
class Checkpoints:
    """Writes the checkpoints of one run, by wall time and by strain.

    Attributes:
        folder: of the run.
        writer: of its run file; frames and rows written before a checkpoint belong to it.
        notes: plain data kept with every checkpoint.
        seconds: wall time between checkpoints.
        strain: strain between checkpoints, or None.
        deadline: ``time.monotonic()`` at which the run shall end, or infinity.
        timed_out: whether it ended there.
    """

    folder: Path
    writer: RunFileWriter
    notes: dict[str, Any]
    seconds: float
    strain: float | None
    deadline: float = math.inf
    timed_out: bool = False
    _last: float = 0.0
    _walked: float = 0.0

    def __post_init__(self) -> None:
        self._last = time.monotonic()

    def due(self, strain: float) -> bool:
        """Whether a checkpoint is wanted at ``strain`` = ∫|dε_q| into the path.

        Raises:
            KeyboardInterrupt: the deadline has passed.
        """
        now = time.monotonic()
        if now >= self.deadline:
            self.timed_out = True
            raise KeyboardInterrupt
        by_strain = self.strain is not None and strain >= self._walked + self.strain * (1 - 1e-9)
        if by_strain:
            self._walked = strain
        return by_strain or now - self._last >= self.seconds

    def keep(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Write a checkpoint; the run file reaches the disk before it.

        Raises:
            OSError: it could not be written; the one before is kept.
        """
        path = self.writer.path
        try:
            with path.open("rb") as stream:
                os.fsync(stream.fileno())
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from None
        counts = {"frames": self.writer.frame_count, "rows": self.writer.row_count}
        write_checkpoint(self.folder / CHECKPOINT, arrays, {**self.notes, **counts})
        self._last = time.monotonic()


def held_checkpoint(
    folder: Path, case: Case, engine: Mapping[str, str], *, elsewhere: bool
) -> Checkpoint | None:
    """The checkpoint from which a case can go on, or None where there is none.

    Args:
        folder: of the run.
        case: as it was given.
        engine: of this process, see :func:`granufab.simulate.engine_path.engine_path`.
        elsewhere: go on also with another engine, whose bits may differ.
    Raises:
        InvalidSettings: the run was of another case, or made by another engine.
        CorruptFile: the checkpoint and the one before are damaged.
    """
    try:
        held = read_checkpoint(folder / CHECKPOINT)
    except MissingData:
        return None
    difference = first_difference(held.notes["case"], case.model_dump(mode="json"))
    if difference:
        raise InvalidSettings(
            f"{folder}: the run there has other settings: {difference}; resume it with its own "
            "(settings.toml), or choose another folder"
        )
    other = first_difference(held.notes["engine"], dict(engine))
    if other and not elsewhere:
        raise InvalidSettings(
            f"{folder}: was made by another engine: {other}; the results may then differ in the "
            "last digits; --elsewhere goes on all the same"
        )
    return held


def first_difference(held: Any, given: Any, key: str = "") -> str:
    """The first entry in which two plain structures differ, in words; empty where they agree."""
    if isinstance(held, dict) and isinstance(given, dict):
        for name in [*held, *(name for name in given if name not in held)]:
            inner = f"{key}.{name}" if key else str(name)
            found = first_difference(held.get(name), given.get(name), inner)
            if found:
                return found
        return ""
    if isinstance(held, list) and isinstance(given, list) and len(held) == len(given):
        pairs = enumerate(zip(held, given, strict=True))
        found = (first_difference(a, b, f"{key}.{k}") for k, (a, b) in pairs)
        return next((text for text in found if text), "")
    return "" if held == given else f"{key} was {held!r}, now {given!r}"


def forget_checkpoints(folder: Path) -> None:
    """Remove the checkpoints of a run that is done, or that is made anew."""
    for path in (folder / CHECKPOINT, previous_of(folder / CHECKPOINT)):
        path.unlink(missing_ok=True)
