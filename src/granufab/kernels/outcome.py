"""How a step ended: stress, numbers that cannot be, the row of the report."""

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

__all__ = ["finish_step", "inspect", "measure_stress", "report_step"]

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
def _unfit(sizes):
    """How many numbers, given as integers, are not finite and positive."""
    found = 0
    for i in range(len(sizes)):
        if sizes[i] <= 0 or sizes[i] >= EXPONENT:
            found += 1
    return found


@part
def measure_stress(problem: Problem, state: State, notes: Notes, like, piece):
    """A piece's share of the virial."""
    reach = piece_of(int(notes.control[COUNT]), piece)
    virial(problem, state.impulse_n, state.impulse_t, reach, notes.partial[piece, 4:], like)


@part
def inspect(bodies: Bodies, notes: Notes, like, piece):
    """Count a piece's numbers that cannot be: not finite, or R ≤ 0 or m ≤ 0."""
    first, end = piece_of(len(bodies.bits), piece)
    found = _broken(bodies.bits[first:end])
    first, end = piece_of(len(bodies.places), piece)
    heavy = len(like) + (1 if len(like) == 2 else 3)
    found += _broken(bodies.places[first:end]) + _unfit(bodies.sizes[first:end])
    notes.partial[piece, 3] = found + _unfit(bodies.bits[first:end, heavy])


@part
def _cell_is_broken(box: Box):
    """Whether a number of the cell or its stress is not finite, or its volume is not positive."""
    found = _broken(box.bits[MATRIX]) + _broken(box.bits[RATE])
    found += _broken(box.bits[STRAIN]) + _broken(box.bits[STRESS])
    return found > 0 or determinant(box.tensors[MATRIX]) <= 0.0


@part
def finish_step(box: Box, notes: Notes, law: StepLaw):
    """Stress of the step and capped rates."""
    tensors, partial, control = box.tensors, notes.partial, notes.control
    dimension = tensors.shape[1]
    scale = 1.0 / (law.step * determinant(tensors[MATRIX]))
    smallest = 0.0
    for piece in range(PIECES):
        smallest = smaller(smallest, partial[piece, 1])
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
    broken = 0.0
    for piece in range(PIECES):
        broken += notes.partial[piece, 3]
    if broken > 0.0 or _cell_is_broken(box):
        control[STATUS] = STOP
    missed = law.strict and control[RESIDUAL] > tolerance
    if missed or control[OVERLAP] > law.overlap_limit:
        control[STATUS] = STOP
