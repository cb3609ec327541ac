"""What a simulation refuses, and layouts that must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granufab.errors import InvalidSettings
from granufab.simulate import ConstantMean, Isotropic, Simulation, compress, random_sample


@pytest.fixture(scope="module")
def packing():
    return compress(random_sample(40, seed=1), friction=0.3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"loading": Isotropic(dimension=3)}, "loading is for 3 dimensions, the packing has 2"),
        ({"gravity": np.zeros(3)}, r"gravity has shape \(3,\), expected \(2,\)"),
        ({"step": 0.0}, "step is 0.0, must be > 0"),
        ({"step": -1e-3}, "step is -0.001, must be > 0"),
    ],
)
def test_a_simulation_refuses(packing, given, words):
    loading = given.pop("loading", ConstantMean(rate=0.01))
    with pytest.raises(InvalidSettings, match=words):
        Simulation(packing, loading, **given)


def test_the_layout_of_a_loading_does_not_matter(packing):
    free = np.zeros((2, 2), bool)
    free[0, 1] = True
    rates = []
    for array in (free, np.asfortranarray(free)):
        loading = replace(ConstantMean(rate=0.0), free=array, dilation=False)
        simulation = Simulation(packing, loading)
        simulation.step()
        rates.append(simulation.rate)
    assert rates[0][0, 1] != 0
    assert np.array_equal(rates[0], rates[1])


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_frictionless_grains_come_to_an_end(count, dimension):
    """Too few to jam, whatever that leaves them at: no error from deep inside."""
    made = compress(random_sample(count, dimension=dimension, seed=1), friction=0.0)
    assert np.isfinite(made.grains.position).all()
