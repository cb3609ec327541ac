"""Problems given as (W, q, mu): known answers, every solution of small ones, invariants."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from local_cases import enumerate_2d, random_bodies, tower
from scipy import sparse

from granufab.errors import InvalidProblem, InvalidSettings
from granufab.io import read_fclib
from granufab.local_problem import LocalProblem
from granufab.simulate import local_errors, solve_local
from granufab.simulate.local_newton import newton_steps
from granufab.simulate.local_residual import ScaledProblem
from granufab.simulate.local_splitting import splitting_steps

FOLDER = os.environ.get("GRANUFAB_FCLIB", "")
PROBLEMS = ("confeti_107", "disks2d_11", "disks2d_376", "granflow2d_667", "kaplas_570")
PROBLEMS += ("nespheres_9", "siconos_spheres_356", "boxesstack1_52")


def _worst(problem: LocalProblem, impulse: np.ndarray) -> float:
    return max(local_errors(problem, impulse).values())


@pytest.mark.parametrize(("slope", "sticks"), [(0.6, True), (0.75, False)])
def test_sphere_on_a_slope_rolls_until_tan_exceeds_seven_halves_mu(
    slope: float, sticks: bool
) -> None:
    mu, m, h_g = 0.2, 2.0, 0.01
    assert (math.tan(slope) <= 3.5 * mu) is sticks
    W = np.diag([1.0, 3.5, 3.5]) / m
    q = h_g * np.array([-math.cos(slope), math.sin(slope), 0.0])
    found = solve_local(W, q, [mu], dimension=3)
    push = m * h_g * math.cos(slope)
    friction = m * h_g * math.sin(slope) / 3.5 if sticks else mu * push
    assert found.converged
    assert found.impulse == pytest.approx([push, -friction, 0.0], rel=1e-10, abs=1e-15)
    assert found.velocity[1] == pytest.approx(q[1] - 3.5 * friction / m, abs=1e-15)


def test_every_solution_of_small_plane_problems_is_known() -> None:
    rng = np.random.default_rng(12)
    several = 0
    for trial in range(40):
        contacts = 2 + trial % 3
        W, q = random_bodies(rng, contacts, 2, 2 * contacts + 2)
        mu = rng.uniform(0.0, 1.2, contacts)
        found = solve_local(W, q, mu, dimension=2)
        assert found.converged, trial
        known = enumerate_2d(W, q, mu)
        several += len(known) > 1
        assert min(np.abs(found.velocity - u).max() for u in known) < 1e-8 * np.abs(q).max()
    assert several < 20  # or agreeing with one of them would say little


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("share", [0.4, 1.5])
def test_random_bodies_coupled_and_rank_deficient(dimension: int, share: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(6):
        contacts = int(rng.integers(10, 40))
        W, q = random_bodies(rng, contacts, dimension, int(share * dimension * contacts))
        problem = LocalProblem(W=W, q=q, mu=rng.uniform(0, 1, contacts), dimension=dimension)
        found = solve_local(problem.W, q, problem.mu, dimension=dimension)
        assert found.converged
        assert _worst(problem, found.impulse) < 1e-8
        assert found.impulse @ found.velocity <= 1e-8 * np.abs(found.impulse * q).sum()


def test_a_tower_of_cubes_carries_its_weight() -> None:
    """12 cubes, 48 contacts, 144 rows of rank 72: u = 0, each joint carries what is above."""
    W, q = tower(12)
    assert np.linalg.matrix_rank(W) == 72
    found = solve_local(W, q, np.full(48, 0.5), dimension=3)
    assert found.converged
    assert np.abs(found.velocity).max() < 1e-9
    carried = found.impulse[::3].reshape(12, 4).sum(axis=1)
    assert carried == pytest.approx(np.arange(12, 0, -1), rel=1e-8)


@pytest.mark.parametrize(("stage", "tolerance"), [(newton_steps, 1e-12), (splitting_steps, 1e-8)])
def test_each_stage_alone_reaches_the_answer(stage, tolerance: float) -> None:
    """Sliding and sticking cubes on a floor that drags the lowest one sideways."""
    W, q = tower(4)
    q[1:12:3] += 2.0
    problem = LocalProblem(W=W, q=q, mu=np.full(16, 0.3), dimension=3)
    scaled = ScaledProblem.of(problem)
    start = np.zeros_like(scaled.q)
    if stage is newton_steps:
        start, _, _ = splitting_steps(scaled, start, 1e-3, 500)
    impulse, residual, steps = stage(scaled, start, tolerance, 3000)
    assert residual <= tolerance
    assert 0 < steps < 3000
    assert scaled.residual(start) > 100 * tolerance
    assert _worst(problem, scaled.full(impulse)) < 20 * tolerance
    slip = (problem.W @ scaled.full(impulse) + q)[1:12:3]
    assert (slip > 0.1).all()  # the floor slides under the lowest cube


def test_units_and_numbering_do_not_matter() -> None:
    rng = np.random.default_rng(8)
    W, q = random_bodies(rng, 20, 3, 70)
    mu = rng.uniform(0.1, 0.6, 20)
    plain = solve_local(W, q, mu, dimension=3)
    grams = solve_local(W * 1e3, q * 1e-6, mu, dimension=3)
    assert grams.impulse == pytest.approx(plain.impulse * 1e-9, rel=1e-6, abs=1e-18)
    order = rng.permutation(20)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    turned = solve_local(W[np.ix_(rows, rows)], q[rows], mu[order], dimension=3)
    assert turned.velocity == pytest.approx(plain.velocity[rows], abs=1e-7)


def test_sparse_dense_and_a_start_give_the_same() -> None:
    rng = np.random.default_rng(4)
    W, q = random_bodies(rng, 12, 2, 30)
    mu = np.full(12, 0.4)
    dense = solve_local(W, q, mu, dimension=2)
    for kind in (sparse.csr_array, sparse.csc_matrix, sparse.bsr_array):
        assert (solve_local(kind(W), q, mu, dimension=2).impulse == dense.impulse).all()
    again = solve_local(W, q, mu, dimension=2, start=dense.impulse)
    assert again.method == "start"
    assert again.iterations == 0
    assert again.impulse == pytest.approx(dense.impulse, rel=1e-12)


def test_separating_contacts_and_no_contacts_need_no_impulse() -> None:
    away = solve_local(np.eye(4), [1.0, 3.0, 0.0, -2.0], [0.3, 0.3], dimension=2)
    assert not away.impulse.any()
    assert away.converged
    assert away.method == "none needed"
    assert solve_local(np.empty((0, 0)), [], [], dimension=3).converged


def test_light_and_heavy_bodies_together() -> None:
    W = np.diag([1e-9, 1e-9, 1e9, 1e9])
    found = solve_local(W, [-1.0, 0.5, -1.0, 1.0], [0.3, 0.3], dimension=2)
    assert found.converged
    assert found.impulse == pytest.approx([1e9, -3e8, 1e-9, -3e-10], rel=1e-12)


def test_contacts_between_fixed_bodies() -> None:
    W = np.diag([0.0, 0.0, 1.0, 1.0])
    found = solve_local(W, [0.5, 0.1, -1.0, 0.0], [0.3, 0.3], dimension=2)
    assert found.impulse == pytest.approx([0, 0, 1, 0])
    with pytest.raises(
        InvalidProblem, match=r"contact 0 closes at q_N = -0.5, but its W_NN is 0: "
    ):
        solve_local(W, [-0.5, 0.1, -1.0, 0.0], [0.3, 0.3], dimension=2)


def test_a_problem_without_solution_is_not_called_solved() -> None:
    """One body between two plates that approach each other: u_1 + u_2 < 0 always."""
    H = np.array([[1.0], [0.0], [-1.0], [0.0]])
    q = np.array([-1.0, 0.0, -1.0, 0.0])
    found = solve_local(H @ H.T, q, [0.3, 0.3], dimension=2, max_iterations=500)
    assert not found.converged
    assert found.residual > 0.1
    assert found.iterations <= 500


@pytest.mark.filterwarnings("error")
def test_an_indefinite_matrix_ends_quietly() -> None:
    rng = np.random.default_rng(0)
    W = rng.standard_normal((30, 30))
    W = W + W.T + np.diag(2 * np.abs(np.diag(W)) + 1)
    assert np.linalg.eigvalsh(W)[0] < -1
    found = solve_local(W, rng.standard_normal(30), np.full(15, 0.5), dimension=2)
    problem = LocalProblem(W=W, q=found.velocity - W @ found.impulse, mu=[0.5] * 15, dimension=2)
    assert np.isfinite(found.residual)
    assert found.converged is (_worst(problem, found.impulse) < 1e-8)


def test_local_errors_sees_each_violation() -> None:
    problem = LocalProblem(W=np.eye(2), q=[-1.0, 2.0], mu=[0.5], dimension=2)
    right = {"natural_map", "penetration", "tension", "complementarity", "cone", "dissipation"}
    assert set(local_errors(problem, np.array([1.0, -0.5]))) == right
    assert _worst(problem, np.array([1.0, -0.5])) < 1e-15
    cases = {
        "penetration": [0.5, -0.25],
        "complementarity": [2.0, -1.0],
        "cone": [1.0, -2.0],
        "dissipation": [1.0, 0.5],
    }
    for name, impulse in cases.items():
        errors = local_errors(problem, np.array(impulse))
        assert errors[name] > 0.1, name
        assert errors["natural_map"] > 0.1, name
    assert local_errors(problem, np.array([-1.0, 0.0]))["tension"] == 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dimension": 4}, "dimension is 4, allowed: 2 or 3"),
        ({"mu": [0.3, -0.1]}, "mu of contact 1 is -0.1, must be >= 0"),
        ({"q": [1.0, 2.0, 3.0]}, "q has 3 entries, expected 4: 2 for each of the 2"),
        ({"q": [1.0, np.nan, 3.0, 0.0]}, r"q\[1\] is nan"),
        ({"W": np.eye(3)}, r"W has shape \(3, 3\), expected \(4, 4\)"),
        ({"W": np.triu(np.ones((4, 4)))}, r"W is not symmetric: entries \(0, 1\) and \(1, 0\)"),
        ({"W": -np.eye(4)}, "must be positive semidefinite"),
        ({"W": "text"}, "W is not a matrix of numbers"),
        (
            {"W": np.eye(4) * 1e-320},
            "the largest entry of W is 1e-320, allowed: 1e-100 to 1e[+]100",
        ),
        ({"q": [-1e308, 0, -1, 0]}, r"the largest entry of q is 1e\+308"),
        ({"mu": [0.3, 1e300]}, r"the largest entry of mu is 1e\+300"),
        ({"start": [0.0]}, r"start has shape \(1,\), expected \(4,\)"),
    ],
)
def test_bad_problems_are_refused_in_one_line(change: dict, message: str) -> None:
    given = {"W": np.eye(4), "q": [-1.0, 0, -1, 0], "mu": [0.3, 0.3], "dimension": 2} | change
    with pytest.raises(InvalidProblem, match=message) as caught:
        solve_local(given.pop("W"), given.pop("q"), given.pop("mu"), **given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [{"tolerance": 0.0}, {"max_iterations": 0}])
def test_bad_settings_are_refused(change: dict) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(change))):
        solve_local(np.eye(2), [1.0, 0.0], [0.3], dimension=2, **change)


@pytest.mark.skipif(not FOLDER, reason="GRANUFAB_FCLIB names no folder of problems")
@pytest.mark.parametrize("name", PROBLEMS)
def test_problems_of_other_codes(name: str) -> None:
    path = Path(FOLDER) / f"{name}.npz"
    problem = read_fclib(path)
    found = solve_local(problem.W, problem.q, problem.mu, dimension=problem.dimension)
    assert found.converged
    assert _worst(problem, found.impulse) < 1e-8
    with np.load(path, allow_pickle=False) as file:
        assert np.abs(found.velocity - file["u"]).max() < 1e-8 * np.abs(problem.q).max()
