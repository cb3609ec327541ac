from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import jittered

from granufab.errors import InvalidPacking, MissingData
from granufab.fabric import homogeneity, local_strain
from granufab.packing import Cell, Grains


def deform(packing, gradient, remap=None, scatter=None):
    """The state after a homogeneous deformation, its cell described by other lattice vectors."""
    grow = np.eye(packing.dimension) + gradient
    position = packing.grains.position @ grow.T
    if scatter is not None:
        position = position + scatter
    matrix = grow @ packing.cell.matrix @ (np.eye(packing.dimension) if remap is None else remap)
    grains = Grains(position=position, radius=packing.grains.radius)
    return replace(packing, grains=grains, cell=Cell(matrix=matrix))


def travelled(packing, generator):
    """The same state with grains shifted at random by lattice vectors."""
    turns = generator.integers(-3, 4, packing.grains.position.shape)
    position = packing.grains.position + turns @ packing.cell.matrix.T
    return replace(packing, grains=Grains(position=position, radius=packing.grains.radius))


@pytest.mark.parametrize("remap", [None, np.array([[1.0, -1.0], [0.0, 1.0]])])
@pytest.mark.parametrize("wrapped_between", [False, True])
def test_homogeneous_strain_comes_back_in_every_box(remap, wrapped_between):
    generator = np.random.default_rng(1)
    tilted = np.array([[20.0, 9.0], [0.0, 20.0]])
    before = travelled(jittered(generator, 400, matrix=tilted), generator)
    gradient = np.array([[0.01, 0.04], [0.0, -0.03]])
    after = deform(before, gradient, remap)
    data = local_strain(before, travelled(after, generator) if wrapped_between else after)
    expected = -0.5 * (gradient + gradient.T)
    assert data.sizes["box"] == 16
    np.testing.assert_allclose(data.strain, np.tile(expected, (16, 1, 1)), atol=1e-12)
    values = np.linalg.eigvalsh(expected)
    np.testing.assert_allclose(data.eps_q, values[1] - values[0], atol=1e-12)
    result = homogeneity(data)
    assert result["relative_variance"] < 1e-20
    assert result["localised"] == 0.0


def test_scatter_of_the_grains_explains_a_homogeneous_sample():
    generator = np.random.default_rng(2)
    excess = []
    for _ in range(20):
        before = jittered(generator, 900)
        scatter = 0.05 * generator.normal(size=before.grains.position.shape)
        result = homogeneity((before, deform(before, np.diag([0.05, -0.05]), scatter=scatter)))
        assert result["expected"] > 0
        excess.append(result["relative_variance"] / result["expected"])
        assert result["localised"] == 0.0
    assert np.mean(excess) == pytest.approx(1.0, abs=0.15)


def test_a_shear_band_is_seen():
    generator = np.random.default_rng(3)
    before = jittered(generator, 900)
    y = before.grains.position[:, 1] / 30
    # All of the shear between 0.4 and 0.6 of the height: relative variance 1/0.2 − 1 = 4.
    slide = np.clip((y - 0.4) / 0.2, 0, 1) * 3.0
    position = before.grains.position + np.column_stack([slide, np.zeros(900)])
    after = replace(
        before,
        grains=Grains(position=position, radius=before.grains.radius),
        cell=Cell(matrix=before.cell.matrix @ np.array([[1.0, 0.1], [0.0, 1.0]])),
    )
    data = local_strain(before, after, cells=5)
    assert float(data.eps_q.mean()) == pytest.approx(0.1, rel=0.15)
    result = homogeneity(data)
    assert result["relative_variance"] == pytest.approx(4.0, rel=0.25)
    assert result["localised"] == 1.0


def test_refusals():
    state = jittered(np.random.default_rng(4), 400)
    with pytest.raises(MissingData, match="no deviatoric strain"):
        homogeneity((state, state))
    fewer = jittered(np.random.default_rng(4), 100)
    with pytest.raises(InvalidPacking, match="different grains"):
        local_strain(state, fewer)
    with pytest.raises(MissingData, match="use fewer cells"):
        local_strain(state, state, cells=20)
