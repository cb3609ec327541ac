"""Spheres in a box of six walls: compaction and triaxial loading."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.fabric import measure
from granufab.packing import Packing
from granufab.simulate import Biaxial, Material, Simulation, compress, random_sample

RATE = 2e-3


@pytest.fixture(scope="module")
def boxed() -> Packing:
    """120 spheres at rest under p = 1 between six smooth walls."""
    return compress(
        random_sample(120, dimension=3, seed=2, boundary="walls"), friction=0.3, diagonals=True
    )


def test_the_walls_carry_the_pressure(boxed):
    cell, walls = boxed.cell, boxed.wall_contacts
    assert walls is not None
    edges = np.diag(cell.matrix)
    push = np.einsum("ck,ck->c", walls.force, walls.normal)
    for axis in range(3):
        area = cell.volume / edges[axis]
        for side in (0, 1):
            total = push[walls.wall == 2 * axis + side].sum()
            assert total / area == pytest.approx(1.0, abs=0.02)


def test_every_grain_is_in_balance(boxed):
    net = np.zeros((boxed.grains.count, 3))
    contacts, walls = boxed.contacts, boxed.wall_contacts
    np.add.at(net, contacts.pair[:, 1], contacts.force)
    np.add.at(net, contacts.pair[:, 0], -contacts.force)
    np.add.at(net, walls.grain, -walls.force)
    largest = np.linalg.norm(contacts.force, axis=1).max()
    assert np.abs(net).max() < 1e-3 * largest


def test_triaxial_compression_between_walls_holds_the_lateral_stress(boxed):
    loading = Biaxial(axial_rate=RATE, axis=2, dimension=3)
    simulation = Simulation(boxed, loading, material=Material(friction=0.4))
    stress = np.empty((200, 3, 3))
    for k in range(200):
        simulation.step()
        stress[k] = simulation.stress
    for axis in (0, 1):
        assert stress[:, axis, axis].mean() == pytest.approx(1.0, abs=5e-3)
    assert stress[-50:, 2, 2].mean() > 1.15
    low = simulation.origin + simulation.radius[:, None]
    high = simulation.origin + np.diag(simulation.matrix) - simulation.radius[:, None]
    outside = np.maximum(low - simulation.position, simulation.position - high).max()
    assert outside < 2e-3 * simulation.scales.diameter


def test_a_walled_state_is_measured(boxed):
    values = measure(boxed, direction=np.array([0.0, 0.0, 1.0]))
    assert 3.0 < values["z_backbone"] < 6.0  # wall contacts hold grains, z does not count them
    assert values["p"] == pytest.approx(1.0, abs=0.02)
    assert 0.0 <= values["b_g"] <= 1.0
