"""Impulses and velocities of a problem: how contacts see their bodies and what they do to them."""

from __future__ import annotations

from granufab.kernels.access import address
from granufab.kernels.cell import add_outer
from granufab.kernels.options import kernel, part
from granufab.kernels.problem import Problem, State
from granufab.kernels.vectors import (
    add,
    axpy,
    compose,
    dot,
    inverse_mass,
    load,
    load_tangent,
    matvec,
    moment,
    scale,
    slip,
    spin,
    store,
    store_spin,
    sub,
    tangential,
)

__all__ = ["apply_impulses", "apply_listed", "local_velocity"]


@part
def local_velocity(problem: Problem, motion, rate, c, like):
    """(u_n, u_t) of contact c without offsets: grains and free cell rates only [m/s]."""
    i, j = problem.first[c], problem.second[c]
    n = load(problem.normal, c, like)
    u = add(
        sub(load(motion, j, like), load(motion, i, like)),
        scale(problem.length[c], matvec(rate, n)),
    )
    u_n = dot(n, u)
    turning = slip(add(spin(motion, i, like), spin(motion, j, like)), n)
    return u_n, sub(tangential(u, n, u_n), turning)


@part
def apply_listed(problem: Problem, state: State, listed, reach, rate, like):
    """Add M⁻¹ H P of some contacts to the velocities of the bodies and to ``rate``.

    Args:
        problem, state: contacts, their impulses, velocities.
        listed, reach: contacts listed[reach[0]:reach[1]].
        rate: free rates of the cell [1/s], shape (D, D).
        like: tuple of D zeros.
    """
    motion = state.motion
    pushed, weight = address(rate), address(problem.weight)
    dilation = 0.0
    for at in range(reach[0], reach[1]):
        c = listed[at]
        i, j = problem.first[c], problem.second[c]
        n = load(problem.normal, c, like)
        p_n, p_t = state.impulse_n[c], load_tangent(state.impulse_t, c, like)
        m_i, m_j = inverse_mass(motion, i, like), inverse_mass(motion, j, like)
        push = compose(n, p_n, p_t)
        turn = scale(-problem.spin_factor, moment(n, p_t))
        store(motion, i, axpy(-m_i, push, load(motion, i, like)))
        store(motion, j, axpy(m_j, push, load(motion, j, like)))
        store_spin(motion, i, axpy(m_i, turn, spin(motion, i, like)), like)
        store_spin(motion, j, axpy(m_j, turn, spin(motion, j, like)), like)
        if problem.coupled:
            add_outer(pushed, weight, push, scale(problem.length[c], n))
        else:
            dilation += problem.dilation_weight * problem.length[c] * p_n
    if not problem.coupled:
        for k in range(len(like)):
            rate[k, k] += dilation


@kernel
def apply_impulses(problem: Problem, state: State, listed, like):
    """Add M⁻¹ H P of the listed contacts to motion and rate of the state."""
    apply_listed(problem, state, listed, (0, len(listed)), state.rate, like)
