"""The box of a dump or a data file as a cell: orthogonal, triclinic, general triclinic.

A triclinic dump gives the bounds of the box that encloses the tilted one; the tilts are
subtracted. A boundary is periodic (``pp``), fixed (``f``: a flat wall) or shrink-wrapped (``s``,
``m``: it follows the grains, so it is neither a wall nor a lattice).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.found import FoundCell
from granufab.io.text_rows import number_fault
from granufab.packing import Array

__all__ = ["bounds_cell", "tilted_cell"]

_BOUNDARIES = frozenset("pfsm")


def bounds_cell(
    words: Sequence[str], lines: Sequence[Sequence[str]], place: str, periodic: str | None
) -> FoundCell:
    """The cell that ``ITEM: BOX BOUNDS`` describes.

    Args:
        words: after BOX BOUNDS: tilts or ``abc origin``, then boundaries.
        lines: the three lines below, as words.
        place: file and frame, for messages.
        periodic: axes that the user gives, which replace the boundaries.
    Raises:
        CorruptFile: numbers are missing, or the box has no volume.
        MissingData: nothing says which axes are periodic.
    """
    general = "abc" in words
    tilted = "xy" in words
    columns = 4 if general else 3 if tilted else 2
    box = _numbers(lines, columns, place)
    wraps, free = _boundaries(words, place, periodic)
    if general:
        matrix, origin = box[:, :3].T.copy(), box[:, 3].copy()
        return _checked(matrix, origin, wraps, free, place)
    low, high = box[:, 0].copy(), box[:, 1].copy()
    xy, xz, yz = box[:, 2] if tilted else np.zeros(3)
    low[0] -= min(0.0, xy, xz, xy + xz)
    high[0] -= max(0.0, xy, xz, xy + xz)
    low[1] -= min(0.0, yz)
    high[1] -= max(0.0, yz)
    return tilted_cell(low, high, (xy, xz, yz), wraps, place, free)


def tilted_cell(
    low: Array,
    high: Array,
    tilts: tuple[float, float, float],
    periodic: tuple[bool, ...],
    place: str,
    free: tuple[bool, ...] = (False, False, False),
) -> FoundCell:
    """A box with edges a = (lx, 0, 0), b = (xy, ly, 0), c = (xz, yz, lz) from its lower corner.

    Raises:
        CorruptFile: it has no volume.
    """
    matrix = np.diag(np.asarray(high, float) - low)
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = tilts
    return _checked(matrix, np.asarray(low, float), periodic, free, place)


def _checked(
    matrix: Array, origin: Array, periodic: tuple[bool, ...], free: tuple[bool, ...], place: str
) -> FoundCell:
    volume = np.linalg.det(matrix) if np.isfinite(matrix).all() else np.nan
    if not (volume > 0 and np.isfinite(volume) and np.isfinite(origin).all()):
        raise CorruptFile(f"{place}: the box has volume {volume:.6g}, must be > 0")
    return FoundCell(matrix=matrix, origin=origin, periodic=periodic, free=free)


def _numbers(lines: Sequence[Sequence[str]], columns: int, place: str) -> Array:
    if len(lines) != 3 or any(len(line) < columns for line in lines):
        found = [len(line) for line in lines]
        raise CorruptFile(
            f"{place}: BOX BOUNDS has lines of {found} numbers, expected 3 of {columns}"
        )
    try:
        return np.array([[float(word) for word in line[:columns]] for line in lines])
    except ValueError:
        words = (word for line in lines for word in line[:columns])
        fault = next(filter(None, map(number_fault, words)), "")
        raise CorruptFile(f"{place}: BOX BOUNDS: {fault}") from None


def _boundaries(
    words: Sequence[str], place: str, periodic: str | None
) -> tuple[tuple[bool, ...], tuple[bool, ...]]:
    """Per axis: periodic, shrink-wrapped."""
    known = ("abc", "origin", "xy", "xz", "yz")
    flags = [word for word in words if word not in known]
    wrong = [word for word in flags if len(word) != 2 or set(word) - _BOUNDARIES]
    if wrong or len(flags) not in (0, 3):
        raise CorruptFile(
            f"{place}: BOX BOUNDS has the boundaries {' '.join(flags)!r}, expected three of pp, "
            "ff, ss, mm, fs, …"
        )
    free = tuple(bool(set(flag) & set("sm")) for flag in flags) or (False,) * 3
    if periodic is not None:
        wraps = tuple(axis in periodic for axis in "xyz")
        return wraps, tuple(f and not w for f, w in zip(free, wraps, strict=True))
    if not flags:
        raise MissingData(
            f"{place}: BOX BOUNDS does not say which axes are periodic; give --periodic xyz (those "
            "that are), or --periodic '' for none"
        )
    return tuple(flag == "pp" for flag in flags), free
