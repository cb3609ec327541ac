"""The nonlinear solve of one step: sweeps with safeguarded momentum until the residual is met.

Momentum: x_{k+1} = sweep(y_k), y_{k+1} = x_{k+1} + β_k (x_{k+1} − x_k) with β_k = min(k/(k+3),
cap). When the step norm ‖x_{k+1} − y_k‖ grows by more than 1.02 the momentum restarts and 1 − cap
grows by 1.3; after 15 sweeps without a restart 1 − cap shrinks by 1.3 again. Velocities are
affine in the impulses, so both are extrapolated alike. The residual is taken only on an
unextrapolated iterate, when the step norm promises that it is met, and at least every ``CHECK``
sweeps. Where five checks bring no progress another cap is tried: on rare steps momentum circles
around the solution while plain sweeps converge, on others it is the other way round.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.options import kernel
from granufab.kernels.problem import Problem, State
from granufab.kernels.sweep import residual, sweep

__all__ = ["CHECK", "extrapolate", "solve"]

CHECK = 40
GROWTH = 1.02
CAUTION = 1.3
RECOVERY = 15
PROGRESS, PATIENCE = 0.9, 5


@kernel
def extrapolate(now, before, beta):
    """now ← now + β (now − before), before ← now, for every item of two equal arrays."""
    for i in range(now.shape[0]):
        for k in range(now.shape[1]):
            value = now[i, k]
            now[i, k] = value + beta * (value - before[i, k])
            before[i, k] = value


@kernel
def extrapolate_line(now, before, beta):
    """:func:`extrapolate` for one-dimensional arrays."""
    for i in range(len(now)):
        value = now[i]
        now[i] = value + beta * (value - before[i])
        before[i] = value


@kernel
def remember(state: State, before: State):
    """Copy the iterate."""
    before.motion[:] = state.motion
    before.rate[:] = state.rate
    before.impulse_n[:] = state.impulse_n
    before.impulse_t[:] = state.impulse_t


@kernel
def impulse_norm(state: State):
    """‖P‖₂ over all contacts [N s]."""
    total = 0.0
    for c in range(len(state.impulse_n)):
        total += state.impulse_n[c] ** 2
        for k in range(state.impulse_t.shape[1]):
            total += state.impulse_t[c, k] ** 2
    return np.sqrt(total)


@kernel
def next_cap(cap, first):
    """Caps to try in turn where the residual stalls: halves, then none, then the first again."""
    if cap > 0.2:
        return 0.5 * cap
    return 0.0 if cap > 0.0 else first


@kernel
def solve(problem: Problem, state: State, before: State, like, settings):
    """Sweep until the residual is met or the sweeps run out.

    Args:
        problem: the step's contact problem.
        state: warm start in, solution out; velocities consistent with the impulses.
        before: scratch of the same shapes.
        like: tuple of D zeros.
        settings: (tolerance, max_sweeps, momentum cap (0: plain), floor p d^{D−1} h, lag).
    Returns:
        sweeps, residual, largest single share, worst violation [m/s].
    """
    tolerance, max_sweeps, cap, floor, lag = settings
    found = residual(problem, state, like, floor)
    sweeps = 0
    since_check, momentum_age, last_step = 0, 0, np.inf
    highest, calm = cap, 0
    best, stale = np.inf, 0
    ratio = 1.0
    remember(state, before)
    while found[0] > tolerance and sweeps < max_sweeps:
        step = np.sqrt(sweep(problem, state, like, lag))
        sweeps += 1
        since_check += 1
        relative = step / max(impulse_norm(state), floor)
        if relative * ratio < tolerance or since_check >= CHECK or sweeps == max_sweeps:
            due = since_check >= CHECK
            since_check = 0
            found = residual(problem, state, like, floor)
            ratio = max(0.2, 0.9 * found[0] / max(relative, 1e-300))
            if found[0] <= tolerance:
                break
            if due:
                stale += 1
            if found[0] < PROGRESS * best:
                best, stale = found[0], 0
            if stale == PATIENCE:
                stale = 0
                highest = next_cap(highest, settings[2])
                cap, calm, momentum_age = highest, 0, 0
        if settings[2] > 0.0 and sweeps < max_sweeps:
            if step > GROWTH * last_step:
                momentum_age = 0
                cap = max(0.0, 1.0 - CAUTION * (1.0 - cap))
                calm = 0
            else:
                calm += 1
                if calm == RECOVERY:
                    calm = 0
                    cap = min(highest, 1.0 - (1.0 - cap) / CAUTION)
            last_step = step
            beta = min(momentum_age / (momentum_age + 3.0), cap)
            momentum_age += 1
            extrapolate(state.motion, before.motion, beta)
            extrapolate(state.rate, before.rate, beta)
            extrapolate_line(state.impulse_n, before.impulse_n, beta)
            extrapolate(state.impulse_t, before.impulse_t, beta)
    return sweeps, found[0], found[1], found[2]
