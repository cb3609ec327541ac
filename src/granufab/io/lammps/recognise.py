"""Nameless columns of a local dump, recognised by what they say about the grains beside them.

Two neighbouring columns of numbers of grains that touch are the contacts' grains. Of the other
columns, three in a row along their branches are the force or its normal part (three that *are*
the branches or unit vectors are not), and three in a row across the branches that follow it are the
tangential part. Nothing is taken that does not hold in every row; what was taken is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granufab.io.found import FoundFrame
from granufab.io.lammps.columns import Columns
from granufab.io.lammps.dump_index import DumpFrame
from granufab.io.lammps.grains import frame_columns
from granufab.io.nearest_image import nearest_images
from granufab.packing import Array, IntArray

__all__ = ["recognised", "told"]

_ROWS = 2000
_FEWEST = 6
_ALONG = 0.9
"""Least cosine between branch and force: 26°, a friction of 0.48; boxes lag by a step besides."""
_ACROSS = 0.02
_SHARE = 0.99
"""Of the rows must agree: those across a boundary are off where the box lags."""


@dataclass(frozen=True, slots=True)
class _Branches:
    """Unit vectors and lengths of the branches of the rows."""

    unit: Array
    length: Array


def recognised(frame: DumpFrame, known: Columns, grains: FoundFrame) -> Columns | None:
    """The columns of a frame by comparison with its grains, or None where they are not clear.

    Args:
        frame: of contacts.
        known: what names or the user tell; its words are kept.
        grains: of the same step.
    Raises:
        CorruptFile: the rows are not what the header says; names the line.
    """
    if frame.count < _FEWEST or grains.radius is None or len(grains.position) == 0:
        return None
    table = frame_columns(frame, range(len(frame.columns)), _ROWS)
    pairs = [known.place["i"]] if known.has("i", "j") else range(len(frame.columns) - 1)
    for first in pairs:
        second = known.place.get("j", first + 1)
        branches = _branches(table[:, [first, second]], grains)
        if branches is not None:
            place = {"i": first, "j": second}
            place |= _forces(table, branches, set(place.values()))
            place |= known.place
            used = set(place.values())
            rest = tuple(name for k, name in enumerate(frame.columns) if k not in used)
            return Columns(place, rest)
    return None


def _branches(pair: Array, grains: FoundFrame) -> _Branches | None:
    """Branches of two columns of numbers of grains that touch, else None."""
    count = len(grains.position)
    number = np.arange(count) if grains.number is None else grains.number
    if not (pair == np.rint(pair)).all() or (pair[:, 0] == pair[:, 1]).any():
        return None
    order = np.argsort(number)
    spot = np.minimum(np.searchsorted(number[order], pair), count - 1)
    row: IntArray = order[spot]
    if not (number[row] == pair).all():
        return None
    position, radius = np.asarray(grains.position), np.asarray(grains.radius)
    branch = position[row[:, 1]] - position[row[:, 0]]
    if grains.cell is not None:
        branch, _ = nearest_images(branch, grains.cell.matrix, grains.cell.periodic)
    length = np.linalg.norm(branch, axis=1)
    touch = length < 1.05 * radius[row].sum(axis=1)
    if touch.mean() < _SHARE or not (length > 0).all():
        return None
    return _Branches(branch / length[:, None], length)


def _forces(table: Array, branches: _Branches, taken: set[int]) -> dict[str, int]:
    """The force's columns, with the tangential part's where they follow."""
    flat = not branches.unit[:, 2].any()
    for width in (3, 2) if flat else (3,):
        last = table.shape[1] - width + 1
        starts = [k for k in range(last) if not taken & set(range(k, k + width))]
        for k in starts:
            force = _Trial.of(table[:, k : k + width], branches)
            if not force.is_force(branches):
                continue
            place = {f"f{axis}": k + n for n, axis in enumerate("xyz"[:width])}
            if np.mean(force.along >= (1 - 1e-3) * force.size) < _SHARE:
                return place
            for t in (n for n in starts if n >= k + width):
                shear = _Trial.of(table[:, t : t + width], branches)
                if shear.is_across(force):
                    return place | {f"ft{axis}": t + n for n, axis in enumerate("xyz"[:width])}
            return place
    return {}


@dataclass(frozen=True, slots=True)
class _Trial:
    """Neighbouring columns as vectors: their sizes, and sizes of their parts along branches."""

    size: Array
    along: Array

    @classmethod
    def of(cls, vector: Array, branches: _Branches) -> _Trial:
        along = np.einsum("ci,ci->c", vector, branches.unit[:, : vector.shape[1]])
        return cls(np.linalg.norm(vector, axis=1), np.abs(along))

    def is_force(self, branches: _Branches) -> bool:
        """Along the branches, and neither the branches themselves nor unit vectors."""
        bare = np.allclose(self.size, branches.length, rtol=1e-3) or np.ptp(self.size) < 1e-9
        return bool(not bare and np.mean(self.along >= _ALONG * self.size) >= _SHARE)

    def is_across(self, force: _Trial) -> bool:
        """Across the branches, not all zero, and not larger than such forces can be."""
        across = np.mean(self.along <= _ACROSS * self.size) >= _SHARE
        return bool(across and self.size.any() and np.mean(self.size <= 1.5 * force.size) >= _SHARE)


def told(columns: Columns, names: Sequence[str]) -> str:
    """What was taken for what, for the summary."""
    taken = ", ".join(f"{word} = {names[k]}" for word, k in columns.place.items())
    return f"columns recognised by comparison with the grains: {taken}; --columns says otherwise"
