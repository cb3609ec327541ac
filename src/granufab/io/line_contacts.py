"""Contacts as lines with values, as ``dump local/gran/vtk`` of LIGGGHTS writes them.

Each contact of ``compute pair/gran/local`` is a line between two centres; with the point of contact
two more lines lead to it, and the values stand three times. ``compute wall/gran/local`` writes
lines from the wall to a centre. ``id1`` and ``id2`` are the grains, or mesh and triangle of a wall.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from granufab.errors import CorruptFile
from granufab.io.found import FoundContacts
from granufab.packing import Array, IntArray

__all__ = ["joined_contacts", "line_contacts"]

NEAR = 0.05
"""Largest distance, in smallest radii, of a line's end from the centre that it stands for: numbers
in text are rounded, and a wall is a whole radius away."""

_WIDTHS = {"force": 3, "force_normal": 3, "force_tangential": 3, "delta": 1, "id1": 1, "id2": 1}


def line_contacts(
    place: str,
    points: Array,
    lines: IntArray,
    cells: Mapping[str, Array],
    *,
    position: Array,
    radius: Array | None,
    number: IntArray | None,
) -> FoundContacts:
    """Contacts of one file; those with walls are marked.

    Args:
        place: the file, for messages.
        points: shape (point_count, 3).
        lines: the points at both ends, shape (line_count, 2).
        cells: values of the lines by name, shape (line_count, components).
        position, radius, number: of the grains.
    Raises:
        CorruptFile: a line joins points that do not exist, or ends at no grain at either end.
    """
    if lines.size and (lines.min() < 0 or lines.max() >= len(points)):
        raise CorruptFile(
            f"{place}: a line joins point {int(lines.max())}, there are {len(points)}"
        )
    for name, width in _WIDTHS.items():
        if name in cells and cells[name].shape != (len(lines), width):
            raise CorruptFile(f"{place}: {name} has shape {cells[name].shape}, not "
                              f"({len(lines)}, {width})")  # fmt: skip
    step = 3 if _has_points(lines) else 1
    values = {name: cells[name][::step] for name in _WIDTHS if name in cells}
    ends = lines[::step]
    if len(position) == 0 and len(ends):
        raise CorruptFile(f"{place}: has {len(ends)} contacts, but there are no grains")
    grain, near = _grains_at(points, ends, position, radius)
    if len(ends) and not near.any(axis=1).all():
        row = int(np.argmin(near.any(axis=1)))
        raise CorruptFile(f"{place}: contact {row} ends at no centre of a grain")
    pair, wall = _pairs(values, grain, near, number)
    force = values.get("force")
    if force is None and {"force_normal", "force_tangential"} <= set(values):
        force = values["force_normal"] + values["force_tangential"]
    return FoundContacts(
        first=pair[:, 0],
        second=pair[:, 1],
        wall=wall,
        force=force,
        force_on=None,
        gap=-values["delta"][:, 0] if "delta" in values else None,
        point=points[lines[1::3, 1]] if step == 3 else None,
        place=place,
    )


def _has_points(lines: IntArray) -> bool:
    """Whether every contact has three lines: between the centres, and from both to its point."""
    if len(lines) == 0 or len(lines) % 3:
        return False
    along, one, two = lines[::3], lines[1::3], lines[2::3]
    same = (one[:, 0] == along[:, 0]) & (two[:, 0] == along[:, 1]) & (one[:, 1] == two[:, 1])
    return bool(same.all())


def _grains_at(
    points: Array, ends: IntArray, position: Array, radius: Array | None
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Nearest grain at both ends of each line, and whether its centre is there."""
    if len(ends) == 0:
        return np.zeros((0, 2), np.int64), np.zeros((0, 2), bool)
    where = points[ends.ravel()]
    sound = np.isfinite(where).min(axis=1)
    distance, grain = cKDTree(position).query(np.where(sound[:, None], where, 0.0))
    reach = NEAR * (1.0 if radius is None else float(np.min(radius)))
    near = sound & (np.asarray(distance) <= reach)
    return np.asarray(grain, np.int64).reshape(-1, 2), near.reshape(-1, 2)


def _pairs(
    values: Mapping[str, Array],
    grain: IntArray,
    near: NDArray[np.bool_],
    number: IntArray | None,
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Numbers of both bodies, and where one of them is a wall."""
    by_place = grain if number is None else np.asarray(number, np.int64)[grain]
    walls: NDArray[np.bool_] = ~near.min(axis=1, initial=True)
    if number is None or "id1" not in values or "id2" not in values:
        return by_place, walls
    if 2 * np.count_nonzero(walls) > len(walls):
        return by_place, np.ones(len(walls), bool)
    # Positions may be wrapped otherwise than those of the grains: then the numbers tell.
    named = np.column_stack([values["id1"][:, 0], values["id2"][:, 0]]).astype(np.int64)
    return named, np.zeros(len(named), bool)


def joined_contacts(parts: Sequence[FoundContacts]) -> FoundContacts:
    """Lists of one state as one; values that one of them lacks are left out."""
    if len(parts) == 1:
        return parts[0]
    listed = [part for part in parts if len(part.first)] or list(parts[:1])

    def column(name: str) -> np.ndarray | None:
        values = [getattr(part, name) for part in listed]
        return None if any(value is None for value in values) else np.concatenate(values)

    first, second = column("first"), column("second")
    assert first is not None
    assert second is not None
    return FoundContacts(
        first=first,
        second=second,
        wall=column("wall"),
        force=column("force"),
        force_on=None,
        gap=column("gap"),
        place=parts[0].place,
    )
