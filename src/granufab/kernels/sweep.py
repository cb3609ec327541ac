"""Gauss–Seidel sweep over the contacts, and what goes with it.

Both bodies are loaded into locals, the contact is solved exactly, the change is stored: a local
Signorini–Coulomb problem per contact (``contact_law``). The cell's free rates are one more body;
their change is handed on every ``lag`` contacts, which frees the sweep of a serial dependency.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.contact_law import cone_defect, coupled_law, separate_law
from granufab.kernels.options import kernel
from granufab.kernels.problem import Problem, State
from granufab.kernels.vectors import (
    add,
    add_outer,
    axpy,
    cell_weight,
    compose,
    dot,
    inverse_mass,
    load,
    load_tangent,
    matvec,
    moment,
    norm2,
    scale,
    slip,
    spin,
    store,
    store_spin,
    sub,
    tangential,
)

__all__ = ["apply_impulses", "local_velocity", "residual", "sweep"]


@kernel
def sweep(problem: Problem, state: State, like, lag):
    """One forward Gauss–Seidel sweep; returns Σ|ΔP|² over the contacts [N² s²]."""
    motion, rate = state.motion, state.rate
    pending = np.zeros_like(rate)
    dilation = rate[0, 0]
    pending_dilation = 0.0
    eps, kappa = problem.softness, problem.spin_factor
    w_cell = problem.dilation_weight
    moved, until = 0.0, lag
    for c in range(len(problem.length)):
        i, j = problem.first[c], problem.second[c]
        n, length = load(problem.normal, c, like), problem.length[c]
        s_i, s_j = spin(motion, i, like), spin(motion, j, like)
        m_i, m_j = inverse_mass(motion, i, like), inverse_mass(motion, j, like)
        v_i, v_j = load(motion, i, like), load(motion, j, like)
        p_n, p_t = state.impulse_n[c], load_tangent(state.impulse_t, c, like)
        u = sub(v_j, v_i)
        if problem.coupled:
            u = add(u, scale(length, matvec(rate, n)))
        u_n = dot(n, u)
        u_t = sub(tangential(u, n, u_n), slip(add(s_i, s_j), n))
        u_n += problem.offset_n[c] + eps * p_n
        u_t = add(u_t, axpy(eps, p_t, load_tangent(problem.offset_t, c, like)))
        mass = m_i + m_j
        w_t = mass + kappa * mass + eps
        if problem.coupled:
            extra_n, extra_nt, extra_t = cell_weight(problem.weight, n, length)
            new_n, new_t = coupled_law(
                p_n, p_t, u_n, u_t, mass + eps + extra_n, extra_nt, w_t + extra_t, problem.mu[c]
            )
        else:
            u_n += dilation * length
            w_n = mass + eps + length * length * w_cell
            new_n, new_t = separate_law(p_n, p_t, u_n, u_t, w_n, w_t, problem.mu[c])
        d_n, d_t = new_n - p_n, sub(new_t, p_t)
        moved += d_n * d_n + norm2(d_t)
        state.impulse_n[c] = new_n
        store(state.impulse_t, c, new_t)
        push = compose(n, d_n, d_t)
        turn = scale(-kappa, moment(n, d_t))
        store(motion, i, axpy(-m_i, push, v_i))
        store(motion, j, axpy(m_j, push, v_j))
        store_spin(motion, i, axpy(m_i, turn, s_i), like)
        store_spin(motion, j, axpy(m_j, turn, s_j), like)
        if problem.coupled:
            add_outer(pending, problem.weight, push, scale(length, n))
        else:
            pending_dilation += w_cell * length * d_n
        until -= 1
        if until == 0:
            until = lag
            dilation += pending_dilation
            pending_dilation = 0.0
            if problem.coupled:
                hand_on(rate, pending)
    if problem.coupled:
        hand_on(rate, pending)
    else:
        set_diagonal(rate, dilation + pending_dilation)
    return moved


@kernel
def hand_on(rate, pending):
    """Add the pending change to the free cell rates and clear it."""
    for k in range(len(rate)):
        for l in range(len(rate)):
            rate[k, l] += pending[k, l]
            pending[k, l] = 0.0


@kernel
def set_diagonal(rate, dilation):
    """Write a uniform dilation rate."""
    for k in range(len(rate)):
        rate[k, k] = dilation


@kernel
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


@kernel
def residual(problem: Problem, state: State, like, floor):
    """How far the iterate is from the law: ‖P − proj_K(P − ρ(ũ + µ|u_t| n))‖ / max(‖P‖, floor).

    ρ_c = 1/W_nn,c with the cell's share; ũ holds every offset and the spring. ``floor`` is
    p d^{D−1} h [N s].

    Returns:
        residual [-], the largest single contact's share [-], worst violation −ũ_n [m/s].
    """
    total, worst, size, violation = 0.0, 0.0, 0.0, 0.0
    eps = problem.softness
    for c in range(len(problem.length)):
        n = load(problem.normal, c, like)
        length = problem.length[c]
        p_n, p_t = state.impulse_n[c], load_tangent(state.impulse_t, c, like)
        u_n, u_t = local_velocity(problem, state.motion, state.rate, c, like)
        u_n += problem.offset_n[c] + eps * p_n
        u_t = add(u_t, axpy(eps, p_t, load_tangent(problem.offset_t, c, like)))
        w_n = inverse_mass(state.motion, problem.first[c], like)
        w_n += inverse_mass(state.motion, problem.second[c], like)
        if problem.coupled:
            w_n += cell_weight(problem.weight, n, length)[0]
        else:
            w_n += length * length * problem.dilation_weight
        defect = cone_defect(p_n, p_t, u_n, u_t, 1.0 / w_n, problem.mu[c])
        total += defect
        worst = max(worst, defect)
        size += p_n * p_n + norm2(p_t)
        violation = max(violation, -u_n)
    scale_ = max(np.sqrt(size), floor)
    return np.sqrt(total) / scale_, np.sqrt(worst) / scale_, violation


@kernel
def apply_impulses(problem: Problem, state: State, like):
    """Add M⁻¹ H P of every contact to motion and rate, which hold the free velocities."""
    motion, rate = state.motion, state.rate
    dilation = 0.0
    for c in range(len(problem.length)):
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
            add_outer(rate, problem.weight, push, scale(problem.length[c], n))
        else:
            dilation += problem.dilation_weight * problem.length[c] * p_n
    if not problem.coupled:
        for k in range(len(like)):
            rate[k, k] += dilation
