"""Damage a file many times: a reader gives the right frames or one error, never anything else."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np

from granufab.errors import GranufabError
from granufab.history import Run

__all__ = ["State", "check_mutations", "check_truncations", "states"]

State = list[np.ndarray]


def states(run: Run) -> tuple[list[State], GranufabError | None]:
    """Arrays of the frames up to the first that cannot be read, and why it cannot."""
    seen: list[State] = []
    for index in range(len(run.frames)):
        try:
            packing = run.frames[index].packing
        except GranufabError as error:
            return seen, error
        arrays = [packing.grains.position, packing.grains.radius]
        if packing.contacts is not None:
            arrays += [packing.contacts.pair, packing.contacts.normal]
            arrays += [] if packing.contacts.force is None else [packing.contacts.force]
        seen.append(arrays)
    return seen, None


def _attempt(read: Callable[[], Run], folder: Path, what: str) -> list[State]:
    """Frames that could be read; an error must be granufab's, one line, and name a file."""
    try:
        seen, error = states(read())
    except GranufabError as raised:
        seen, error = [], raised
    if error is not None:
        text = str(error)
        names = [path.name for path in (folder, *folder.iterdir())]
        assert "\n" not in text and any(name in text for name in names), f"{what}: {text!r}"
    return seen


def check_truncations(
    path: Path, read: Callable[[], Run], *, count: int = 200, seed: int = 0
) -> int:
    """Cut a file at random places: the frames read must be the first ones of the whole file.

    Args:
        path: the file, restored afterwards.
        read: opens it, with the files that complete it, from the same folder.
        count: of cuts.
        seed: of the places.
    Returns:
        How often some frames, but not all, were read.
    """
    whole = path.read_bytes()
    wanted, error = states(read())
    assert error is None and wanted
    partial = 0
    try:
        for cut in random.Random(seed).choices(range(len(whole)), k=count):
            path.write_bytes(whole[:cut])
            seen = _attempt(read, path.parent, f"{path.name} cut at byte {cut}")
            assert len(seen) <= len(wanted)
            for got, right in zip(seen, wanted, strict=False):
                same = len(got) == len(right) and all(map(np.array_equal, got, right))
                assert same, f"{path.name} cut at byte {cut} of {len(whole)}: other data"
            partial += 0 < len(seen) < len(wanted)
    finally:
        path.write_bytes(whole)
    return partial


def check_mutations(path: Path, read: Callable[[], Run], *, count: int = 200, seed: int = 1) -> int:
    """Change single bytes of a file: it is read, or refused with one line.

    Args:
        path: the file, restored afterwards.
        read: opens it, with the files that complete it, from the same folder.
        count: of changes.
        seed: of places and values.
    Returns:
        How often nothing could be read.
    """
    whole = path.read_bytes()
    chance = random.Random(seed)
    refused = 0
    try:
        for _ in range(count):
            place, value = chance.randrange(len(whole)), chance.randrange(256)
            path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
            refused += not _attempt(read, path.parent, f"{path.name} byte {place} set to {value}")
    finally:
        path.write_bytes(whole)
    return refused
