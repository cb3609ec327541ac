"""Frictionless packings at rest are isostatic: as many contacts as there are equations."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.fabric import coordination, measure, select_contacts, stress_tensor
from granufab.packing import Packing
from granufab.simulate import Sample, compress, prepare, random_sample


def _excess(packing: Packing) -> int:
    """N_c − (D N_b − D) over the force-bearing backbone of frictionless grains."""
    dimension = packing.grains.dimension
    contacts = select_contacts(packing, "force")
    numbers = coordination(contacts.pair, packing.grains.count, minimum=dimension + 1)
    held = numbers.held
    inside = held[contacts.pair[:, 0]] & held[contacts.pair[:, 1]]
    return int(inside.sum()) - dimension * (int(held.sum()) - 1)


@pytest.mark.parametrize("diagonals", [False, True])
@pytest.mark.parametrize(("dimension", "seed"), [(2, 1), (2, 2), (3, 1)])
def test_contacts_balance_the_degrees_of_freedom(dimension, diagonals, seed):
    """N_c = D N_b − D + n_free: 1 for a cell that only dilates, D with free diagonals."""
    packing = compress(random_sample(200, dimension=dimension, seed=seed), diagonals=diagonals)
    assert _excess(packing) == (dimension if diagonals else 1)
    stress = stress_tensor(packing)
    assert np.trace(stress) / dimension == pytest.approx(1.0, abs=1e-9)
    if diagonals:
        assert np.diag(stress) == pytest.approx(np.ones(dimension), abs=1e-9)
    speed = packing.grains.velocity
    assert speed is not None
    assert np.abs(speed).max() < 1e-9


@pytest.mark.parametrize("dimension", [2, 3])
def test_bearing_contacts_touch_and_nothing_overlaps(dimension):
    packing = compress(random_sample(200, dimension=dimension, seed=4))
    contacts = packing.contacts
    assert contacts is not None
    assert contacts.gap is not None
    assert contacts.force is not None
    bearing = (contacts.force != 0).any(axis=1)
    assert bearing.sum() > 100
    assert np.abs(contacts.gap[bearing]).max() < 1e-11
    assert contacts.gap.min() > -1e-11


def test_walled_packings_balance_against_their_walls():
    """Every grain has D equations and the walls one, the stress: N_c = D N_b + 1."""
    packing = compress(random_sample(300, seed=3, boundary="walls"))
    walls = packing.wall_contacts
    assert walls is not None
    inside = select_contacts(packing, "force").pair
    leaning = walls.grain[(walls.force != 0).any(axis=1)]
    held = np.unique(np.concatenate([inside.ravel(), leaning]))
    assert len(inside) + len(leaning) == 2 * len(held) + 1


def test_friction_holds_a_sample_with_fewer_contacts():
    values = measure(compress(random_sample(200, seed=1), friction=0.3), criterion="force")
    assert 3.0 < values["z_backbone"] < 3.7


@pytest.mark.slow
def test_five_thousand_frictionless_disks():
    made = prepare(Sample(grain_count=5000, friction=0.0, seed=1))
    values = measure(made.packing, criterion="force")
    assert abs(_excess(made.packing) - 1) <= 2
    assert 0.835 <= values["phi"] <= 0.850
    assert values["z_backbone"] == pytest.approx(4.0, abs=0.005)
    assert made.summary["residual"] <= 1e-6


@pytest.mark.slow
def test_five_thousand_frictionless_spheres():
    made = prepare(Sample(dimension=3, grain_count=5000, friction=0.0, seed=1))
    values = measure(made.packing, criterion="force")
    assert abs(_excess(made.packing) - 1) <= 3
    assert 0.635 <= values["phi"] <= 0.645
    assert made.summary["residual"] <= 1e-6
