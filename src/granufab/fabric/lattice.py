"""Lattice vectors of a periodic cell, followed through its remaps.

A sheared cell may be remapped: the same lattice is then described by other vectors, C_now = C T
with T integer and of determinant 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granufab.history import Frame, packing_of
from granufab.packing import Array, IntArray, Packing

__all__ = ["lattice_change", "lattice_changes", "lattice_remap"]


def lattice_change(frame: Frame) -> IntArray:
    """Integer change T of the lattice vectors since the run began, C_now = C T, shape (D, D)."""
    if frame.remap is None:
        return np.eye(frame.packing.dimension, dtype=np.int64)
    return np.rint(frame.remap).astype(np.int64)


def lattice_changes(states: Sequence[Frame | Packing]) -> list[IntArray]:
    """Integer change T of the lattice vectors of each state against a common first basis.

    Frames hold it. Of two plain packings the second may have been remapped: of T = 1 and the
    rounded C_1⁻¹C_2 the one with the smaller strain between the two is taken, which is right for
    strains below about a half and for any rigid rotation.
    """
    dimension = packing_of(states[0]).dimension
    frames = [state for state in states if isinstance(state, Frame)]
    if len(frames) == len(states):
        return [lattice_change(frame) for frame in frames]
    same = np.eye(dimension, dtype=np.int64)
    changes = [same]
    first = packing_of(states[0]).cell
    for state in states[1:]:
        cell = packing_of(state).cell
        if first is None or cell is None:
            changes.append(same)
        else:
            changes.append(lattice_remap(first.matrix, cell.matrix))
    return changes


def lattice_remap(first: Array, second: Array) -> IntArray:
    """Integer change T of the lattice vectors between two cells, second ≈ first·T, or 1.

    The rounded C_1⁻¹C_2, if it leaves a smaller strain between the two than T = 1 does.

    Args:
        first: lattice vectors as columns [m], shape (D, D).
        second: those of a later state.
    """
    same = np.eye(len(first), dtype=np.int64)
    nearest = np.rint(np.linalg.solve(first, second)).astype(np.int64)
    if round(np.linalg.det(nearest)) != 1:
        return same

    def strain(change: IntArray) -> float:
        gradient = second @ np.linalg.inv(change) @ np.linalg.inv(first)
        stretch = np.linalg.svd(gradient, compute_uv=False)
        return float(np.abs(np.log(stretch)).max())

    return nearest if strain(nearest) < strain(same) - 1e-9 else same
