"""A system restored from a snapshot goes on with the same bits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from granufab.errors import CorruptFile
from granufab.packing import Packing
from granufab.simulate import Isotropic, SimpleShear, Simulation, Solver, random_sample
from granufab.simulate.loading import Loading
from granufab.simulate.settings import Material, Sizes
from granufab.simulate.snapshot import restore, snapshot


def sample(dimension: int = 2, count: int = 80, boundary: str = "periodic") -> Packing:
    """A dilute sample with some velocities, so that much happens in a few hundred steps."""
    packing = random_sample(
        count, dimension=dimension, sizes=Sizes(spread=0.3), boundary=boundary, seed=4
    )
    velocity = np.random.default_rng(1).normal(0, 0.3, packing.grains.position.shape)
    return replace(packing, grains=replace(packing.grains, velocity=velocity))


def system(packing: Packing, loading: Loading, **settings: Any) -> Simulation:
    simulation = Simulation(
        packing,
        loading,
        material=Material(friction=0.4),
        solver=Solver(time_step=0.1, **settings),
    )
    simulation.rate_cap = 0.05
    return simulation


def go(simulation: Simulation, steps: int) -> None:
    """So many steps: a call also returns after some tenths of a second."""
    while steps:
        steps -= len(simulation.advance(steps))


def same(one: Simulation, other: Simulation) -> bool:
    first, second = snapshot(one), snapshot(other)
    unequal = [
        name for name in first if not np.array_equal(first[name], second[name], equal_nan=True)
    ]
    assert not unequal
    return True


CASES = {
    "disks": lambda: system(sample(), Isotropic()),
    "spheres": lambda: system(sample(3, 60), Isotropic(dimension=3)),
    "walls": lambda: system(sample(boundary="walls"), Isotropic()),
    "sheared": lambda: system(sample(), SimpleShear(rate=0.05)),
    "rigid": lambda: system(sample(), Isotropic(), stiffness=np.inf, max_sweeps=300),
    "chunks": lambda: system(sample(count=6200), Isotropic()),
}


@pytest.mark.parametrize("name", CASES)
def test_a_restored_system_goes_on_with_the_same_bits(name: str) -> None:
    few = 5 if name == "chunks" else 20
    whole = CASES[name]()
    for _ in range(6):
        go(whole, few)
        again = CASES[name]()
        restore(again, snapshot(whole))
        go(whole, few)
        go(again, few)
        assert same(whole, again)
    assert whole.searches > 2


def test_a_snapshot_is_a_copy() -> None:
    simulation = CASES["disks"]()
    go(simulation, 10)
    held = snapshot(simulation)
    before = {name: value.copy() for name, value in held.items()}
    go(simulation, 10)
    assert all(np.array_equal(held[name], before[name], equal_nan=True) for name in held)


def test_a_snapshot_of_another_sample_is_refused_and_changes_nothing() -> None:
    held = snapshot(CASES["disks"]())
    other = CASES["spheres"]()
    before = snapshot(other)
    with pytest.raises(CorruptFile, match="position has shape"):
        restore(other, held)
    with pytest.raises(CorruptFile, match="pair_gap is missing"):
        restore(CASES["disks"](), {name: held[name] for name in held if name != "pair_gap"})
    with pytest.raises(CorruptFile, match="different lengths"):
        restore(CASES["disks"](), {**held, "pair_gap": held["pair_gap"][:-1]})
    after = snapshot(other)
    assert all(np.array_equal(after[name], before[name], equal_nan=True) for name in after)


def test_a_snapshot_does_not_tell_in_how_many_calls_the_steps_were_made() -> None:
    together, apart = CASES["sheared"](), CASES["sheared"]()
    go(together, 12)
    for _ in range(12):
        apart.advance(1)
    assert same(together, apart)
