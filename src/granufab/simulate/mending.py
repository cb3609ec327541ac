"""Where sweeps circle round the solution: a small group of contacts solved together by Newton.

With friction the linear map of a step is not symmetric, and a few sliding contacts that share
grains can make a sweep push them away from the solution until one changes its state, over and
over, while all other contacts have long settled. The contacts that hold nearly all of the change
of a sweep, and two rings of grains round them, are then solved together, all other contacts and the
cell held; sweeping goes on from there.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.impulses import apply_impulses
from granufab.kernels.problem import Problem, State
from granufab.packing import Array, IntArray
from granufab.simulate.local_form import contact_frames, local_form
from granufab.simulate.local_newton import newton_steps
from granufab.simulate.local_residual import ScaledProblem

__all__ = ["MOST_CONTACTS", "group_of", "mend"]

REST, WIDER = 0.05, 0.5
"""Share of the squared change left out of the first group, and by what it shrinks each time."""
RINGS = 2
MOST_CONTACTS = {2: 4000, 3: 1000}
"""By dimension; factors of more would cost as much as thousands of sweeps."""
NEWTON_STEPS, NEWTON_TOLERANCE = 15, 1e-10


def group_of(problem: Problem, change: Array, before: int = 0) -> IntArray:
    """The contacts that hold most of the change, and all that touch their grains' neighbours.

    In 3D, where that soon is the whole packing, fewer rings where the group would be too large.

    Args:
        problem: contacts of the step.
        change: |ΔP| of each contact in the last sweep [N s], shape (contact_count,).
        before: groups of this step that were solved already; the next one is wider.
    """
    order = np.argsort(change)[::-1]
    held = np.cumsum(change[order] ** 2)
    heart = order[: int(np.searchsorted(held, (1 - REST * WIDER**before) * held[-1])) + 1]
    group = heart
    for _ in range(RINGS):
        wider = _touching(problem, group)
        if len(wider) > MOST_CONTACTS[problem.normal.shape[1]]:
            break
        group = wider
    return np.sort(group)


def _touching(problem: Problem, contacts: IntArray) -> IntArray:
    """The contacts of all bodies of some contacts."""
    bodies = np.unique(np.concatenate([problem.first[contacts], problem.second[contacts]]))
    return np.flatnonzero(np.isin(problem.first, bodies) | np.isin(problem.second, bodies))


def mend(problem: Problem, state: State, change: Array, before: int = 0) -> bool:
    """Solve the group that still changes with everything else held; ``state`` then has it solved.

    Args:
        problem: contacts of the step; they must be compliant for a unique answer.
        state: impulses and the velocities that belong to them.
        change: |ΔP| of each contact in the last sweep [N s], shape (contact_count,).
        before: groups of this step that were solved already; the next one is wider.
    Returns:
        Whether anything was done: not for groups of more than ``MOST_CONTACTS`` contacts.
    """
    chosen = group_of(problem, change, before)
    if not 0 < len(chosen) <= MOST_CONTACTS[problem.normal.shape[1]]:
        return False
    group = _part(problem, chosen)
    start = State(state.motion, state.rate, state.impulse_n[chosen], state.impulse_t[chosen])
    form = local_form(_held_cell(group, state.rate), start._replace(rate=np.zeros_like(state.rate)))
    scaled = ScaledProblem.of(form)
    rows = _rows(group, start.impulse_n, start.impulse_t)
    first = rows[scaled.mobile] / scaled.impulse_unit[:, None]
    found, _, _ = newton_steps(scaled, first, NEWTON_TOLERANCE, NEWTON_STEPS)
    rows = scaled.full(found).reshape(rows.shape)
    impulse_n, impulse_t = _parts(group, rows)
    turn = State(
        state.motion, state.rate, impulse_n - start.impulse_n, impulse_t - start.impulse_t
    )  # fmt: skip
    apply_impulses(group, turn, np.arange(len(chosen)), (0.0,) * problem.normal.shape[1])
    state.impulse_n[chosen], state.impulse_t[chosen] = impulse_n, impulse_t
    return True


def _part(problem: Problem, chosen: IntArray) -> Problem:
    """The problem of some of the contacts."""
    names = ("first", "second", "normal", "length", "offset_n", "offset_t", "mu")
    return problem._replace(**{name: getattr(problem, name)[chosen] for name in names})


def _held_cell(problem: Problem, rate: Array) -> Problem:
    """The same contacts in a cell whose free rates no longer change: its flow is an offset."""
    normal = problem.normal
    flow = problem.length[:, None] * (normal @ rate.T)
    flow_n = np.einsum("ci,ci->c", flow, normal)
    flow_t = flow - flow_n[:, None] * normal
    if normal.shape[1] == 2:
        tangent = contact_frames(normal)[:, 1]
        flow_t = np.einsum("ci,ci->c", flow_t, tangent)[:, None]
    return problem._replace(
        offset_n=problem.offset_n + flow_n,
        offset_t=problem.offset_t + flow_t,
        coupled=False,
        dilation_weight=0.0,
        weight=np.zeros_like(problem.weight),
    )


def _rows(problem: Problem, impulse_n: Array, impulse_t: Array) -> Array:
    """Impulses in the frames of the contacts, shape (contact_count, D)."""
    if impulse_t.shape[1] == 1:
        return np.column_stack([impulse_n, impulse_t])
    frames = contact_frames(problem.normal)
    return np.column_stack([impulse_n, np.einsum("cij,cj->ci", frames[:, 1:], impulse_t)])


def _parts(problem: Problem, rows: Array) -> tuple[Array, Array]:
    """Normal and tangential impulses of rows in the frames of the contacts."""
    if rows.shape[1] == 2:
        return rows[:, 0].copy(), rows[:, 1:].copy()
    frames = contact_frames(problem.normal)
    return rows[:, 0].copy(), np.einsum("cij,ci->cj", frames[:, 1:], rows[:, 1:])
