"""What a step reads and writes, as flat arrays: grains, cell, candidate pairs, notes of the team.

Everything is allocated outside of the steps (``simulate.step_memory``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.access import item, set_item
from granufab.kernels.options import part

__all__ = [
    "PIECES",
    "ROWS",
    "Bodies",
    "Box",
    "Notes",
    "Pairs",
    "StepLaw",
    "copy_matrix",
    "copy_numbers",
    "piece_of",
]

PIECES = 16
"""Parts into which bodies and pairs are split: sums do not depend on the number of threads."""
ROWS = 64
"""Steps that a call can report."""

MATRIX, RATE, STRAIN, STRESS, IMPOSED, EXTERNAL, FREE, FREE_RATE, START_RATE, WATCH = range(10)
TENSORS = 10
"""Places in ``Box.tensors``: lattice, L, strain, σ, imposed L, wanted σ, free components (0 or 1),
free rates before the solve and total ones before the step, and what is watched of the strain."""

PHASE, STATUS, MADE, COUNT, FARTHEST, STRAIN_WALKED, TIME = range(7)
SWEEPS, RESOLVES, UPDATES, RESIDUAL, SHARE, VIOLATION, OVERLAP = range(7, 14)
WALKED, WALK_GOAL, TOTAL, TOTAL_GOAL, AGAIN, BATCHES, SPENT, MENDS = range(14, 22)
CONTROL = 22
"""Places in ``Notes.control``."""

DRIFT, SURVEY, SOLVE, ITERATE = range(4)
"""Values of the phase: where a call goes on."""
GOING, SEARCH, ROOM, MEND, STOP = range(5)
"""Values of the status: go on; search the pairs; more room for batches; contacts that circle are to
be solved together; something to report."""

STRAIN_COLUMN = 8
"""Columns of ``Notes.rows``: sweeps, residual, share, violation, overlap, contacts, resolves,
sweeps × contacts; then strain and stress row by row."""

GEOMETRY, ASSEMBLY, ITERATION, REST, LATEST, BEGAN, PATIENCE = range(7)
CLOCKS = 7
"""Places in ``Notes.clock`` [ns]: time spent by stage, the last reading, when the call began, and
after how long it is to return."""


class Bodies(NamedTuple):
    """Grains, and body records with walls and a spare one.

    Attributes:
        position: [m], shape (N, D).
        radius: [m], shape (N,).
        motion: body records, shape (body_count, 4 or 8).
        bits, places, sizes: the memory of motion, position and radius as integers.
        free: records before the contacts act; start: before gravity acts (with restitution).
        walked: non-affine displacement since the last search [m], shape (N, D).
    """

    position: np.ndarray
    radius: np.ndarray
    motion: np.ndarray
    bits: np.ndarray
    places: np.ndarray
    sizes: np.ndarray
    free: np.ndarray
    start: np.ndarray
    walked: np.ndarray


class Box(NamedTuple):
    """The cell.

    Attributes:
        tensors: shape (TENSORS, D, D); bits: the same memory as integers.
        origin: [m], gravity: [m/s²], shape (D,).
    """

    tensors: np.ndarray
    bits: np.ndarray
    origin: np.ndarray
    gravity: np.ndarray


class Pairs(NamedTuple):
    """Candidate pairs; pairs with a wall w have the second body N + w.

    Attributes:
        pairs, images: bodies and lattice shift, shapes (count, 2), (count, D).
        normal, length, gap: at the midpoint, shapes (count, D), (count,), (count,).
        active: whether they take part in the solve.
        impulse_n, impulse_t: [N s]; memory_t: impulse_t at the start of the step.
        friction: µ [-].
        home: chunk of both bodies, the last one for pairs between chunks.
    """

    pairs: np.ndarray
    images: np.ndarray
    normal: np.ndarray
    length: np.ndarray
    gap: np.ndarray
    active: np.ndarray
    impulse_n: np.ndarray
    impulse_t: np.ndarray
    memory_t: np.ndarray
    friction: np.ndarray
    home: np.ndarray


class Notes(NamedTuple):
    """What the members of a team leave for each other and for the caller.

    Attributes:
        control: numbers, shape (CONTROL,).
        partial: by piece: farthest, smallest gap, missed pairs, broken numbers; then D×D of the
            virial, shape (PIECES, 16).
        own: two matrices for every member, shape (members, 2, D, D).
        pushes: on the cell, by chunk, shape (chunk_count + 1, D, D).
        rows: reports of steps, shape (ROWS, STRAIN_COLUMN + 2·D·D).
        clock, stamp: nanoseconds, shapes (CLOCKS,), (2,).
    """

    control: np.ndarray
    partial: np.ndarray
    own: np.ndarray
    pushes: np.ndarray
    rows: np.ndarray
    clock: np.ndarray
    stamp: np.ndarray


class StepLaw(NamedTuple):
    """Numbers of a step.

    Attributes:
        step: h [s].
        overlap_correction: β [-].
        restitution: e [-].
        damping: share of velocities removed [-].
        dilation: whether the cell's only free component is its dilation.
        cell_inertia: M [kg m²].
        skin, margin, touching, missed: lengths [m]: of the neighbour list, of selection, of a
            closed contact, of an overlap to come that a solve must not leave.
        reach: of the neighbour list, between centres [m].
        rate_cap: largest free rate [1/s].
        overlap_limit: [m].
        strict: whether a step that missed the tolerance ends the call.
    """

    step: float
    overlap_correction: float
    restitution: float
    damping: float
    dilation: bool
    cell_inertia: float
    skin: float
    margin: float
    touching: float
    missed: float
    reach: float
    rate_cap: float
    overlap_limit: float
    strict: bool


@part
def piece_of(count, piece):
    """First item of a piece, and the end."""
    return count * piece // PIECES, count * (piece + 1) // PIECES


@part
def copy_numbers(source, target, first, end):
    """Copy numbers ``first`` … ``end`` − 1 from one address to another."""
    for k in range(first, end):
        set_item(target, k, item(source, k))


@part
def copy_matrix(source, target):
    """target ← source, for matrices (D, D)."""
    for k in range(len(source)):
        for l in range(len(source)):
            target[k, l] = source[k, l]
