"""Gauss–Seidel sweep over the contacts, and how far an iterate is from the law.

Both bodies are loaded into locals, the contact is solved exactly, the change is stored: a local
Signorini–Coulomb problem per contact (``contact_law``). The text is the same for one contact and
for a batch of eight that share no body. The cell's free rates are one more body; their change is
handed on every 64 contacts (more often in small problems): the sweep has no serial dependency.

Chunks of contacts may be swept side by side: each then takes the cell to move as if the others
pushed it alike (its own push times the number of chunks); the sum of the true pushes is applied
after all chunks. At the solution no push is left, so the result is the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.access import (
    address,
    body_of,
    find_body,
    inverse_mass_of,
    like_numbers,
    prefetch,
    put,
    put_body,
    put_tangent,
    spin_of,
    stride,
    take,
    take_body,
    take_tangent,
    take_vector,
    velocity_of,
)
from granufab.kernels.cell import add_outer, cell_weight, hand_on, stretching
from granufab.kernels.contact_law import cone_defect, crossed_law, separate_law
from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import part
from granufab.kernels.slots import Slots, places
from granufab.kernels.tracing import greatest, larger, smaller, summed, traced
from granufab.kernels.vectors import (
    add,
    axpy,
    compose,
    dot,
    moment,
    norm2,
    scale,
    slip,
    sub,
    tangential,
)

__all__ = ["Law", "defects", "lag_of", "sweep"]

AHEAD = 6  # batches between asking for memory and using it
LAG, LAGS = 64, 50  # the cell is moved after 64 contacts, and at least 50 times a sweep


class Law(NamedTuple):
    """What all contacts of a solve share (see :class:`granufab.kernels.problem.Problem`)."""

    softness: float
    spin_factor: float
    coupled: bool
    dilation_weight: float
    weight: np.ndarray


class _Numbers(NamedTuple):
    """:class:`Law` without its array."""

    softness: float
    spin_factor: float
    coupled: bool
    dilation_weight: float


@traced
def numbers_of(law: Law):
    """The numbers of the law."""
    return _Numbers(law.softness, law.spin_factor, law.coupled, law.dilation_weight)


@part
def lag_of(batch_count):
    """Batches between two moves of the cell."""
    return larger(1, smaller(LAG // WIDTH, batch_count // LAGS))


@part
def sweep(slots: Slots, bodies, shared: Law, reach, cell, like, size):
    """One forward sweep over some batches.

    Impulses start from y = x + β (x − x_before); bodies hold the velocities of y already.

    Args:
        slots: contacts; impulses and their values before are changed.
        bodies: velocities, changed.
        shared: by all contacts.
        reach: (first batch, end, momentum β, chunks swept side by side).
        cell: free rates L of the cell, in the end with what these contacts added; the sum of
            their pushes; scratch; shape (3, D, D).
        like: width and dimension of the kernel (``access``).
        size: numbers of a batch.
    Returns:
        Σ|x_new − y|², Σ|x_new|² [N² s²].
    """
    start, end, beta, together = reach
    values, one, two = address(slots.values), address(slots.first), address(slots.second)
    law, weight, table = numbers_of(shared), address(shared.weight), address(bodies)
    rate, push, scratch = cell[0], cell[1], cell[2]
    flow, pushes = address(rate), address(scratch)
    dilation, pushed, pending = rate[0, 0], 0.0, 0.0
    moved, length2 = 0.0, 0.0
    lag = lag_of(slots.starts[-1])
    until = lag
    for batch in range(start, end):
        _announce(values, table, one, two, smaller(batch + AHEAD, end - 1), size, like)
        for lane in range(0, WIDTH, stride(like)):
            base, place = batch * size + lane, batch * WIDTH + lane
            at = (values, one, two, table, base, place)
            if law.coupled:
                step, new, turn = _visit_coupled(at, law, beta, flow, pushes, weight, like)
            else:
                step, new, turn = _visit(at, law, beta, dilation, like)
            moved += step
            length2 += new
            pending += turn
        until -= 1
        if until == 0:
            until = lag
            if law.coupled:
                hand_on(rate, push, scratch, together)
            dilation += together * pending
            pushed += pending
            pending = 0.0
    if law.coupled:
        hand_on(rate, push, scratch, together)
    else:
        for k in range(len(rate)):
            rate[k, k] = dilation + together * pending
            push[k, k] += pushed + pending
    return moved, length2


@traced
def _announce(values, bodies, one, two, batch, size, like):
    """Ask for the memory of a batch, some batches before it is swept."""
    if isinstance(like[0], tuple):
        prefetch(values, bodies, one, two, batch, size, places(like[0]).cross, like)


@traced
def _visit(where, law, beta, dilation, like):
    """:func:`_update` where the cell is free to dilate only."""
    return _update(where, law, beta, dilation, None, like)


@traced
def _visit_coupled(where, law, beta, rate, scratch, weight, like):
    """:func:`_update` where the cell is free to change its shape."""
    return _update(where, law, beta, None, (rate, scratch, weight), like)


def _update(where, law, beta, dilation, cell, like):
    """Solve one contact (or eight); returns |ΔP|², |P|² and the push on the dilation."""
    values, one, two, bodies, base, place = where
    numbers = like_numbers(like)
    at = places(numbers)
    i, j = find_body(bodies, one, place, numbers), find_body(bodies, two, place, numbers)
    body_i, body_j = take_body(bodies, i, numbers), take_body(bodies, j, numbers)
    n = take_vector(values, base, at.normal, numbers)
    length = take(values, base, at.length, numbers)
    x_n = take(values, base, at.impulse_n, numbers)
    x_t = take_tangent(values, base, at.impulse_t, numbers)
    y_n = x_n + beta * (x_n - take(values, base, at.before_n, numbers))
    y_t = axpy(beta, sub(x_t, take_tangent(values, base, at.before_t, numbers)), x_t)
    u_n, u_t = _velocity(body_i, body_j, n, length, dilation, cell)
    u_n = u_n + (take(values, base, at.offset_n, numbers) + law.softness * y_n)
    u_t = add(u_t, take_tangent(values, base, at.offset_t, numbers))
    u_t = axpy(law.softness, y_t, u_t)
    w_n = take(values, base, at.inverse_n, numbers)
    w_t = take(values, base, at.inverse_t, numbers)
    mu = take(values, base, at.mu, numbers)
    if cell and len(numbers) == 2:
        cross = take(values, base, at.cross, numbers)
        new_n, new_t = crossed_law(y_n, y_t, u_n, u_t, w_n, cross, w_t, mu)
    else:
        new_n, new_t = separate_law(y_n, y_t, u_n, u_t, w_n, w_t, mu)
    d_n, d_t = new_n - y_n, sub(new_t, y_t)
    put(values, base, at.before_n, x_n)
    put_tangent(values, base, at.before_t, x_t)
    put(values, base, at.impulse_n, new_n)
    put_tangent(values, base, at.impulse_t, new_t)
    push = compose(n, d_n, d_t)
    turn = scale(-law.spin_factor, moment(n, d_t))
    m_i, m_j = inverse_mass_of(body_i), inverse_mass_of(body_j)
    v_i = axpy(-m_i, push, velocity_of(body_i))
    v_j = axpy(m_j, push, velocity_of(body_j))
    put_body(bodies, i, body_of(v_i, axpy(m_i, turn, spin_of(body_i)), body_i))
    put_body(bodies, j, body_of(v_j, axpy(m_j, turn, spin_of(body_j)), body_j))
    if cell:
        _, scratch, weight = cell
        add_outer(scratch, weight, push, scale(length, n))
    stretched = law.dilation_weight * summed(length * d_n)
    return summed(d_n * d_n + norm2(d_t)), summed(new_n * new_n + norm2(new_t)), stretched


def _velocity(body_i, body_j, n, length, dilation, cell):
    """(u_n, u_t) of grains and free cell, without offsets."""
    u = sub(velocity_of(body_j), velocity_of(body_i))
    if cell:
        u = add(u, scale(length, stretching(cell[0], n)))
    u_n = dot(n, u)
    u_t = sub(tangential(u, n, u_n), slip(add(spin_of(body_i), spin_of(body_j)), n))
    return u_n if cell else u_n + dilation * length, u_t


@part
def defects(slots: Slots, bodies, shared: Law, reach, cell, like, size):
    """What some batches add to the residual ‖P − proj_K(P − ρ(ũ + µ|u_t| n))‖ / ‖P‖.

    ρ = 1/W_nn with the cell's share; ũ holds every offset and the spring.

    Args:
        slots, bodies, shared, like, size: as for :func:`sweep`; nothing is changed.
        reach: (first batch, end).
        cell: free rates L first, shape (3, D, D).
    Returns:
        Σ of squared distances, the largest, Σ|P|² [N² s²], worst violation −ũ_n [m/s].
    """
    total, worst, length2, violation = 0.0, 0.0, 0.0, 0.0
    values, one, two = address(slots.values), address(slots.first), address(slots.second)
    law, weight, table = numbers_of(shared), address(shared.weight), address(bodies)
    rate, dilation = address(cell), cell[0, 0, 0]
    for batch in range(reach[0], reach[1]):
        for lane in range(0, WIDTH, stride(like)):
            base, place = batch * size + lane, batch * WIDTH + lane
            at = (values, one, two, table, base, place)
            if law.coupled:
                far, most, new, closing = _defect_coupled(at, law, rate, weight, like)
            else:
                far, most, new, closing = _defect(at, law, dilation, like)
            total += far
            worst = larger(worst, most)
            length2 += new
            violation = larger(violation, closing)
    return total, worst, length2, violation


@traced
def _defect(where, law, dilation, like):
    """:func:`_distance` where the cell is free to dilate only."""
    return _distance(where, law, dilation, None, like)


@traced
def _defect_coupled(where, law, rate, weight, like):
    """:func:`_distance` where the cell is free to change its shape."""
    return _distance(where, law, None, (rate, weight), like)


def _distance(where, law, dilation, cell, like):
    """Distance² from the law, the largest, |P|², worst −ũ_n of one contact (or eight)."""
    values, one, two, bodies, base, place = where
    numbers = like_numbers(like)
    at = places(numbers)
    i, j = find_body(bodies, one, place, numbers), find_body(bodies, two, place, numbers)
    body_i, body_j = take_body(bodies, i, numbers), take_body(bodies, j, numbers)
    n = take_vector(values, base, at.normal, numbers)
    length = take(values, base, at.length, numbers)
    p_n = take(values, base, at.impulse_n, numbers)
    p_t = take_tangent(values, base, at.impulse_t, numbers)
    u_n, u_t = _velocity(body_i, body_j, n, length, dilation, cell)
    u_n = u_n + (take(values, base, at.offset_n, numbers) + law.softness * p_n)
    u_t = add(u_t, take_tangent(values, base, at.offset_t, numbers))
    u_t = axpy(law.softness, p_t, u_t)
    w_n = inverse_mass_of(body_i) + inverse_mass_of(body_j)
    if cell:
        w_n = w_n + cell_weight(cell[1], n, length)[0]
    else:
        w_n = w_n + length * length * law.dilation_weight
    mu = take(values, base, at.mu, numbers)
    far = cone_defect(p_n, p_t, u_n, u_t, 1.0 / larger(w_n, 1e-300), mu)
    return summed(far), greatest(far), summed(p_n * p_n + norm2(p_t)), greatest(-u_n)
