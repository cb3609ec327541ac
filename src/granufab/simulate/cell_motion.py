"""How the cell moves: exact affine steps, and the shorter lattice of a sheared cell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from granufab.packing import Array, IntArray

__all__ = ["matrix_exponential", "shorten_cell"]

TILT_LIMIT = 0.5001


def matrix_exponential(matrix: Array) -> Array:
    """exp of a small matrix of norm ≪ 1 by its series to fourth order (error ~ |A|⁵/120)."""
    square = matrix @ matrix
    return np.eye(len(matrix)) + matrix + square / 2 + square @ matrix / 6 + square @ square / 24


def shorten_cell(
    matrix: Array,
    periodic: np.ndarray,
    remap: IntArray,
    shear_images: Callable[[int, int, int], None],
) -> None:
    """Replace lattice vectors tilted beyond 1/2 by their shorter equivalents, in place.

    The same lattice is described before and after, so no contact changes (Lees–Edwards remap).

    Args:
        matrix: lattice vectors as columns [m], shape (D, D).
        periodic: per axis.
        remap: accumulated integer change of the lattice basis, shape (D, D).
        shear_images: called with (flow, axis, turns) for every change.
    """
    dimension = len(matrix)
    for axis in range(dimension):
        for flow in range(dimension):
            if axis == flow or not (periodic[axis] and periodic[flow]):
                continue
            tilt = matrix[flow, axis] / matrix[flow, flow]
            turns = round(tilt)
            if abs(tilt) > TILT_LIMIT and turns:
                matrix[:, axis] -= turns * matrix[:, flow]
                remap[:, axis] -= turns * remap[:, flow]
                shear_images(flow, axis, turns)
