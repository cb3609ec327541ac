"""The cell that the boundaries of a MercuryDPM restart make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.found import FoundCell
from granufab.io.readers.keyword_lines import Lines, numbers_after
from granufab.packing import Array

__all__ = ["Boundary", "parse_boundary", "restart_cell", "whole_turns"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Boundary:
    """One periodic direction.

    Attributes:
        axis: along which it repeats.
        low: where it starts on that axis.
        shift: lattice vector, shape (3,).
        turns: whole widths in the first component of ``shift``.
        second: the other direction of a Lees–Edwards pair.
    """

    axis: int
    low: float
    shift: tuple[float, ...]
    turns: int = 0
    second: Boundary | None = None


def parse_boundary(words: list[str], lines: Lines) -> Boundary | None:
    """A boundary that makes the box periodic; None for insertion, deletion and the like."""
    place = lines.place
    if words[0] == "LeesEdwardsBoundary":
        left, right, down, up, shift = (
            numbers_after(words, name, 1, place)[0]
            for name in ("left", "right", "down", "up", "shift")
        )
        width = right - left
        if not width > 0:
            raise CorruptFile(f"{place}: right is {right:g}, must be beyond left = {left:g}")
        return Boundary(
            axis=1,
            low=down,
            shift=(shift, up - down, 0.0),
            turns=round(shift / width),
            second=Boundary(axis=0, low=left, shift=(width, 0.0, 0.0)),
        )
    if "shift" not in words or "normal" not in words or "Angled" in words[0]:
        return None
    normal = np.array(numbers_after(words, "normal", 3, place))
    low = "pos_left" if "pos_left" in words else "distanceLeft"
    shift = numbers_after(words, "shift", 3, place)
    axis = int(np.argmax(np.abs(normal)))
    start = numbers_after(words, low, 1, place)[0]
    return Boundary(axis=axis, low=start, shift=tuple(shift))


def whole_turns(boundaries: Sequence[Boundary]) -> int:
    """Widths by which the upper image of a Lees–Edwards box has moved."""
    return next((boundary.turns for boundary in boundaries if boundary.second is not None), 0)


def restart_cell(
    lower: Array, upper: Array, boundaries: Sequence[Boundary], turns: int, place: str
) -> FoundCell | None:
    """The box with the lattice vectors of the periodic directions.

    Args:
        lower, upper: corners of the domain, shape (D,).
        boundaries: periodic directions.
        turns: whole widths to take from a Lees–Edwards shift: the same in all frames of a series,
            so that its strain runs on.
        place: file, for messages.
    """
    dimension = len(lower)
    matrix, origin = np.diag(upper - lower), lower.copy()
    periodic = [False] * dimension
    for boundary in boundaries:
        for one in (boundary, boundary.second):
            if one is None or one.axis >= dimension:
                continue
            matrix[:, one.axis] = one.shift[:dimension]
            origin[one.axis], periodic[one.axis] = one.low, True
        if boundary.second is not None:
            matrix[0, boundary.axis] -= turns * boundary.second.shift[0]
    if not np.linalg.det(matrix) > 0:
        if any(periodic):
            raise CorruptFile(f"{place}: the boundaries enclose no volume")
        return None
    return FoundCell(matrix=matrix, origin=origin, periodic=tuple(periodic))
