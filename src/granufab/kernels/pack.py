"""Contacts into the slots of the sweep, and their impulses back."""

from __future__ import annotations

from granufab.kernels.access import address, put, put_tangent, set_item, take, take_tangent
from granufab.kernels.cell import cell_weight
from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import kernel, part
from granufab.kernels.problem import Problem, State
from granufab.kernels.schedule import Plan
from granufab.kernels.slots import Slots, fields, places
from granufab.kernels.solve import solve
from granufab.kernels.tracing import traced
from granufab.kernels.vectors import inverse_mass, load, load_tangent, store

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
    values = address(slots.values)
    size = fields(like, problem.coupled) * WIDTH
    at = places(like)
    offset = plan.starts[home] * WIDTH
    eps, kappa, weight = problem.softness, problem.spin_factor, address(problem.weight)
    crossed = problem.coupled and len(like) == 2
    head, count = plan.heads[home], plan.heads[home + 1] - plan.heads[home]
    for place in range(head + count * part[0] // part[1], head + count * (part[0] + 1) // part[1]):
        c = plan.listed[place]
        slot = plan.order[c] + offset
        plan.order[c] = slot
        base = slot // WIDTH * size + slot % WIDTH
        i, j = problem.first[c], problem.second[c]
        slots.first[slot], slots.second[slot] = i, j
        n, length = load(problem.normal, c, like), problem.length[c]
        mass = inverse_mass(state.motion, i, like) + inverse_mass(state.motion, j, like)
        w_n, w_t = mass + eps, mass + kappa * mass + eps
        if problem.coupled:
            extra_n, extra_nt, extra_t = cell_weight(weight, n, length)
            w_n, w_t = w_n + extra_n, w_t + extra_t
            if crossed:
                set_item(values, base + WIDTH * at.cross, extra_nt)
        else:
            w_n += length * length * problem.dilation_weight
        inverse = (w_n, w_t) if crossed else (1.0 / w_n, 1.0 / w_t)
        offset_t = load_tangent(problem.offset_t, c, like)
        p_n, p_t = state.impulse_n[c], load_tangent(state.impulse_t, c, like)
        numbers = (length, problem.offset_n[c], problem.mu[c])
        _write(values, base, n, numbers, offset_t, inverse, p_n, p_t, like)
    if part[0] == 0:
        _fill_empty(plan, slots, home, size, at, len(state.motion) - 1)


@traced
def _write(values, base, n, numbers, offset_t, inverse, p_n, p_t, like):
    """The fields of one contact; ``numbers``: length, b_n, µ; the iterate before is this one."""
    at = places(like)
    put_tangent(values, base, at.normal, n)
    for field, value in zip((at.length, at.offset_n, at.mu), numbers, strict=True):
        put(values, base, field, value)
    put_tangent(values, base, at.offset_t, offset_t)
    put(values, base, at.inverse_n, inverse[0])
    put(values, base, at.inverse_t, inverse[1])
    for place_n, place_t in ((at.impulse_n, at.impulse_t), (at.before_n, at.before_t)):
        put(values, base, place_n, p_n)
        put_tangent(values, base, place_t, p_t)


@traced
def _read(values, base, like):
    """The impulse of one contact."""
    at = places(like)
    return take(values, base, at.impulse_n, like), take_tangent(values, base, at.impulse_t, like)


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
    slot = plan.order[c]
    p_n, p_t = _read(address(slots.values), slot // WIDTH * size + slot % WIDTH, like)
    state.impulse_n[c] = p_n
    store(state.impulse_t, c, p_t)


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
