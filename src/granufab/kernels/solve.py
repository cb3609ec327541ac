"""The nonlinear solve of one step: sweeps with safeguarded momentum until the residual is met.

Momentum: x_{k+1} = sweep(y_k), y_{k+1} = x_{k+1} + β_k (x_{k+1} − x_k) with β_k = min(k/(k+3),
cap). When the step norm ‖x_{k+1} − y_k‖ is more than 1.1 times its smallest value since the last
restart, the momentum restarts and 1 − cap grows by 1.3; after 15 sweeps without a restart 1 − cap
shrinks by 1.3 again. Velocities are affine in the impulses, so both are extrapolated alike. The
residual is taken only on an unextrapolated iterate, when the step norm promises that it is met, and
at least every ``CHECK`` sweeps. Where five checks bring no progress another cap is tried: on rare
steps momentum circles around the solution while plain sweeps converge, on others it is the other
way round. The solve also ends where the step norm has not fallen by a tenth for a given number of
sweeps: contacts that circle are then solved together (``granufab.simulate.mending``).

Members of a team share the chunks of contacts; the first of them decides. What is computed does
not depend on how many they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.access import address, extrapolate_body, item
from granufab.kernels.cell import move_cell
from granufab.kernels.options import part
from granufab.kernels.slots import Slots
from granufab.kernels.sweep import Law, defects, sweep
from granufab.kernels.team import given_up, meet

__all__ = ["CHECK", "CONTROLS", "SUMS", "Work", "patient_sweeps", "solve"]

CHECK = 40
GROWTH = 1.1
CAUTION = 1.3
RECOVERY = 15
PROGRESS, PATIENCE = 0.9, 5
FALL, FEWEST = 0.9, 150
BETA, DONE, SWEEPS, RESIDUAL, SHARE, VIOLATION, LOOK, RELATIVE = range(8)
CONTROLS, SUMS = 8, 8


class Work(NamedTuple):
    """Memory of a solve, shared by a team.

    Attributes:
        grains: indices of the grains, chunk after chunk, shape (N,).
        before: body velocities of the iterate before, shape of ``bodies``.
        cells: (free rates, push, scratch) of the cell as each chunk sees it, and last for all,
            shape (chunk_count + 1, 3, D, D).
        rate_before: free rates of the iterate before, shape (D, D).
        sums: of every chunk, shape (chunk_count + 1, SUMS).
        control: what the first member decided, shape (CONTROLS,).
        counters: of the barrier, shape (COUNTERS,).
    """

    grains: np.ndarray
    before: np.ndarray
    cells: np.ndarray
    rate_before: np.ndarray
    sums: np.ndarray
    control: np.ndarray
    counters: np.ndarray


@part
def solve(slots: Slots, bodies, law: Law, work: Work, like, size, settings, member, members):
    """Sweep until the residual is met or the sweeps run out.

    Args:
        slots: packed contacts: warm start in, solution out.
        bodies: velocities consistent with the impulses, shape (body_count + 1, 4 or 8).
        law: shared by all contacts.
        work: memory; ``work.cells[-1, 0]`` holds the free rates of the cell, in and out.
        like: width and dimension of the kernels (``access``).
        size: numbers of a batch.
        settings: (tolerance, max_sweeps, momentum cap (0: plain), floor p d^{D−1} h, sweeps
            without progress after which to stop).
        member, members: number of this thread, and how many solve together.
    Returns:
        sweeps, residual, largest single share, worst violation [m/s].
    """
    control = work.control
    if member == 0:
        _begin(work)
    meet(work.counters, members)
    _remember(bodies, work, member, members)
    _judge(slots, bodies, law, work, like, size, settings, member, members)
    state = (settings[2], settings[2], 0, 0, np.inf)
    watch = (0, np.inf, 0, 1.0, np.inf, 0.0)
    while control[DONE] == 0.0 and (members == 1 or not given_up(work.counters)):
        _sweep_all(slots, bodies, law, work, like, size, member, members)
        if member == 0:
            state, watch = _decide(work, settings, state, watch)
        meet(work.counters, members)
        if control[LOOK] == 1.0:
            _judge(slots, bodies, law, work, like, size, settings, member, members)
            if member == 0:
                state, watch = _consider(work, settings, state, watch)
            meet(work.counters, members)
    return int(control[SWEEPS]), control[RESIDUAL], control[SHARE], control[VIOLATION]


@part
def _begin(work: Work):
    for k in range(CONTROLS):
        work.control[k] = 0.0
    for chunk in range(len(work.sums)):
        for k in range(SUMS):
            work.sums[chunk, k] = 0.0
    rate = work.cells[-1, 0]
    for k in range(len(rate)):
        for l in range(len(rate)):
            work.rate_before[k, l] = rate[k, l]


@part
def _rows(count, member, members):
    """Share of the bodies of a member."""
    return count * member // members, count * (member + 1) // members


@part
def _remember(bodies, work: Work, member, members):
    first, end = _rows(len(bodies), member, members)
    for i in range(first, end):
        for k in range(bodies.shape[1]):
            work.before[i, k] = bodies[i, k]


@part
def _extrapolate(bodies, work: Work, chunk, chunks, like):
    """now ← now + β (now − before), before ← now, for the grains of a chunk; walls never change."""
    count, beta = len(work.grains), work.control[BETA]
    now, before, grains = address(bodies), address(work.before), address(work.grains)
    for turn in range(_first_of(chunk, chunks, count), _first_of(chunk + 1, chunks, count)):
        extrapolate_body(now, before, item(grains, turn), beta, like)


@part
def _first_of(chunk, chunks, count):
    """Place of the first grain of a chunk among the grains in the order of the chunks."""
    return (chunk * count + chunks - 1) // chunks


@part
def _start_cell(cell, work: Work, beta):
    """The extrapolated cell as a chunk sees it before its first contact: no push yet."""
    shared = work.cells[-1]
    for k in range(cell.shape[1]):
        for l in range(cell.shape[1]):
            value = shared[0, k, l]
            cell[0, k, l] = value + beta * (value - work.rate_before[k, l])
            cell[1, k, l], cell[2, k, l] = 0.0, 0.0


@part
def _sweep_all(slots: Slots, bodies, law: Law, work: Work, like, size, member, members):
    """Extrapolate and sweep chunk by chunk, then sweep the contacts between them.

    A chunk's own contacts touch none but its own grains (and walls), so what is extrapolated is
    still in the cache when it is swept.
    """
    chunks = len(slots.starts) - 2
    beta, cells = work.control[BETA], work.cells
    for chunk in range(member, chunks, members):
        _extrapolate(bodies, work, chunk, chunks, like)
        _start_cell(cells[chunk], work, beta)
        reach = (slots.starts[chunk], slots.starts[chunk + 1], beta, float(chunks))
        moved, length2 = sweep(slots, bodies, law, reach, cells[chunk], like, size)
        work.sums[chunk, 0], work.sums[chunk, 1] = moved, length2
    meet(work.counters, members)
    if member == 0:
        shared = cells[-1]
        _turn_cell(shared, work, beta)
        for chunk in range(chunks):
            move_cell(shared[0], cells[chunk, 1])
        reach = (slots.starts[chunks], slots.starts[chunks + 1], beta, 1.0)
        moved, length2 = sweep(slots, bodies, law, reach, shared, like, size)
        work.sums[chunks, 0], work.sums[chunks, 1] = moved, length2


@part
def _turn_cell(shared, work: Work, beta):
    """The shared cell extrapolated, what it was is remembered."""
    for k in range(shared.shape[1]):
        for l in range(shared.shape[1]):
            value = shared[0, k, l]
            shared[0, k, l] = value + beta * (value - work.rate_before[k, l])
            shared[1, k, l], shared[2, k, l] = 0.0, 0.0
            work.rate_before[k, l] = value


@part
def _decide(work: Work, settings, state, watch):
    """After a sweep: the momentum of the next one, and whether the residual is to be taken."""
    tolerance, max_sweeps, first_cap, floor, patience = settings
    cap, highest, age, calm, least = state
    since, best, stale, ratio, lowest, lowest_at = watch
    moved, length2 = 0.0, 0.0
    for k in range(len(work.sums)):
        moved += work.sums[k, 0]
        length2 += work.sums[k, 1]
    step = np.sqrt(moved)
    relative = step / max(np.sqrt(length2), floor)
    control = work.control
    control[SWEEPS] += 1.0
    since += 1
    if step < FALL * lowest:
        lowest, lowest_at = step, control[SWEEPS]
    spent = control[SWEEPS] >= max_sweeps or control[SWEEPS] - lowest_at > patience
    control[LOOK] = 1.0 if relative * ratio < tolerance or since >= CHECK or spent else 0.0
    control[RELATIVE] = relative
    if first_cap > 0.0 and not spent:
        if step > GROWTH * least:
            age, calm, least = 0, 0, step
            cap = max(0.0, 1.0 - CAUTION * (1.0 - cap))
        else:
            calm += 1
            least = min(least, step)
            if calm == RECOVERY:
                calm = 0
                cap = min(highest, 1.0 - (1.0 - cap) / CAUTION)
        control[BETA] = min(age / (age + 3.0), cap)
        age += 1
    return (cap, highest, age, calm, least), (
        since, best, stale, ratio, lowest, lowest_at,
    )  # fmt: skip


@part
def _consider(work: Work, settings, state, watch):
    """After the residual was taken: done, or another cap where nothing moves."""
    cap, highest, age, calm, least = state
    since, best, stale, ratio, lowest, lowest_at = watch
    control = work.control
    found, due = control[RESIDUAL], since >= CHECK
    ratio = max(0.2, 0.9 * found / max(control[RELATIVE], 1e-300))
    if due:
        stale += 1
    if found < PROGRESS * best:
        best, stale = found, 0
    if stale == PATIENCE:
        stale = 0
        highest = next_cap(highest, settings[2])
        cap, calm, age = highest, 0, 0
        control[BETA] = 0.0
    if control[SWEEPS] >= settings[1] or control[SWEEPS] - lowest_at > settings[4]:
        control[DONE] = 1.0
    return (cap, highest, age, calm, least), (
        0, best, stale, ratio, lowest, lowest_at,
    )  # fmt: skip


@part
def _judge(slots: Slots, bodies, law: Law, work: Work, like, size, settings, member, members):
    """Take the residual; done where it is met or no sweeps are allowed."""
    chunks = len(slots.starts) - 1
    for chunk in range(member, chunks, members):
        reach = (slots.starts[chunk], slots.starts[chunk + 1])
        far, worst, length2, violation = defects(
            slots, bodies, law, reach, work.cells[-1], like, size
        )
        work.sums[chunk, 2], work.sums[chunk, 3] = far, worst
        work.sums[chunk, 4], work.sums[chunk, 5] = length2, violation
    meet(work.counters, members)
    if member == 0:
        total, worst, length2, violation = 0.0, 0.0, 0.0, 0.0
        for k in range(chunks):
            total += work.sums[k, 2]
            worst = max(worst, work.sums[k, 3])
            length2 += work.sums[k, 4]
            violation = max(violation, work.sums[k, 5])
        size2 = max(np.sqrt(length2), settings[3])
        control = work.control
        control[RESIDUAL] = np.sqrt(total) / size2
        control[SHARE], control[VIOLATION] = np.sqrt(worst) / size2, violation
        if control[RESIDUAL] <= settings[0] or settings[1] == 0:
            control[DONE] = 1.0
    meet(work.counters, members)


@part
def next_cap(cap, first):
    """Caps to try in turn where the residual stalls: halves, then none, then the first again."""
    if cap > 0.2:
        return 0.5 * cap
    return 0.0 if cap > 0.0 else first


@part
def patient_sweeps(updates, contacts):
    """Sweeps without progress after which to stop, for so many contact updates without any."""
    return max(float(FEWEST), updates / max(1.0, float(contacts)))
