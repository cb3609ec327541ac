"""How a step ended: stress, numbers that are not finite, the row of the report."""

from __future__ import annotations

from granufab.kernels.motion import virial
from granufab.kernels.options import part
from granufab.kernels.problem import Problem, State
from granufab.kernels.release import determinant
from granufab.kernels.step_arrays import (
    COUNT,
    IMPOSED,
    MADE,
    MATRIX,
    OVERLAP,
    PIECES,
    RATE,
    RESIDUAL,
    RESOLVES,
    SHARE,
    START_RATE,
    STATUS,
    STOP,
    STRAIN,
    STRAIN_COLUMN,
    STRESS,
    SWEEPS,
    TIME,
    TOTAL,
    TOTAL_GOAL,
    UPDATES,
    VIOLATION,
    WALK_GOAL,
    WALKED,
    WATCH,
    Bodies,
    Box,
    Notes,
    StepLaw,
    piece_of,
)
from granufab.kernels.tracing import larger, smaller

__all__ = ["finish_step", "inspect", "report_step"]

EXPONENT = 0x7FF0000000000000


@part
def _broken(bits):
    """How many numbers of a table, given as integers, are infinite or no numbers."""
    found = 0
    for i in range(len(bits)):
        for k in range(bits.shape[1]):
            if bits[i, k] & EXPONENT == EXPONENT:
                found += 1
    return found


@part
def inspect(bodies: Bodies, problem: Problem, state: State, notes: Notes, like, piece):
    """A piece's share of the virial, and its numbers that are not finite."""
    part = notes.partial[piece]
    reach = piece_of(int(notes.control[COUNT]), piece)
    virial(problem, state.impulse_n, state.impulse_t, reach, part[4:], like)
    first, end = piece_of(len(bodies.bits), piece)
    part[3] = _broken(bodies.bits[first:end])


@part
def finish_step(box: Box, notes: Notes, law: StepLaw):
    """Stress of the step and capped rates; whether a number is not finite."""
    tensors, partial, control = box.tensors, notes.partial, notes.control
    dimension = tensors.shape[1]
    scale = 1.0 / (law.step * determinant(tensors[MATRIX]))
    broken, smallest = float(_broken(box.bits[RATE])), 0.0
    for piece in range(PIECES):
        smallest = smaller(smallest, partial[piece, 1])
        broken += partial[piece, 3]
    control[OVERLAP] = -smallest
    largest = 0.0
    for k in range(dimension):
        for l in range(dimension):
            total = 0.0
            for piece in range(PIECES):
                total += partial[piece, 4 + k * dimension + l]
            tensors[STRESS, k, l] = scale * total
            largest = larger(largest, abs(tensors[RATE, k, l] - tensors[IMPOSED, k, l]))
    if largest > law.rate_cap:
        for k in range(dimension):
            for l in range(dimension):
                imposed = tensors[IMPOSED, k, l]
                free = tensors[RATE, k, l] - imposed
                tensors[RATE, k, l] = imposed + free * (law.rate_cap / largest)
    return broken > 0.0


@part
def report_step(box: Box, notes: Notes, law: StepLaw, tolerance):
    """Write the row of a step; ends the call where an error or the goal is reached."""
    tensors, control = box.tensors, notes.control
    dimension = tensors.shape[1]
    row = notes.rows[int(control[MADE])]
    row[0], row[1], row[2] = control[SWEEPS], control[RESIDUAL], control[SHARE]
    row[3], row[4], row[5] = control[VIOLATION], control[OVERLAP], control[COUNT]
    row[6], row[7] = control[RESOLVES], control[UPDATES]
    change = 0.0
    at = STRAIN_COLUMN
    for k in range(dimension):
        for l in range(dimension):
            row[at] = tensors[STRAIN, k, l]
            row[at + dimension * dimension] = tensors[STRESS, k, l]
            at += 1
            flow = tensors[START_RATE, k, l] + tensors[RATE, k, l]
            change -= 0.5 * law.step * flow * tensors[WATCH, k, l]
    control[MADE] += 1.0
    control[TIME] += law.step
    control[WALKED] += change
    control[TOTAL] += abs(change)
    if control[WALKED] >= control[WALK_GOAL] or control[TOTAL] >= control[TOTAL_GOAL]:
        control[STATUS] = STOP
    missed = law.strict and control[RESIDUAL] > tolerance
    if missed or control[OVERLAP] > law.overlap_limit:
        control[STATUS] = STOP
