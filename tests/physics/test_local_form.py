"""A step of the engine exported as (W, q, mu): the same law, the same velocities."""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics_cases import fixed_cell, grains, on_floor

from granufab.packing import Packing
from granufab.simulate import (
    Biaxial,
    ConstantMean,
    Loading,
    Material,
    Simulation,
    Solver,
    compress,
    contact_frames,
    local_errors,
    local_form,
    local_state,
    random_sample,
    solve_local,
)


@pytest.fixture(scope="module")
def samples() -> dict[int, Packing]:
    return {
        2: compress(random_sample(40, seed=3), friction=0.3),
        3: compress(random_sample(30, dimension=3, seed=3), friction=0.3),
    }


def _stepped(packing: Packing, loading: Loading, stiffness: float) -> Simulation:
    solver = Solver(stiffness=stiffness, tolerance=1e-10, max_sweeps=100_000)
    simulation = Simulation(packing, loading, material=Material(friction=0.4), solver=solver)
    for _ in range(2):
        assert simulation.step().converged
    return simulation


LOADINGS = [
    ConstantMean(rate=1e-3),
    Biaxial(axial_rate=1e-3),
    ConstantMean(rate=1e-3, dimension=3),
    Biaxial(axial_rate=1e-3, dimension=3),
]


@pytest.mark.parametrize("loading", LOADINGS, ids=["dilation", "biaxial", "mean-3d", "triaxial"])
def test_others_find_the_velocities_of_the_engine(samples, loading: Loading) -> None:
    simulation = _stepped(samples[len(loading.rate)], loading, 1e5)
    problem = local_form(simulation.problem, simulation.state)
    engine = local_state(simulation.problem, simulation.state)
    speed = np.abs(problem.q).max()
    assert problem.W @ engine.impulse + problem.q == pytest.approx(
        engine.velocity, abs=1e-12 * speed
    )
    assert max(local_errors(problem, engine.impulse).values()) < 1e-8
    found = solve_local(problem.W, problem.q, problem.mu, dimension=problem.dimension)
    assert found.converged
    assert np.abs(found.velocity - engine.velocity).max() < 1e-6 * speed
    coupled = problem.W.toarray().reshape(problem.contact_count, problem.dimension, -1)
    blocks = [
        coupled[c, 0, problem.dimension * c + 1 : problem.dimension * (c + 1)]
        for c in range(problem.contact_count)
    ]
    assert bool(np.abs(blocks).max() > 1e-6) is simulation.coupled  # W_nt ≠ 0 in a free shape


def test_the_rigid_step_solves_the_exported_law(samples) -> None:
    simulation = _stepped(samples[2], ConstantMean(rate=1e-3), math.inf)
    problem = local_form(simulation.problem, simulation.state, title="rigid")
    engine = local_state(simulation.problem, simulation.state)
    assert problem.title == "rigid"
    assert max(local_errors(problem, engine.impulse).values()) < 1e-8


@pytest.mark.parametrize("seed", [3, 8])
def test_a_rigid_step_is_solved_to_round_off(seed: int) -> None:
    """Sweeps stall there, and Newton steps with a fixed small regularisation fail."""
    packing = compress(random_sample(60, seed=seed), friction=0.3)
    solver = Solver(stiffness=math.inf, tolerance=1e-5, max_sweeps=2000)
    simulation = Simulation(
        packing, ConstantMean(rate=1e-3), material=Material(friction=0.4), solver=solver
    )
    for _ in range(5):
        simulation.step()
    problem = local_form(simulation.problem, simulation.state)
    found = solve_local(problem.W, problem.q, problem.mu, dimension=2, tolerance=1e-12)
    assert found.converged
    assert found.residual <= 1e-12


def test_a_ball_on_a_floor_in_numbers() -> None:
    """One sphere of mass 2 at rest: W = diag(1, 7/2, 7/2)/2, q = h g downwards on the normal."""
    packing = on_floor(grains([[5.0, 5.0, 0.5]], mass=2.0))
    simulation = Simulation(
        packing,
        fixed_cell(3),
        material=Material(friction=0.3, wall_friction=0.3),
        solver=Solver(stiffness=math.inf),
        gravity=np.array([0.0, 0.0, -4.0]),
        step=0.01,
    )
    simulation.step()
    problem = local_form(simulation.problem, simulation.state)
    assert problem.W.toarray() == pytest.approx(np.diag([0.5, 1.75, 1.75]), abs=1e-15)
    assert problem.q == pytest.approx([-0.04, 0.0, 0.0], abs=1e-12)
    assert solve_local(problem.W, problem.q, problem.mu, dimension=3).impulse == pytest.approx(
        [0.08, 0.0, 0.0], abs=1e-12
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_contact_frames_are_right_handed(dimension: int) -> None:
    rng = np.random.default_rng(0)
    normal = rng.standard_normal((50, dimension))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frames = contact_frames(np.vstack([normal, np.eye(dimension)]))
    assert np.linalg.det(frames) == pytest.approx(1.0)
    products = frames @ frames.transpose(0, 2, 1)
    assert products == pytest.approx(np.broadcast_to(np.eye(dimension), frames.shape), abs=1e-14)
