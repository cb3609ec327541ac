"""From the active candidates to the contact problem of a step, and back.

Contacts keep the order of the candidates; each piece of the candidates counts its own, then
fills them in. Velocities follow from impulses chunk by chunk, whoever computes them.
"""

from __future__ import annotations

from granufab.kernels.access import address
from granufab.kernels.impulses import apply_listed, local_velocity
from granufab.kernels.options import part
from granufab.kernels.pack import take_impulse
from granufab.kernels.problem import Problem, State
from granufab.kernels.schedule import Plan
from granufab.kernels.slots import Slots
from granufab.kernels.step_arrays import (
    FREE_RATE,
    IMPOSED,
    PIECES,
    START_RATE,
    Bodies,
    Box,
    Notes,
    Pairs,
    StepLaw,
    copy_numbers,
    piece_of,
)
from granufab.kernels.team import meet
from granufab.kernels.vectors import (
    dot,
    load,
    load_tangent,
    matvec,
    scale,
    store,
    sub,
    tangential,
)

__all__ = ["count_contacts", "fill_contacts", "set_velocities", "store_impulses"]


@part
def count_contacts(pairs: Pairs, plan: Plan, piece):
    """Count a piece's active candidates, by chunk; a piece of the grains has no batch yet."""
    homes = plan.tally.shape[1]
    for home in range(homes):
        plan.tally[piece, home] = 0
    first, end = piece_of(len(pairs.length), piece)
    for at in range(first, end):
        plan.tally[piece, pairs.home[at]] += 1 if pairs.active[at] else 0
    first, end = piece_of(len(plan.last), piece)
    for i in range(first, end):
        plan.last[i] = -1


@part
def fill_contacts(
    pairs: Pairs, bodies: Bodies, box: Box, problem: Problem, state: State, plan: Plan,
    law: StepLaw, like, piece,
):  # fmt: skip
    """Fill a piece's active candidates into the problem, with offsets and warm start."""
    first, end = piece_of(len(pairs.length), piece)
    imposed = box.tensors[IMPOSED]
    c = plan.numbers[piece]
    for at in range(first, end):
        if not pairs.active[at]:
            continue
        i, j = pairs.pairs[at, 0], pairs.pairs[at, 1]
        n, length = load(pairs.normal, at, like), pairs.length[at]
        problem.first[c], problem.second[c] = i, j
        store(problem.normal, c, n)
        problem.length[c] = length
        problem.mu[c] = pairs.friction[at]
        state.impulse_n[c] = pairs.impulse_n[at]
        store(state.impulse_t, c, load_tangent(pairs.impulse_t, at, like))
        bounce = 0.0
        if law.restitution > 0.0:
            start = box.tensors[START_RATE]
            bounce = law.restitution * local_velocity(problem, bodies.start, start, c, like)[0]
        u = scale(length, matvec(imposed, n))
        u_n = dot(n, u)
        problem.offset_n[c] = u_n + _opening(pairs.gap[at], bounce, problem.softness, law)
        memory = scale(problem.softness, load_tangent(pairs.memory_t, at, like))
        store(problem.offset_t, c, sub(tangential(u, n, u_n), memory))
        home = pairs.home[at]
        plan.listed[plan.tally[piece, home]] = c
        plan.tally[piece, home] += 1
        c += 1


@part
def _opening(gap, bounce, softness, law: StepLaw):
    """What a gap adds to b_n.

    Rigid: max(g, 0)/h + β min(g, 0)/h, or the bounce e·u_n⁻ with restitution; compliant: g/h of
    both signs (the tangential spring remembers −ε P_t,old).
    """
    if law.restitution > 0.0:
        return bounce
    if softness > 0.0 or gap > 0.0:
        return gap / law.step
    return law.overlap_correction * gap / law.step


@part
def set_velocities(
    bodies: Bodies, box: Box, problem: Problem, state: State, plan: Plan, notes: Notes,
    counters, like, member, members,
):  # fmt: skip
    """Velocities afresh from the impulses: v_free + M⁻¹ H P, no drift of round-off."""
    free = box.tensors[FREE_RATE]
    for piece in range(member, PIECES, members):
        first, end = piece_of(len(bodies.motion), piece)
        width = bodies.motion.shape[1]
        copy_numbers(address(bodies.free), address(bodies.motion), first * width, end * width)
    meet(counters, members)
    between = len(plan.heads) - 2
    for home in range(member, between, members):
        push = notes.pushes[home]
        for k in range(len(push)):
            for l in range(len(push)):
                push[k, l] = free[k, l] if home == 0 else 0.0
        reach = (plan.heads[home], plan.heads[home + 1])
        apply_listed(problem, state, plan.listed, reach, push, like)
    meet(counters, members)
    if member == 0:
        rate = state.rate
        for k in range(len(rate)):
            for l in range(len(rate)):
                rate[k, l] = 0.0
                for home in range(between):
                    rate[k, l] += notes.pushes[home, k, l]
        reach = (plan.heads[between], plan.heads[between + 1])
        apply_listed(problem, state, plan.listed, reach, rate, like)
    meet(counters, members)


@part
def store_impulses(pairs: Pairs, state: State, plan: Plan, slots: Slots, size, like, piece):
    """Impulses from the slots to the problem and the candidates; pairs outside carry none."""
    first, end = piece_of(len(pairs.length), piece)
    c = plan.numbers[piece]
    for at in range(first, end):
        if pairs.active[at]:
            take_impulse(slots, plan, size, c, state, like)
            pairs.impulse_n[at] = state.impulse_n[c]
            store(pairs.impulse_t, at, load_tangent(state.impulse_t, c, like))
            c += 1
        else:
            pairs.impulse_n[at] = 0.0
            for k in range(pairs.impulse_t.shape[1]):
                pairs.impulse_t[at, k] = 0.0
