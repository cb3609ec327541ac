r"""How far the upper image of a sheared periodic box has moved, where no file says it.

A contact across the upper edge has the branch ℓ = Δr ∓ (s, H) along its listed normal. Its second
component is known, |ℓ| = (Δy ∓ H)/n_y, so s = ∓(|ℓ| n_x − Δx), up to whole widths. The strain rate
and the times of the frames, where they are known, tell which width and confirm it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.found import FoundContacts
from granufab.packing import Array

__all__ = ["Offsets", "measured_offset"]

AGREES = 0.01
"""Largest difference of the measured and the told offset that agree [mean radii]."""
TOUCHES = 0.5
"""Largest surface distance or overlap of contacts across the edge [mean radii]."""


def measured_offset(
    position: Array, contacts: FoundContacts, edges: Array, reach: float
) -> float | None:
    """The offset s in 0..width from contacts across the upper edge; None where there is none.

    Args:
        position: shape (body_count, 2).
        contacts: with normals that point to the second body.
        edges: width and height of the box.
        reach: longest branch of a contact.
    """
    if contacts.normal is None:
        return None
    apart = position[contacts.second] - position[contacts.first]
    side = np.rint(apart[:, 1] / edges[1])
    normal = contacts.normal
    use = (np.abs(side) == 1) & (np.abs(normal[:, 1]) > 0.3)
    apart, side, normal = apart[use], side[use], normal[use]
    length = (apart[:, 1] - side * edges[1]) / normal[:, 1]
    good = (np.abs(length) < reach) & np.isfinite(length)
    if not good.any():
        return None
    apart, side, normal, length = apart[good], side[good], normal[good], length[good]
    offset = side * (apart[:, 0] - length * normal[:, 0])
    middle = np.exp(2j * np.pi * offset / edges[0]).mean()
    centre = float(np.angle(middle)) / (2 * np.pi) * edges[0]
    near = offset - centre
    near -= edges[0] * np.rint(near / edges[0])
    return float((centre + np.median(near)) % edges[0])


class Offsets:
    """Offsets of the frames of a series, continuous over its frames.

    Args:
        edges: width and height of the box.
        radius: of the grains.
        told: offset of each frame by the strain rate and its time, or None.
    """

    def __init__(self, *, edges: Array, radius: Array, told: Sequence[float] | None) -> None:
        self._edges, self._radius, self._told = edges, radius, told
        self._first: float | None = None

    def of(self, k: int, position: Array, contacts: FoundContacts | None, place: str) -> float:
        """Offset of frame k: within half a width in the first frame asked for, then running on.

        Raises:
            CorruptFile: grains in contact across the edge do not touch at any offset.
        """
        width = self._edges[0]
        mean = float(self._radius.mean())
        reach = 3.0 * float(self._radius.max())
        seen = None
        if contacts is not None:
            seen = measured_offset(position, contacts, self._edges, reach)
        told = None if self._told is None else self._told[k]
        value = told if told is not None else (seen or 0.0)
        if seen is not None:
            difference = seen - value
            difference -= width * np.rint(difference / width)
            if abs(difference) > AGREES * mean:
                value += difference
        if self._first is None:
            self._first = value if told is None else told
            self._turns = width * np.ceil(value / width - 0.5)
        value -= self._turns
        if told is None:
            value -= width * np.rint((value - (self._first - self._turns)) / width)
        if contacts is not None:
            self._verify(value, position, contacts, place)
        return float(value)

    def _verify(self, tilt: float, position: Array, contacts: FoundContacts, place: str) -> None:
        """Contacts across the edge must join grains that touch."""
        branch = position[contacts.second] - position[contacts.first]
        side = np.rint(branch[:, 1] / self._edges[1])
        branch = branch - side[:, None] * np.array([tilt, self._edges[1]])
        branch[:, 0] -= self._edges[0] * np.rint(branch[:, 0] / self._edges[0])
        pair = np.column_stack([contacts.first, contacts.second])
        gap = np.linalg.norm(branch, axis=1) - self._radius[pair].sum(axis=1)
        if (side != 0).any() and np.median(np.abs(gap[side != 0])) > TOUCHES * self._radius.mean():
            row = int(np.flatnonzero(side != 0)[0])
            raise CorruptFile(
                f"{place}: contacts across the upper edge (the first is contact {row}) do not "
                "touch at any offset of its image "
                f"(median surface distance {np.median(np.abs(gap[side != 0])):.3g})"
            )
