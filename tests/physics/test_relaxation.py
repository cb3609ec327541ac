"""Soft states made hard: known stiffness, balance, pressure, the shape of the cell kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from granufab.errors import InvalidPacking, MissingData, NotConverged
from granufab.fabric.stress import stress_tensor
from granufab.packing import Cell, Packing
from granufab.simulate import Isotropic, Simulation, Solver, compress, random_sample, relax
from granufab.simulate.capture import capture_packing
from granufab.simulate.settings import Material, Sizes

SOFT, PRESSURE, FRICTION = 400.0, 2.5, 0.3


def soft_state(dimension: int, count: int) -> Packing:
    """Grains of stiffness k/p = 400 at rest under p, as a soft-particle code leaves them."""
    start = random_sample(count, dimension=dimension, sizes=Sizes(spread=0.3), seed=3)
    hard = compress(start, friction=FRICTION, pressure=PRESSURE)
    simulation = Simulation(
        hard,
        Isotropic(pressure=PRESSURE, dimension=dimension),
        material=Material(friction=FRICTION),
        solver=Solver(tolerance=1e-6, stiffness=SOFT, time_step=0.2),
    )
    simulation.damping = 0.5
    while simulation.kinetic_ratio() > 1e-10 or simulation.time == hard.time:
        simulation.advance(20)
    return capture_packing(simulation)


@pytest.fixture(scope="module", params=[(2, 120), (3, 150)], ids=["disks", "spheres"])
def soft(request: pytest.FixtureRequest) -> Packing:
    return soft_state(*request.param)


def imbalance(packing: Packing) -> float:
    """Largest net force on a grain over the mean contact force."""
    contacts = packing.contacts
    assert contacts is not None
    assert contacts.force is not None
    net = np.zeros_like(packing.grains.position)
    np.add.at(net, contacts.pair[:, 1], contacts.force)
    np.add.at(net, contacts.pair[:, 0], -contacts.force)
    size = np.linalg.norm(contacts.force, axis=1)
    return float(np.linalg.norm(net, axis=1).max() / size[size > 0].mean())


def test_the_stiffness_is_found_from_forces_and_overlaps(soft: Packing) -> None:
    relaxed = relax(soft, friction=FRICTION)
    assert relaxed.pressure == pytest.approx(PRESSURE, rel=1e-3)
    assert relaxed.stiffness[0] == pytest.approx(SOFT, rel=0.01)
    assert np.allclose(np.diff(np.log(relaxed.stiffness[:-1])), np.log(4))
    assert relaxed.stiffness[-1] == 1.6e5


@pytest.mark.parametrize("forces", [True, False])
def test_a_relaxed_state_is_hard_balanced_and_under_its_pressure(
    soft: Packing, forces: bool
) -> None:
    given = soft if forces else replace(soft, contacts=None)
    relaxed = relax(given, friction=FRICTION, pressure=None if forces else PRESSURE)
    packing = relaxed.packing
    assert relaxed.overlap[0] > 1e-3
    assert relaxed.overlap[1] < 2e-4
    assert np.trace(stress_tensor(packing)) / packing.dimension == pytest.approx(PRESSURE, rel=2e-3)
    assert imbalance(packing) < 0.02
    assert soft.cell is not None
    assert packing.cell is not None
    change = packing.cell.matrix @ np.linalg.inv(soft.cell.matrix)
    assert np.allclose(change, change[0, 0] * np.eye(packing.dimension), atol=1e-12)
    assert change[0, 0] > 1  # overlaps open: the packing dilates
    assert (packing.grains.number == soft.grains.number).all()
    moved = packing.grains.position - soft.grains.position @ change.T
    typical = np.linalg.norm(moved - moved.mean(axis=0), axis=1)
    assert np.median(typical) < 0.1 * 2 * soft.grains.radius.mean()
    for name in ("z_backbone", "phi"):
        assert relaxed.after[name] < relaxed.before[name]
    assert relaxed.after["z_backbone"] > packing.dimension + 0.9


def test_grains_that_do_not_touch_are_compacted() -> None:
    start = random_sample(80, sizes=Sizes(spread=0.3), seed=5)
    relaxed = relax(start, friction=FRICTION)
    assert relaxed.before["z"] == 0
    assert relaxed.after["phi"] > 0.76
    assert 2.9 < relaxed.after["z_backbone"] < 4.1
    assert imbalance(relaxed.packing) < 0.02


def test_what_cannot_be_relaxed_is_said_in_one_line(soft: Packing) -> None:
    with pytest.raises(MissingData, match="--cell"):
        relax(replace(soft, cell=None, contacts=None))
    with pytest.raises(MissingData, match="masses"):
        relax(replace(soft, grains=replace(soft.grains, mass=None)))
    grown = replace(soft.grains, radius=3 * soft.grains.radius)
    with pytest.raises(InvalidPacking, match=r"grains \d+ and \d+ .* allowed 0.5"):
        relax(replace(soft, grains=grown, contacts=None))


def test_a_heap_in_a_tall_box_does_not_come_to_rest_under_p(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Touching grains at the bottom of a box: the whole box would have to shrink on to them."""
    from granufab.simulate import relaxation

    dense = soft_state(2, 60)
    assert dense.cell is not None
    edge = dense.cell.matrix[0, 0]
    tall = Cell(matrix=np.diag([edge, 30 * edge]), periodic=(True, False))
    monkeypatch.setattr(relaxation, "STAGE_STEPS", 50)
    with pytest.raises(NotConverged, match=r"must fill its cell \(--cell\)"):
        relax(replace(dense, cell=tall, contacts=None), friction=FRICTION)
