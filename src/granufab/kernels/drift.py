"""Half a step of motion: grains and cell move, the wandering since the last search is noted.

Velocities in ``motion`` are fluctuations c = v − L·r; a grain moves by ṙ = L r + c. The affine
part is applied as exp(h L/2) on each half step, so imposed strains are exact.
"""

from __future__ import annotations

from granufab.kernels.options import part
from granufab.kernels.step_arrays import (
    FARTHEST,
    MATRIX,
    PIECES,
    RATE,
    STRAIN,
    STRAIN_WALKED,
    Bodies,
    Box,
    Notes,
    piece_of,
)
from granufab.kernels.team import meet
from granufab.kernels.tracing import larger, root
from granufab.kernels.vectors import axpy, load, matvec, norm2, store

__all__ = ["exponential", "half_drift"]

ORDER = 8


@part
def half_drift(bodies: Bodies, box: Box, notes: Notes, counters, half, like, member, members):
    """Move grains and cell over ``half`` a step [s]; ends before the others may read the cell."""
    affine = notes.own[member, 0]
    exponential(box.tensors[RATE], half, affine, notes.own[member, 1])
    for piece in range(member, PIECES, members):
        notes.partial[piece, 0] = _move_grains(bodies, affine, half, piece, like)
    meet(counters, members)
    if member == 0:
        _move_cell(box, notes, affine, half)


@part
def exponential(matrix, factor, result, spare):
    """result ← exp(factor · matrix) for a small matrix, by the first nine terms of its series.

    ``spare`` is memory of the same shape.
    """
    dimension = len(matrix)
    for k in range(dimension):
        for l in range(dimension):
            result[k, l] = 1.0 if k == l else 0.0
    for order in range(ORDER, 0, -1):
        for k in range(dimension):
            for l in range(dimension):
                total = 0.0
                for m in range(dimension):
                    total += matrix[k, m] * result[m, l]
                spare[k, l] = (1.0 if k == l else 0.0) + factor / order * total
        for k in range(dimension):
            for l in range(dimension):
                result[k, l] = spare[k, l]


@part
def _move_grains(bodies: Bodies, affine, half, piece, like):
    """r ← exp(h L/2) r + (h/2) c; returns the farthest squared wandering of the piece."""
    first, end = piece_of(len(bodies.position), piece)
    farthest = 0.0
    for i in range(first, end):
        c = load(bodies.motion, i, like)
        store(bodies.position, i, axpy(half, c, matvec(affine, load(bodies.position, i, like))))
        walked = axpy(half, c, load(bodies.walked, i, like))
        store(bodies.walked, i, walked)
        farthest = larger(farthest, norm2(walked))
    return farthest


@part
def _move_cell(box: Box, notes: Notes, affine, half):
    matrix, rate, strain = box.tensors[MATRIX], box.tensors[RATE], box.tensors[STRAIN]
    moved = notes.own[0, 1]
    dimension = len(matrix)
    square = 0.0
    for k in range(dimension):
        moved[k, 0] = 0.0
        for l in range(dimension):
            moved[k, 0] += affine[k, l] * box.origin[l]
    for k in range(dimension):
        box.origin[k] = moved[k, 0]
    for k in range(dimension):
        for l in range(dimension):
            moved[k, l] = 0.0
            for m in range(dimension):
                moved[k, l] += affine[k, m] * matrix[m, l]
            strain[k, l] -= half * 0.5 * (rate[k, l] + rate[l, k])
            square += rate[k, l] ** 2
    for k in range(dimension):
        for l in range(dimension):
            matrix[k, l] = moved[k, l]
    notes.control[STRAIN_WALKED] += half * root(square)
    farthest = 0.0
    for piece in range(PIECES):
        farthest = larger(farthest, notes.partial[piece, 0])
    notes.control[FARTHEST] = root(farthest)
