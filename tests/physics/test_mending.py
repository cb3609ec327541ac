"""A group of contacts solved together with everything else held."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.kernels.impulses import apply_impulses
from granufab.kernels.problem import State
from granufab.packing import Packing
from granufab.simulate import (
    Biaxial,
    ConstantMean,
    Loading,
    Material,
    Simulation,
    Solver,
    compress,
    random_sample,
)
from granufab.simulate.mending import group_of, mend

LOADINGS = [
    ConstantMean(rate=1e-3),
    Biaxial(axial_rate=1e-3),
    ConstantMean(rate=1e-3, dimension=3),
    Biaxial(axial_rate=1e-3, dimension=3),
]
IDS = ["dilation", "biaxial", "mean-3d", "triaxial"]


@pytest.fixture(scope="module")
def samples() -> dict[int, Packing]:
    return {
        2: compress(random_sample(60, seed=3), friction=0.3),
        3: compress(random_sample(40, dimension=3, seed=3), friction=0.3),
    }


def _solved(packing: Packing, loading: Loading) -> Simulation:
    solver = Solver(stiffness=1e5, tolerance=1e-11, max_sweeps=100_000)
    simulation = Simulation(packing, loading, material=Material(friction=0.4), solver=solver)
    for _ in range(2):
        assert simulation.step().converged
    return simulation


def _copy(state: State) -> State:
    return State(*(array.copy() for array in state))


@pytest.mark.parametrize("loading", LOADINGS, ids=IDS)
def test_a_group_that_was_pushed_away_finds_back(samples, loading: Loading) -> None:
    simulation = _solved(samples[len(loading.rate)], loading)
    problem, solution = simulation.problem, _copy(simulation.state)
    state, size = _copy(solution), np.abs(solution.impulse_n).max()
    pushed = np.argsort(solution.impulse_n)[-4:]
    push_n, push_t = np.zeros_like(solution.impulse_n), np.zeros_like(solution.impulse_t)
    push_n[pushed] = 1e-3 * solution.impulse_n[pushed]
    state.impulse_n[:] += push_n
    turn = State(state.motion, state.rate, push_n, push_t)
    apply_impulses(problem, turn, np.arange(len(push_n)), simulation.like)
    state.rate[:] = solution.rate  # the cell is held: it stays as the solution has it
    assert mend(problem, state, np.abs(push_n))
    assert np.abs(state.impulse_n - solution.impulse_n).max() < 1e-6 * size
    assert np.abs(state.impulse_t - solution.impulse_t).max() < 1e-6 * size


def test_velocities_follow_the_impulses(samples) -> None:
    simulation = _solved(samples[2], Biaxial(axial_rate=1e-3))
    problem, before, state = simulation.problem, _copy(simulation.state), _copy(simulation.state)
    change = np.where(np.arange(len(problem.mu)) == 7, 1.0, 0.0)
    problem.offset_n[group_of(problem, change)] -= 1e-3  # another problem than the solved one
    assert mend(problem, state, change)
    found_n, found_t = state.impulse_n - before.impulse_n, state.impulse_t - before.impulse_t
    assert np.abs(found_n).max() > 0
    moved = State(before.motion, before.rate, found_n, found_t)
    apply_impulses(problem, moved, np.arange(len(problem.length)), simulation.like)
    assert state.motion == pytest.approx(moved.motion, abs=1e-12)
    assert state.rate == pytest.approx(moved.rate, abs=1e-12)


def test_contacts_elsewhere_are_left_alone() -> None:
    simulation = _solved(compress(random_sample(400, seed=5)), ConstantMean(rate=1e-3))
    problem, state = simulation.problem, _copy(simulation.state)
    change = np.where(np.arange(len(problem.mu)) == 7, 1.0, 0.0)
    chosen = group_of(problem, change)
    others = np.setdiff1d(np.arange(len(problem.mu)), chosen)
    assert 7 in chosen
    assert len(others) > len(chosen)
    problem.offset_n[chosen] -= 1e-3
    before = _copy(state)
    assert mend(problem, state, change)
    assert (state.impulse_n[others] == before.impulse_n[others]).all()
    assert (state.impulse_n[chosen] != before.impulse_n[chosen]).any()


def test_the_group_grows_with_each_attempt(samples) -> None:
    simulation = _solved(samples[2], ConstantMean(rate=1e-3))
    change = 0.5 ** np.arange(len(simulation.problem.mu))
    sizes = [len(group_of(simulation.problem, change, before)) for before in range(6)]
    assert sizes == sorted(sizes)
    assert sizes[-1] > sizes[0]
