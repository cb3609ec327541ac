"""Velocities that bodies and cell would have without contacts."""

from __future__ import annotations

from granufab.kernels.access import address
from granufab.kernels.options import part
from granufab.kernels.step_arrays import (
    EXTERNAL,
    FREE,
    FREE_RATE,
    IMPOSED,
    MATRIX,
    RATE,
    START_RATE,
    Bodies,
    Box,
    StepLaw,
    copy_numbers,
    piece_of,
)
from granufab.kernels.tracing import smaller

__all__ = ["determinant", "free_rates", "release"]


@part
def release(bodies: Bodies, box: Box, law: StepLaw, like, piece):
    """Free velocities of a piece of the bodies: gravity, then damping.

    With restitution also the velocities before gravity acted: those that bounce.
    """
    motion, free, start = bodies.motion, bodies.free, bodies.start
    first, end = piece_of(len(motion), piece)
    grain_count = len(bodies.position)
    dimension = len(like)
    moving = dimension + (1 if dimension == 2 else 3)
    kept = 1.0 - law.damping
    width = motion.shape[1]
    copy_numbers(address(motion), address(free), first * width, end * width)
    for i in range(first, smaller(end, grain_count)):
        for k in range(dimension):
            free[i, k] += law.step * box.gravity[k]
        for k in range(moving):
            free[i, k] *= kept
    if law.restitution > 0.0:
        for i in range(first, end):
            for k in range(motion.shape[1]):
                fallen = law.step * box.gravity[k] if i < grain_count and k < dimension else 0.0
                start[i, k] = free[i, k] - fallen


@part
def determinant(matrix):
    """Of a 2×2 or 3×3 matrix."""
    if len(matrix) == 2:
        return matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    total = 0.0
    for k in range(3):
        l, m = (k + 1) % 3, (k + 2) % 3
        total += matrix[0, k] * (matrix[1, l] * matrix[2, m] - matrix[1, m] * matrix[2, l])
    return total


@part
def free_rates(box: Box, law: StepLaw):
    """Free rates of the cell before the contacts act: damped, and pushed by the wanted stress."""
    tensors = box.tensors
    rate, free, external = tensors[RATE], tensors[FREE_RATE], tensors[EXTERNAL]
    dimension = len(rate)
    push = law.step * determinant(tensors[MATRIX]) / law.cell_inertia
    kept = 1.0 - law.damping
    spread, pressure = 0.0, 0.0
    for k in range(dimension):
        spread += (rate[k, k] - tensors[IMPOSED, k, k]) / dimension
        pressure += external[k, k] / dimension
    for k in range(dimension):
        for l in range(dimension):
            tensors[START_RATE, k, l] = rate[k, l]
            if law.dilation:
                free[k, l] = spread * kept - push * pressure if k == l else 0.0
            elif tensors[FREE, k, l] == 1.0:
                free[k, l] = (rate[k, l] - tensors[IMPOSED, k, l]) * kept - push * external[k, l]
            else:
                free[k, l] = 0.0
