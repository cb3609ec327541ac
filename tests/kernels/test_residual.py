"""The residual of a step's solve: zero at solutions only, without units, as its formula says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from granufab.kernels.impulses import apply_listed
from granufab.kernels.problem import Problem, State
from granufab.simulate.contact_solver import ContactSolver

BODIES, CONTACTS = 12, 20


def solve(problem, state, tolerance, max_sweeps, cap=0.0, *, floor=1e-3, wide=False, chunks=1):
    """Sweeps, residual, largest share, worst violation of a solve in place."""
    solver = ContactSolver(BODIES, problem.normal.shape[1], wide=wide)
    solver.divide(chunks, np.argsort(np.arange(BODIES) % chunks, kind="stable"))
    return solver.solve(problem, state, (tolerance, max_sweeps, cap, floor))[:4]


def residual(problem, state, floor, *, wide=False):
    """Residual, largest share, worst violation of an iterate."""
    return solve(problem, state, 0.0, 0, floor=floor, wide=wide)[1:]


def sweep(problem, state, *, wide=False, chunks=1):
    """One plain sweep in place."""
    solve(problem, state, -1.0, 1, wide=wide, chunks=chunks)


def _random_problem(dimension, *, coupled, softness=0.0):
    """A chain of pushes between random bodies, closing and slipping at random."""
    generator = np.random.default_rng(17 + dimension)
    first = generator.integers(0, BODIES, CONTACTS).astype(np.int32)
    second = ((first + generator.integers(1, BODIES, CONTACTS)) % BODIES).astype(np.int32)
    normal = generator.standard_normal((CONTACTS, dimension))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    tangents = 1 if dimension == 2 else 3
    inertia = 30.0
    offset_t = 0.1 * generator.standard_normal((CONTACTS, tangents))
    if dimension == 3:
        offset_t -= np.einsum("ck,ck->c", offset_t, normal)[:, None] * normal
    problem = Problem(
        first=first,
        second=second,
        normal=normal,
        length=generator.uniform(0.8, 1.2, CONTACTS),
        offset_n=generator.uniform(-0.5, 0.1, CONTACTS),
        offset_t=offset_t,
        mu=generator.uniform(0.1, 0.4, CONTACTS),
        softness=softness,
        spin_factor=2.0 if dimension == 2 else 2.5,
        coupled=coupled,
        dilation_weight=0.0 if coupled else 1 / (dimension * inertia),
        weight=np.eye(dimension) / inertia if coupled else np.zeros((dimension, dimension)),
    )
    motion = np.zeros((BODIES + 1, 4 if dimension == 2 else 8))
    ends = dimension + tangents
    motion[:BODIES, :ends] = 0.3 * generator.standard_normal((BODIES, ends))
    motion[:BODIES, ends] = 1 / generator.uniform(0.5, 2.0, BODIES)
    state = State(
        motion,
        np.zeros((dimension, dimension)),
        np.zeros(CONTACTS),
        np.zeros((CONTACTS, tangents)),
    )
    return problem, state


def _copy(state):
    return State(*(array.copy() for array in state))


def _solved(problem, state, cap=0.9, **given):
    state = _copy(state)
    found = solve(problem, state, 1e-12, 100_000, cap, **given)
    return state, found


CASES = [(2, False, 0.0), (2, True, 0.0), (2, True, 0.2), (3, False, 0.0), (3, False, 0.3)]


@pytest.mark.parametrize(("dimension", "coupled", "softness"), CASES)
def test_the_residual_vanishes_at_the_solution_only(dimension, coupled, softness):
    problem, start = _random_problem(dimension, coupled=coupled, softness=softness)
    before = residual(problem, start, 1e-3)
    state, (sweeps, found, share, violation) = _solved(problem, start)
    assert before[0] > 1.0
    assert 5 < sweeps < 100_000
    assert found <= 1e-12
    assert share <= found
    assert violation < 1e-10
    assert (state.impulse_n > 0).sum() > 5
    law_n, law_t = _velocities(problem, state)
    size = np.linalg.norm(state.impulse_t, axis=1)
    cone = problem.mu * state.impulse_n
    assert (law_n > -1e-10).all()
    assert np.abs(state.impulse_n * law_n).max() < 1e-8
    assert (size <= cone + 1e-12).all()
    slip = np.linalg.norm(law_t, axis=1)
    sticking = size < cone - 1e-9
    assert sticking.any()
    assert slip[sticking].max() < 1e-9
    sliding = (slip > 1e-6) & (state.impulse_n > 0)
    assert sliding.any()
    power = np.einsum("ck,ck->c", state.impulse_t, law_t)
    assert power[sliding] == pytest.approx(-(size * slip)[sliding], rel=1e-6)
    for moved in (state.impulse_n, state.impulse_t):
        moved += 1e-6
        assert residual(problem, state, 1e-3)[0] > 1e-7
        moved -= 1e-6


def _velocities(problem, state):
    """ũ_n, ũ_t of every contact with offsets and springs, from the body records."""
    n, dimension = problem.normal, problem.normal.shape[1]
    one, two = state.motion[problem.first], state.motion[problem.second]
    u = two[:, :dimension] - one[:, :dimension]
    u = u + problem.length[:, None] * (n @ state.rate.T)
    along = np.einsum("ck,ck->c", u, n)
    if dimension == 2:
        tangent = np.column_stack([-n[:, 1], n[:, 0]])
        across = np.einsum("ck,ck->c", u, tangent)[:, None] - (one + two)[:, 2:3]
    else:
        across = u - along[:, None] * n - np.cross((one + two)[:, 3:6], n)
    along = along + problem.offset_n + problem.softness * state.impulse_n
    return along, across + problem.offset_t + problem.softness * state.impulse_t


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("sweeps", [0, 1, 4])
@pytest.mark.parametrize(("dimension", "coupled", "softness"), CASES)
def test_the_residual_is_its_formula(dimension, coupled, softness, sweeps, wide):
    """‖P − proj_K(P − ρ(ũ + µ|u_t| n))‖ / max(‖P‖, floor), ρ = 1/W_nn with the cell's share."""
    problem, state = _random_problem(dimension, coupled=coupled, softness=softness)
    for _ in range(sweeps):
        sweep(problem, state, wide=wide)
    u_n, u_t = _velocities(problem, state)
    heavy = 3 if dimension == 2 else 6
    w = state.motion[problem.first, heavy] + state.motion[problem.second, heavy]
    if coupled:
        w = w + problem.length**2 * np.einsum(
            "ck,kl,cl->c", problem.normal**2, problem.weight, problem.normal**2
        )
    else:
        w = w + problem.length**2 * problem.dilation_weight
    trial_n = state.impulse_n - (u_n + problem.mu * np.linalg.norm(u_t, axis=1)) / w
    trial_t = state.impulse_t - u_t / w[:, None]
    defect = np.zeros(CONTACTS)
    for c in range(CONTACTS):
        target = _nearest_of_cone(trial_n[c], trial_t[c], problem.mu[c])
        now = np.array([state.impulse_n[c], *state.impulse_t[c]])
        defect[c] = ((now - target) ** 2).sum()
    size = math.sqrt((state.impulse_n**2).sum() + (state.impulse_t**2).sum())
    for floor in (1e-3, 50.0):
        found, worst, violation = residual(problem, state, floor, wide=wide)
        assert found == pytest.approx(math.sqrt(defect.sum()) / max(size, floor), rel=1e-9)
        assert worst == pytest.approx(math.sqrt(defect.max()) / max(size, floor), rel=1e-9)
        assert violation == pytest.approx(max(0.0, -u_n.min()), abs=1e-13)


def _nearest_of_cone(n, t, mu):
    size = np.linalg.norm(t)
    if n >= 0 and size <= mu * n:
        return np.array([n, *t])
    edge = np.array([1.0, *(mu * t / size)]) / math.hypot(1, mu)
    return max(0.0, float(edge @ np.array([n, *t]))) * edge


@pytest.mark.parametrize(("dimension", "coupled", "softness"), CASES)
def test_the_residual_has_no_units(dimension, coupled, softness):
    problem, state = _random_problem(dimension, coupled=coupled, softness=softness)
    for _ in range(2):
        sweep(problem, state)
    length, mass, time = 3.3e-3, 7.7e4, 0.021
    speed = length / time
    scaled = problem._replace(
        length=problem.length * length,
        offset_n=problem.offset_n * speed,
        offset_t=problem.offset_t * speed,
        softness=problem.softness / mass,
        dilation_weight=problem.dilation_weight / (mass * length**2),
        weight=problem.weight / (mass * length**2),
    )
    motion = state.motion * speed
    heavy = 3 if dimension == 2 else 6
    motion[:, heavy] = state.motion[:, heavy] / mass
    other = State(
        motion,
        state.rate / time,
        state.impulse_n * mass * speed,
        state.impulse_t * mass * speed,
    )
    one = residual(problem, state, 0.7)
    two = residual(scaled, other, 0.7 * mass * speed)
    assert two[:2] == pytest.approx(one[:2], rel=1e-12)
    assert two[2] == pytest.approx(one[2] * speed, rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_open_frictionless_contact_is_no_defect(dimension):
    """Parting without slip, µ = 0: the tip of the degenerate cone."""
    problem, state = _random_problem(dimension, coupled=False)
    quiet = problem._replace(
        mu=np.zeros(CONTACTS),
        offset_n=np.full(CONTACTS, 0.3),
        offset_t=np.zeros_like(problem.offset_t),
    )
    state.motion[:, : -1 if dimension == 2 else 6] = 0.0
    assert residual(quiet, state, 1.0)[:2] == (0.0, 0.0)


@pytest.mark.parametrize(("dimension", "coupled", "softness"), CASES)
@pytest.mark.parametrize(("wide", "chunks"), [(False, 1), (False, 4), (True, 1), (True, 3)])
def test_sweeps_keep_velocities_and_impulses_together(dimension, coupled, softness, wide, chunks):
    """v = v_free + M⁻¹ H P after any sweep, however late the cell hears of it."""
    problem, state = _random_problem(dimension, coupled=coupled, softness=softness)
    free = _copy(state)
    for _ in range(3):
        sweep(problem, state, wide=wide, chunks=chunks)
    afresh = State(free.motion, free.rate, state.impulse_n, state.impulse_t)
    everything = np.arange(CONTACTS)
    apply_listed(problem, afresh, everything, (0, CONTACTS), afresh.rate, (0.0,) * dimension)
    assert afresh.motion == pytest.approx(state.motion, abs=1e-13)
    assert afresh.rate == pytest.approx(state.rate, abs=1e-14)
    assert np.abs(state.rate).max() > 1e-3


@pytest.mark.parametrize(("dimension", "coupled", "softness"), CASES)
def test_eight_at_once_do_what_one_at_a_time_does(dimension, coupled, softness):
    problem, one = _random_problem(dimension, coupled=coupled, softness=softness)
    two = _copy(one)
    for _ in range(5):
        sweep(problem, one)
        sweep(problem, two, wide=True)
    for first, second in zip(one, two, strict=True):
        assert second == pytest.approx(first, rel=1e-11, abs=1e-13)
    assert (one.impulse_n > 0).any()


@pytest.mark.parametrize("chunks", [1, 3])
@pytest.mark.parametrize("cap", [0.0, 0.5, 0.9])
def test_momentum_and_chunks_do_not_move_the_solution(cap, chunks):
    problem, start = _random_problem(2, coupled=True, softness=0.2)
    one, _ = _solved(problem, start)
    two, _ = _solved(problem, start, cap, chunks=chunks)
    assert two.motion == pytest.approx(one.motion, abs=1e-10)
    assert two.impulse_n == pytest.approx(one.impulse_n, abs=1e-9)
