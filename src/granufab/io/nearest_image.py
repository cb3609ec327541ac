"""Nearest images across a periodic cell, however tilted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from granufab.packing import Array, IntArray

__all__ = ["nearest_images"]


def nearest_images(
    branch: Array, matrix: Array, periodic: Sequence[bool]
) -> tuple[Array, IntArray]:
    """The shortest of each vector and its images.

    Args:
        branch: vectors [m], shape (count, D).
        matrix: lattice vectors as columns [m], shape (D, D).
        periodic: per lattice vector.
    Returns:
        Vectors [m], and the integer lattice vectors added to reach them, both shape (count, D).
    """
    branch = np.array(branch, float)
    image = np.zeros(branch.shape, np.int64)
    change = _reduction(matrix, periodic)
    matrix = matrix @ change
    upright, across = np.linalg.qr(matrix)  # the last lattice plane first
    for k in np.flatnonzero(periodic)[::-1]:
        turns = np.rint(branch @ upright[:, k] / across[k, k])
        branch -= turns[:, None] * matrix[:, k]
        image[:, k] -= turns.astype(np.int64)
    branch, image = _shortened(branch, image, matrix, periodic)
    return branch, image @ change.T


def _reduction(matrix: Array, periodic: Sequence[bool]) -> IntArray:
    """Whole numbers N with which matrix·N is the same lattice, of vectors as upright as can be."""
    change, reduced = np.eye(len(matrix), dtype=np.int64), np.array(matrix, float)
    axes = [int(k) for k in np.flatnonzero(periodic)]
    for _ in range(100):
        before = change.copy()
        for i, j in ((i, j) for i in axes for j in axes if i != j):
            ratio = reduced[:, i] @ reduced[:, j] / (reduced[:, j] @ reduced[:, j])
            if abs(ratio) > 0.5 + 1e-9 and abs(ratio) < 1e9:
                change[:, i] -= int(np.rint(ratio)) * change[:, j]
                reduced[:, i] = matrix @ change[:, i]
        if (change == before).all():
            break
    return change


def _shortened(
    branch: Array, image: IntArray, matrix: Array, periodic: Sequence[bool]
) -> tuple[Array, IntArray]:
    """The shortest of the neighbouring images (cells tilted by more than half an edge)."""
    # No lattice vector is shorter than the narrowest spacing of lattice planes, so branches
    # below half of it have no shorter image.
    spacing = 1.0 / np.linalg.norm(np.linalg.inv(matrix), axis=1)[np.array(periodic)]
    long = np.flatnonzero(np.linalg.norm(branch, axis=1) > spacing.min(initial=np.inf) / 2)
    if len(long) == 0:
        return branch, image
    best, kept, start = branch[long], image[long], branch[long]
    length = np.linalg.norm(best, axis=1)
    steps = [(-1, 0, 1) if wraps else (0,) for wraps in periodic]
    for move in np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, len(steps)):
        trial = start + matrix @ move
        shorter = np.linalg.norm(trial, axis=1) < length * (1 - 1e-12)
        best = np.where(shorter[:, None], trial, best)
        kept = np.where(shorter[:, None], image[long] + move, kept)
        length = np.linalg.norm(best, axis=1)
    branch[long], image[long] = best, kept
    return branch, image
