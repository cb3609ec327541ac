"""No body of a frame may be listed twice."""

from __future__ import annotations

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.found import FoundFrame
from granufab.packing import IntArray

__all__ = ["check_distinct"]


def check_distinct(found: FoundFrame) -> None:
    """Bodies differ in their numbers, or else in centre or radius.

    Two disks or spheres with the same centre and radius to the last bit are a row that was copied.

    Args:
        found: the frame.
    Raises:
        CorruptFile: one body is another again.
    """
    if found.number is not None:
        _check_numbers(np.asarray(found.number, np.int64), found.place)
    elif found.round:
        _check_places(found)


def _check_numbers(number: IntArray, place: str) -> None:
    unique, count = np.unique(number, return_counts=True)
    if len(unique) != len(number):
        raise CorruptFile(f"{place}: body {int(unique[np.argmax(count)])} is listed more than once")


def _check_places(found: FoundFrame) -> None:
    position = np.asarray(found.position, float)
    grain = np.ones(len(position), bool) if found.wall is None else ~found.wall
    order = np.flatnonzero(grain)[np.argsort(position[grain, 0], kind="stable")]
    level = np.diff(position[order, 0]) == 0
    first = np.flatnonzero(level)
    near = order[np.union1d(first, first + 1)]  # the others differ in x already
    columns = [position[near]]
    if found.radius is not None:
        columns.append(np.asarray(found.radius, float)[near, None])
    rows = np.concatenate(columns, axis=1)
    ranked = np.lexsort(rows.T)
    again = np.flatnonzero((np.diff(rows[ranked], axis=0) == 0).all(axis=1))
    if len(again):
        one, other = sorted(near[ranked[[again[0], again[0] + 1]]].tolist())
        raise CorruptFile(
            f"{found.place}: body {other} is body {one} again: the same centre and radius"
        )
