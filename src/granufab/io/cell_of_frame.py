"""The cell of a frame: the user's, else the file's, on the axes that the data use."""

from __future__ import annotations

import numpy as np

from granufab.errors import InvalidSettings
from granufab.fabric.stress import solid_fraction
from granufab.io.found import FoundCell, FoundFrame
from granufab.io.read_options import ReadOptions
from granufab.packing import Array, Cell, Grains, Packing

__all__ = ["cell_of"]

FULLEST = 2.0
"""Largest solid fraction in a cell of the user; soft or angular grains may exceed 1 somewhat."""


def cell_of(
    found: FoundFrame, options: ReadOptions, axes: list[int], grains: Grains
) -> Cell | None:
    """The cell in the coordinates that are used, or None.

    Args:
        found: as the file gives it.
        options: what the user adds.
        axes: columns of the coordinates that are used.
        grains: for bounds that only follow them.
    Raises:
        InvalidSettings: the options do not fit the data.
    """
    lowest = (grains.position - grains.radius[:, None]).min(axis=0)
    names = "".join("xyz"[k] for k in axes)
    repeats = options.repeats(names)
    given = options.box(names, lowest)
    if given is not None and not _same_edges(given, found.cell, axes):
        cell = Cell(matrix=given.matrix, periodic=given.periodic, origin=given.origin)
        _check_size(cell, grains)
        return cell
    box = found.cell
    if box is None:
        if repeats is not None and any(repeats):
            raise InvalidSettings(
                f"periodic is {options.periodic!r}, but {found.place} has no cell; give it (--cell)"
            )
        return None
    use = axes if len(box.matrix) == 3 else list(range(len(axes)))
    periodic = tuple(box.periodic[k] for k in use)
    periodic = periodic if repeats is None else repeats
    matrix, origin = _tilts(box, use, periodic), np.array(box.origin, float)[use]
    free = [k for k, axis in enumerate(use) if box.free and box.free[axis] and not periodic[k]]
    if len(free) == len(use):
        return None
    for k in free:  # such a bound is where the outermost grains end
        low = grains.position[:, k] - grains.radius
        high = grains.position[:, k] + grains.radius
        origin[k] = low.min()
        matrix[k, k] = high.max() - origin[k]
    return Cell(matrix=matrix, periodic=periodic, origin=origin)


def _check_size(cell: Cell, grains: Grains) -> None:
    """Refuse a cell of the user in which the grains do not go."""
    filled = solid_fraction(Packing(grains=grains, cell=cell))
    if filled > FULLEST:
        edges = ",".join(f"{edge:g}" for edge in cell.matrix.diagonal())
        raise InvalidSettings(
            f"cell has the edges {edges}, the grains have {filled:.3g} times its volume; give the "
            "edges in the units of the positions"
        )


def _same_edges(given: FoundCell, box: FoundCell | None, axes: list[int]) -> bool:
    """Whether the user's edges are those of the box: it then keeps the tilt that was found."""
    if box is None:
        return False
    edges = np.diag(box.matrix)[axes if len(box.matrix) == 3 else slice(len(axes))]
    return np.allclose(edges, np.diag(given.matrix), rtol=1e-12, atol=0.0)


def _tilts(box: FoundCell, use: list[int], periodic: tuple[bool, ...]) -> Array:
    """The lattice of the axes in use; an axis with walls has no tilt."""
    matrix = np.array(box.matrix, float)[np.ix_(use, use)]
    for k, wraps in enumerate(periodic):
        if not wraps:
            edge = matrix[k, k]
            matrix[k, :], matrix[:, k] = 0.0, 0.0
            matrix[k, k] = edge
    return matrix
