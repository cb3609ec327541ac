"""Pairs found from positions and radii alone, through the images of a periodic cell."""

from __future__ import annotations

import itertools

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidPacking
from granufab.packing import Array, Cell, Contacts, IntArray, Packing

__all__ = [
    "branch_images",
    "branch_vectors",
    "cell_fractions",
    "neighbours_within",
    "walls_within",
    "wrap",
]


def neighbours_within(packing: Packing, gap: float) -> Contacts:
    """All pairs whose surfaces are closer than ``gap``, images of a periodic cell included.

    Works for any lattice (tilted too), for walls, for an unbounded cloud, and for cells so
    small that a grain meets several images of another, or its own.

    Args:
        packing: positions, radii and, where it has one, the cell.
        gap: largest surface distance, exclusive [m].
    Returns:
        Contacts with i ≤ j, sorted by pair, with normal, branch, gap and image; no forces.
    Raises:
        InvalidPacking: two grains share one centre.
    """
    position, radius, cell = packing.grains.position, packing.grains.radius, packing.cell
    cut = 2.0 * float(radius.max()) + gap
    wrapped, turns = wrap(position, cell)
    owner, shift, ghost = _ghosts(wrapped, cell, cut)
    count = len(radius)
    points = np.concatenate([wrapped, ghost])
    found = (
        scipy.spatial.cKDTree(points)
        .query_pairs(max(cut, 0.0), output_type="ndarray")
        .astype(np.int64)
    )
    found.sort(axis=1)
    found = found[found[:, 0] < count]
    owners = np.concatenate([np.arange(count), owner])
    shifts = np.concatenate([np.zeros_like(turns), shift])
    i, j, move = found[:, 0], owners[found[:, 1]], shifts[found[:, 1]]
    branch = points[found[:, 1]] - wrapped[i]
    distance = np.linalg.norm(branch, axis=1)
    surface = distance - radius[i] - radius[j]
    keep = (surface < gap) & ((i < j) | ((i == j) & _points_forward(move)))
    i, j, move, branch = i[keep], j[keep], move[keep], branch[keep]
    distance, surface = distance[keep], surface[keep]
    if len(distance) and not distance.min() > 0:
        k = int(np.argmin(distance))
        raise InvalidPacking(f"grains {i[k]} and {j[k]} have the same centre")
    order = np.lexsort((*move.T[::-1], j, i))
    return Contacts(
        pair=np.column_stack([i, j])[order],
        normal=(branch / distance[:, None])[order],
        branch=branch[order],
        gap=surface[order],
        image=(move - turns[j] + turns[i])[order],
    )


def walls_within(packing: Packing, gap: float) -> IntArray:
    """Grains closer than ``gap`` to a flat wall of the cell, once per wall.

    Args:
        packing: a cell without walls, or none, has no such grains.
        gap: largest surface distance, exclusive [m].
    Returns:
        Grain indices, shape (wall_contact_count,).
    """
    cell, radius = packing.cell, packing.grains.radius
    near: list[IntArray] = []
    if cell is not None and cell.origin is not None:
        for axis in np.flatnonzero(~np.array(cell.periodic)):
            low = packing.grains.position[:, axis] - cell.origin[axis]
            high = cell.matrix[axis, axis] - low
            near += [np.flatnonzero(side - radius < gap) for side in (low, high)]
    return np.concatenate(near) if near else np.zeros(0, dtype=np.int64)


def branch_vectors(packing: Packing) -> Array:
    """Branches ℓ = r_j − r_i of the listed contacts [m], shape (contact_count, D).

    Taken from the list; else along the normals at R_i + R_j + gap; else from the positions,
    through the listed image or the nearest one.
    """
    contacts, grains = packing.contacts, packing.grains
    if contacts is None:
        return np.zeros((0, packing.dimension))
    if contacts.branch is not None:
        return contacts.branch
    i, j = contacts.pair.T
    if contacts.gap is not None:
        length = grains.radius[i] + grains.radius[j] + contacts.gap
        return contacts.normal * length[:, None]
    branch = grains.position[j] - grains.position[i]
    if packing.cell is None:
        return branch
    image = contacts.image
    if image is None:
        fraction = np.linalg.solve(packing.cell.matrix, branch.T).T
        image = -np.rint(fraction) * np.array(packing.cell.periodic)
    return branch + image @ packing.cell.matrix.T


def cell_fractions(position: Array, cell: Cell) -> Array:
    """Coordinates along the lattice vectors, 0..1 inside the cell [-], shape (grain_count, D)."""
    origin = 0.0 if cell.origin is None else cell.origin
    return np.asarray(np.linalg.solve(cell.matrix, (position - origin).T).T, dtype=np.float64)


def branch_images(branch: Array, pair: IntArray, position: Array, cell: Cell | None) -> IntArray:
    """Lattice vectors from j to the image of j at the end of each branch, whole numbers.

    Args:
        branch: vectors from i to the image of j [m], shape (count, D).
        pair: grains i and j, shape (count, 2).
        position: of all grains [m], wrapped or not, shape (grain_count, D).
        cell: lattice vectors and periodic axes; None gives no images.
    Returns:
        Shape (count, D); 0 along axes that do not repeat.
    """
    if cell is None:
        return np.zeros(branch.shape, dtype=np.int64)
    shift = branch - (position[pair[:, 1]] - position[pair[:, 0]])
    fraction = np.linalg.solve(cell.matrix, shift.T).T
    return np.rint(fraction * np.array(cell.periodic)).astype(np.int64)


def wrap(position: Array, cell: Cell | None) -> tuple[Array, IntArray]:
    """Positions moved into the cell along its periodic axes.

    Args:
        position: [m], shape (grain_count, D).
        cell: None leaves the positions.
    Returns:
        Wrapped positions [m] and the integer lattice vectors taken away, both (grain_count, D).
    """
    turns = np.zeros(position.shape, dtype=np.int64)
    if cell is None:
        return np.array(position), turns
    fraction = cell_fractions(position, cell)
    turns[:] = np.floor(fraction) * np.array(cell.periodic)
    return position - turns @ cell.matrix.T, turns


def _ghosts(wrapped: Array, cell: Cell | None, cut: float) -> tuple[IntArray, IntArray, Array]:
    """Images outside the cell within ``cut`` of it: owner, lattice shift, position."""
    dimension = wrapped.shape[1]
    owners = [np.zeros(0, dtype=np.int64)]
    shifts = [np.zeros((0, dimension), dtype=np.int64)]
    ghosts = [np.zeros((0, dimension))]
    if cell is None:
        return owners[0], shifts[0], ghosts[0]
    inverse = np.linalg.inv(cell.matrix)
    # Lattice planes of axis k are 1/|row k of the inverse| apart.
    margin = max(cut, 0.0) * np.linalg.norm(inverse, axis=1) + 1e-12
    fraction = cell_fractions(wrapped, cell)
    turns = [int(np.ceil(m)) if p else 0 for m, p in zip(margin, cell.periodic, strict=True)]
    open_axis = ~np.array(cell.periodic)
    for shift in itertools.product(*(range(-n, n + 1) for n in turns)):
        if not any(shift):
            continue
        moved = fraction + np.array(shift)
        inside = (open_axis | ((moved >= -margin) & (moved <= 1.0 + margin))).all(axis=1)
        index = np.flatnonzero(inside)
        owners.append(index)
        shifts.append(np.tile(np.array(shift, dtype=np.int64), (len(index), 1)))
        ghosts.append(wrapped[index] + cell.matrix @ np.array(shift, dtype=float))
    return np.concatenate(owners), np.concatenate(shifts), np.concatenate(ghosts)


def _points_forward(shift: IntArray) -> np.ndarray:
    """True where the first non-zero component is positive: one of each pair ±shift."""
    sign = np.zeros(len(shift), dtype=np.int64)
    for column in shift.T:
        sign = np.where(sign == 0, np.sign(column), sign)
    return sign > 0
