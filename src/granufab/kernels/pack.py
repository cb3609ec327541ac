"""Contacts into the slots of the sweep, and their impulses back."""

from __future__ import annotations

from granufab.kernels.access import address
from granufab.kernels.cell import cell_weight
from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import kernel, part
from granufab.kernels.problem import Problem, State
from granufab.kernels.schedule import Plan
from granufab.kernels.slots import Slots, fields, places
from granufab.kernels.solve import solve
from granufab.kernels.vectors import inverse_mass, load, load_tangent

__all__ = ["pack", "pack_chunk", "solve_packed", "take_impulse", "unpack"]


@part
def pack_chunk(problem: Problem, state: State, plan: Plan, slots: Slots, home, part, like):
    """Fill the slots of a chunk, or a part of them, with contacts and warm start.

    Args:
        problem, state: contacts, impulses, inverse masses.
        plan: of these contacts, arranged.
        slots: filled; ``slots.starts`` is that of the plan.
        home: the chunk.
        part: (which, of how many): members may share the contacts.
        like: tuple of D zeros.
    """
    values = slots.values
    size = fields(like, problem.coupled) * WIDTH
    at = places(like)
    offset = plan.starts[home] * WIDTH
    eps, kappa, weight = problem.softness, problem.spin_factor, address(problem.weight)
    head, count = plan.heads[home], plan.heads[home + 1] - plan.heads[home]
    for k in range(head + count * part[0] // part[1], head + count * (part[0] + 1) // part[1]):
        c = plan.listed[k]
        slot = plan.order[c] + offset
        plan.order[c] = slot
        base = slot // WIDTH * size + slot % WIDTH
        i, j = problem.first[c], problem.second[c]
        slots.first[slot], slots.second[slot] = i, j
        n, length = load(problem.normal, c, like), problem.length[c]
        for k in range(len(like)):
            values[base + WIDTH * (at.normal + k)] = n[k]
        values[base + WIDTH * at.length] = length
        values[base + WIDTH * at.offset_n] = problem.offset_n[c]
        values[base + WIDTH * at.mu] = problem.mu[c]
        values[base + WIDTH * at.impulse_n] = state.impulse_n[c]
        values[base + WIDTH * at.before_n] = state.impulse_n[c]
        offset_t, impulse_t = load_tangent(problem.offset_t, c, like), state.impulse_t
        for k in range(len(offset_t)):
            values[base + WIDTH * (at.offset_t + k)] = offset_t[k]
            values[base + WIDTH * (at.impulse_t + k)] = impulse_t[c, k]
            values[base + WIDTH * (at.before_t + k)] = impulse_t[c, k]
        mass = inverse_mass(state.motion, i, like) + inverse_mass(state.motion, j, like)
        w_n, w_t = mass + eps, mass + kappa * mass + eps
        if problem.coupled:
            extra_n, extra_nt, extra_t = cell_weight(weight, n, length)
            w_n, w_t = w_n + extra_n, w_t + extra_t
            if len(like) == 2:
                values[base + WIDTH * at.cross] = extra_nt
        else:
            w_n += length * length * problem.dilation_weight
        crossed = problem.coupled and len(like) == 2
        values[base + WIDTH * at.inverse_n] = w_n if crossed else 1.0 / w_n
        values[base + WIDTH * at.inverse_t] = w_t if crossed else 1.0 / w_t
    if part[0] == 0:
        _fill_empty(plan, slots, home, size, at, len(state.motion) - 1)


@part
def _fill_empty(plan: Plan, slots: Slots, home, size, at, spare):
    """Places that no contact took: an open contact of the spare body."""
    values = slots.values
    for batch in range(plan.starts[home], plan.starts[home + 1]):
        for lane in range(
            plan.taken[plan.heads[home] + home + batch - plan.starts[home]], WIDTH
        ):  # fmt: skip
            slots.first[batch * WIDTH + lane] = spare
            slots.second[batch * WIDTH + lane] = spare
            base = batch * size + lane
            for k in range(0, size, WIDTH):
                values[base + k] = 0.0
            values[base + WIDTH * at.offset_n] = 1.0
            values[base + WIDTH * at.inverse_n] = 1.0
            values[base + WIDTH * at.inverse_t] = 1.0


@part
def take_impulse(slots: Slots, plan: Plan, size, c, state: State, like):
    """Write the impulse of contact ``c`` from its slot into the state."""
    at = places(like)
    slot = plan.order[c]
    base = slot // WIDTH * size + slot % WIDTH
    state.impulse_n[c] = slots.values[base + WIDTH * at.impulse_n]
    for k in range(state.impulse_t.shape[1]):
        state.impulse_t[c, k] = slots.values[base + WIDTH * (at.impulse_t + k)]


@kernel
def pack(problem: Problem, state: State, plan: Plan, slots: Slots, like):
    """Fill the slots with a problem that :func:`schedule` arranged, by one thread."""
    for home in range(len(plan.heads) - 1):
        pack_chunk(problem, state, plan, slots, home, (0, 1), like)


@kernel
def unpack(slots: Slots, plan: Plan, size, state: State, like):
    """Write all impulses of the slots back, in the order of the problem."""
    for c in range(len(state.impulse_n)):
        take_impulse(slots, plan, size, c, state, like)


@kernel
def solve_packed(slots: Slots, bodies, law, work, like, size, settings, member, members):
    """:func:`granufab.kernels.solve.solve`, for callers outside of kernels."""
    return solve(slots, bodies, law, work, like, size, settings, member, members)
