"""The linear program of jamming and its elimination, against general solvers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csc_array, diags_array

from granufab.simulate.elimination import Cholesky, Dissection
from granufab.simulate.program import NonOverlap, least_volume


def _near_pairs(grain_count: int, dimension: int, seed: int) -> NonOverlap:
    """Unit spheres on a disturbed lattice with a few gaps of either sign; the cell dilates."""
    rng = np.random.default_rng(seed)
    side = round(grain_count ** (1 / dimension))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), -1)
    place = (grid.reshape(-1, dimension) + 0.15 * rng.random((side**dimension, dimension))) / side
    branch = place[None, :, :] - place[:, None, :]
    branch -= np.round(branch)
    distance = side * np.linalg.norm(branch, axis=2)
    first, second = np.nonzero(np.triu((distance > 0) & (distance < 1.5), 1))
    length = distance[first, second]
    return NonOverlap(
        pairs=np.stack([first, second], axis=1),
        grain_count=side**dimension,
        normal=side * branch[first, second] / length[:, None],
        length=length,
        gap=length - 1.0,
        modes=np.eye(dimension)[None],
        place=place,
    )


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_optimum_is_that_of_a_general_solver(dimension):
    pairs = _near_pairs(64, dimension, seed=5)
    unknowns, cost = dimension * pairs.grain_count, np.array([10.0])
    # Shrinkage is bounded by the pairs alone; the trust region holds each grain by 0.02 d.
    found = least_volume(pairs, cost, trust=0.02, opening=1e-3)
    change = np.hstack([pairs.on_grains.toarray(), pairs.on_strain])
    bounds = [(-0.02, 0.02)] * unknowns + [(None, None)]
    known = linprog(
        np.append(np.zeros(unknowns), cost), A_ub=-change, b_ub=pairs.gap, bounds=bounds
    )
    assert found is not None
    assert float(cost @ found.strain) == pytest.approx(known.fun, abs=1e-6)
    assert found.gap.min() > 0
    assert found.gap == pytest.approx(pairs.gap + pairs.change(found.move.ravel(), found.strain))


def test_forces_at_the_optimum_balance_and_carry_the_stress():
    pairs = _near_pairs(64, 2, seed=6)
    cost = np.array([10.0])
    found = least_volume(pairs, cost, trust=0.5, opening=1e-3)
    assert found is not None
    on_grains, on_strain = pairs.load(found.force)
    assert np.abs(on_grains).max() < 1e-6 * found.force.max()
    assert on_strain == pytest.approx(cost, rel=1e-6)
    assert (found.force * found.gap).max() < 1e-6


def test_linear_gaps_never_exceed_true_ones():
    """|branch + δ| ≥ n·(branch + δ): what the program allows has no overlaps."""
    pairs = _near_pairs(49, 2, seed=7)
    rng = np.random.default_rng(8)
    move, strain = 0.05 * rng.standard_normal((pairs.grain_count, 2)), np.array([-0.01])
    linear = pairs.gap + pairs.change(move.ravel(), strain)
    i, j = pairs.pairs.T
    normal = pairs.on_grains.toarray().reshape(pairs.count, -1, 2)[np.arange(pairs.count), j]
    branch = normal * pairs.on_strain
    after = branch + strain * branch + move[j] - move[i]
    true = np.linalg.norm(after, axis=1) - 1
    assert (true >= linear - 1e-14).all()
    small = 1e-6 * np.ravel(move)
    exact = pairs.gap + pairs.change(small, 1e-6 * strain)
    after = branch + 1e-6 * (strain * branch + move[j] - move[i])
    assert np.linalg.norm(after, axis=1) - 1 == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(("count", "dimension"), [(30, 2), (400, 2), (343, 3)])
def test_elimination_solves_stiffness_equations(count, dimension):
    pairs = _near_pairs(count, dimension, seed=9)
    rng = np.random.default_rng(10)
    spring = 10 ** rng.uniform(-3, 3, pairs.count)
    matrix = csc_array(pairs.transposed @ diags_array(spring) @ pairs.on_grains)
    matrix = csc_array(matrix + diags_array(np.full(matrix.shape[0], 0.1)))
    factor = Cholesky(pairs.dissection, matrix, dimension)
    right = rng.standard_normal((matrix.shape[0], 3))
    exact = np.linalg.solve(matrix.toarray(), right)
    assert factor.solve(right) == pytest.approx(exact, rel=1e-8, abs=1e-10)
    assert factor.solve(right[:, 0]) == pytest.approx(exact[:, 0], rel=1e-8, abs=1e-10)


def test_an_indefinite_matrix_is_refused():
    pairs = _near_pairs(30, 2, seed=11)
    spring = -np.ones(pairs.count)
    matrix = csc_array(pairs.transposed @ diags_array(spring) @ pairs.on_grains)
    with pytest.raises(np.linalg.LinAlgError, match="positive definite"):
        Cholesky(pairs.dissection, matrix, 2)


def test_every_grain_is_eliminated_once():
    pairs = _near_pairs(400, 2, seed=12)
    fronts = Dissection(
        np.random.default_rng(1).random((len(np.unique(pairs.pairs)), 2)), pairs.pairs
    ).fronts
    order = np.concatenate([front.own for front in fronts])
    assert sorted(order) == list(range(pairs.grain_count))
    later = {int(grain): place for place, grain in enumerate(order)}
    for front in fronts:
        if len(front.own):
            last = max(later[int(grain)] for grain in front.own)
            assert all(later[int(grain)] > last for grain in front.border)
