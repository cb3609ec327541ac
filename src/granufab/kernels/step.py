"""Steps of Contact Dynamics in one call, by a team of threads.

Moreau–Jean midpoint: half drift, contacts and normals there, v_free, solve, half drift. Stages
share bodies and pairs in pieces, contacts in chunks, and meet between; numbers and parts do not
depend on how many members there are. The call returns where something is to be done outside, and
goes on there when called again.
"""

from __future__ import annotations

from typing import NamedTuple

from granufab.kernels.clock import nanoseconds
from granufab.kernels.contacts import (
    count_contacts,
    fill_contacts,
    set_velocities,
    store_impulses,
)
from granufab.kernels.drift import half_drift
from granufab.kernels.geometry import find_missed, survey
from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import part, steady
from granufab.kernels.outcome import finish_step, inspect, measure_stress, report_step
from granufab.kernels.pack import pack_chunk
from granufab.kernels.problem import Problem, State
from granufab.kernels.release import free_rates, release
from granufab.kernels.schedule import Plan, arrange_chunk, list_homes, place_chunks
from granufab.kernels.slots import Slots, fields
from granufab.kernels.solve import Work, patient_sweeps, solve
from granufab.kernels.step_arrays import (
    AGAIN,
    ASSEMBLY,
    BATCHES,
    BEGAN,
    COUNT,
    DRIFT,
    FARTHEST,
    GEOMETRY,
    GOING,
    IMPOSED,
    ITERATE,
    ITERATION,
    LATEST,
    MADE,
    MEND,
    MENDS,
    PATIENCE,
    PHASE,
    PIECES,
    RATE,
    RESIDUAL,
    RESOLVES,
    REST,
    ROOM,
    SEARCH,
    SHARE,
    SOLVE,
    SPENT,
    STATUS,
    STOP,
    STRAIN_WALKED,
    SURVEY,
    SWEEPS,
    UPDATES,
    VIOLATION,
    Bodies,
    Box,
    Notes,
    Pairs,
    StepLaw,
    copy_matrix,
)
from granufab.kernels.sweep import Law
from granufab.kernels.team import given_up, meet
from granufab.kernels.tracing import whole

__all__ = ["Step", "advance"]

MOST_RESOLVES = 3


class Step(NamedTuple):
    """All that steps read and write."""

    bodies: Bodies
    box: Box
    pairs: Pairs
    problem: Problem
    state: State
    plan: Plan
    slots: Slots
    work: Work
    notes: Notes


@steady
def advance(step: Step, law: StepLaw, settings, like, wide, steps, member, members):
    """Make up to ``steps`` steps; ends early with a status, see ``step_arrays``.

    Args:
        step: memory.
        law: numbers of the step.
        settings: of the solve, see :func:`granufab.kernels.solve.solve`.
        like: tuple of D zeros.
        wide: width and dimension of the sweep (``access``).
        steps: at most this many, and ROWS; 0 only measures the candidate pairs.
        member, members: number of this thread, and how many work together.
    """
    control, counters = step.notes.control, step.work.counters
    if member == 0:
        control[STATUS], control[MADE] = GOING, 0.0
        step.notes.clock[BEGAN] = nanoseconds(step.notes.stamp)
        step.notes.clock[LATEST] = step.notes.clock[BEGAN]
    meet(counters, members)
    if steps == 0:
        for piece in range(member, PIECES, members):
            survey(step.bodies, step.box, step.pairs, step.notes, law, like, piece)
    while control[STATUS] == GOING and control[MADE] < steps:
        if control[PHASE] == DRIFT:
            _drift(step, law, like, member, members)
        if control[STATUS] == GOING and control[PHASE] == SURVEY:
            _survey(step, law, like, member, members)
        if control[STATUS] == GOING:
            _solve(step, law, settings, like, wide, member, members)
        if control[STATUS] == GOING:
            _finish(step, law, settings, like, member, members)
        if members > 1 and given_up(counters):
            break


@part
def _tick(notes: Notes, stage):
    """Count the time since the last call for a stage."""
    now = nanoseconds(notes.stamp)
    notes.clock[stage] += now - notes.clock[LATEST]
    notes.clock[LATEST] = now


@part
def _drift(step: Step, law: StepLaw, like, member, members):
    """First half drift; asks for a search where grains may have come near unnoticed."""
    notes, counters = step.notes, step.work.counters
    half_drift(step.bodies, step.box, notes, counters, 0.5 * law.step, like, member, members)
    if member == 0:
        control = notes.control
        control[PHASE] = SURVEY
        walked = 2.0 * control[FARTHEST] + control[STRAIN_WALKED] * law.reach
        if walked > law.skin - law.margin:
            control[STATUS] = SEARCH
    meet(counters, members)


@part
def _survey(step: Step, law: StepLaw, like, member, members):
    """Gaps, who takes part, free velocities."""
    notes = step.notes
    for piece in range(member, PIECES, members):
        survey(step.bodies, step.box, step.pairs, notes, law, like, piece)
        release(step.bodies, step.box, law, like, piece)
    meet(step.work.counters, members)
    if member == 0:
        free_rates(step.box, law)
        control = notes.control
        control[SWEEPS], control[RESOLVES], control[UPDATES] = 0.0, 0.0, 0.0
        control[PHASE] = SOLVE
        _tick(notes, GEOMETRY)
    meet(step.work.counters, members)


@part
def _solve(step: Step, law: StepLaw, settings, like, wide, member, members):
    """Solve, and again while a pair left out of the solve would overlap by its end."""
    notes, counters = step.notes, step.work.counters
    control = notes.control
    again = True
    while again:
        if control[PHASE] == SOLVE:
            _assemble(step, law, like, member, members)
        if control[STATUS] == GOING:
            _iterate(step, settings, like, wide, member, members)
        if control[STATUS] != GOING:
            return
        _store(step, law, like, member, members)
        again = control[AGAIN] == 1.0
        if members > 1 and given_up(counters):
            return


@part
def _assemble(step: Step, law: StepLaw, like, member, members):
    """The contact problem in the slots of the sweep, velocities from the warm start."""
    pairs, problem, state, plan = step.pairs, step.problem, step.state, step.plan
    notes, counters = step.notes, step.work.counters
    for piece in range(member, PIECES, members):
        count_contacts(pairs, plan, piece)
    meet(counters, members)
    if member == 0:
        notes.control[COUNT] = list_homes(plan)
    meet(counters, members)
    for piece in range(member, PIECES, members):
        fill_contacts(pairs, step.bodies, step.box, problem, state, plan, law, like, piece)
    meet(counters, members)
    between = len(plan.heads) - 2
    for home in range(member, between, members):
        arrange_chunk(plan, problem.first, problem.second, home)
    meet(counters, members)
    if member == 0:
        arrange_chunk(plan, problem.first, problem.second, between)
        batches = place_chunks(plan)
        notes.control[BATCHES] = batches
        size = fields(like, problem.coupled) * WIDTH
        if batches * WIDTH > len(step.slots.first) or batches * size > len(step.slots.values):
            notes.control[STATUS] = ROOM
    meet(counters, members)
    if notes.control[STATUS] != GOING:
        return
    for home in range(member, between, members):
        pack_chunk(problem, state, plan, step.slots, home, (0, 1), like)
    pack_chunk(problem, state, plan, step.slots, between, (member, members), like)
    set_velocities(
        step.bodies, step.box, problem, state, plan, notes, counters, like, member, members
    )
    if member == 0:
        notes.control[PHASE] = ITERATE
        notes.control[SPENT], notes.control[MENDS] = 0.0, 0.0


@part
def _iterate(step: Step, settings, like, wide, member, members):
    """Sweep; the free rates go to and fro through the memory of the solve."""
    problem, state, work, notes = step.problem, step.state, step.work, step.notes
    control, shared = notes.control, work.cells[-1, 0]
    if member == 0:
        copy_matrix(state.rate, shared)
        _tick(notes, ASSEMBLY)
    meet(work.counters, members)
    shared_law = Law(
        problem.softness, problem.spin_factor, problem.coupled,
        problem.dilation_weight, problem.weight,
    )  # fmt: skip
    size = fields(like, problem.coupled) * WIDTH
    tolerance, most, cap, floor, patience = settings
    calm = patient_sweeps(patience, control[COUNT])
    left = (tolerance, most - whole(control[SPENT]), cap, floor, calm)
    sweeps, residual, share, violation = solve(
        step.slots, state.motion, shared_law, work, wide, size, left, member, members
    )
    meet(work.counters, members)
    if member == 0:
        control[SPENT] += sweeps
        control[SWEEPS] += sweeps
        control[UPDATES] += sweeps * control[COUNT]
        control[RESIDUAL], control[SHARE], control[VIOLATION] = residual, share, violation
        if residual > tolerance and control[SPENT] < most:
            copy_matrix(shared, state.rate)
            control[STATUS] = MEND
        _tick(notes, ITERATION)
    meet(work.counters, members)


@part
def _store(step: Step, law: StepLaw, like, member, members):
    """Impulses to the candidates, velocities afresh; looks for pairs that were missed."""
    pairs, problem, state, plan = step.pairs, step.problem, step.state, step.plan
    notes, counters, tensors = step.notes, step.work.counters, step.box.tensors
    size = fields(like, problem.coupled) * WIDTH
    for piece in range(member, PIECES, members):
        store_impulses(pairs, state, plan, step.slots, size, like, piece)
    set_velocities(
        step.bodies, step.box, problem, state, plan, notes, counters, like, member, members
    )
    if member == 0:
        for k in range(len(like)):
            for l in range(len(like)):
                tensors[RATE, k, l] = tensors[IMPOSED, k, l] + state.rate[k, l]
    meet(counters, members)
    if law.restitution == 0.0:
        for piece in range(member, PIECES, members):
            notes.partial[piece, 2] = find_missed(
                pairs, state.motion, tensors[RATE], law, like, piece
            )
    meet(counters, members)
    if member == 0:
        control = notes.control
        missed = 0.0
        for piece in range(PIECES):
            missed += notes.partial[piece, 2]
        again = law.restitution == 0.0 and missed > 0.0 and control[RESOLVES] < MOST_RESOLVES
        control[AGAIN] = 1.0 if again else 0.0
        control[RESOLVES] += control[AGAIN]
        control[PHASE] = SOLVE
        _tick(notes, ASSEMBLY)
    meet(counters, members)


@part
def _finish(step: Step, law: StepLaw, settings, like, member, members):
    """Stress, second half drift, what cannot be, report."""
    notes, counters, box = step.notes, step.work.counters, step.box
    for piece in range(member, PIECES, members):
        measure_stress(step.problem, step.state, notes, like, piece)
    meet(counters, members)
    if member == 0:
        finish_step(box, notes, law)
    meet(counters, members)
    half_drift(step.bodies, box, notes, counters, 0.5 * law.step, like, member, members)
    for piece in range(member, PIECES, members):
        inspect(step.bodies, notes, like, piece)
    meet(counters, members)
    if member == 0:
        control = notes.control
        control[PHASE] = DRIFT
        report_step(box, notes, law, settings[0])
        _tick(notes, REST)
        if notes.clock[LATEST] - notes.clock[BEGAN] > notes.clock[PATIENCE]:
            control[STATUS] = STOP
    meet(counters, members)
