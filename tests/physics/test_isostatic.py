"""Frictionless packings at rest are isostatic: as many contacts as there are equations."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.fabric import coordination, measure, select_contacts, stress_tensor
from granufab.packing import Packing
from granufab.simulate import Sample, compress, prepare, random_sample


def _excess(packing: Packing) -> int:
    """N_c − (2 N_b − 2) over the force-bearing backbone of frictionless disks."""
    contacts = select_contacts(packing, "force")
    numbers = coordination(contacts.pair, packing.grains.count, minimum=3)
    held = numbers.held
    inside = held[contacts.pair[:, 0]] & held[contacts.pair[:, 1]]
    return int(inside.sum()) - (2 * int(held.sum()) - 2)


@pytest.mark.parametrize("diagonals", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_contacts_balance_the_degrees_of_freedom(diagonals, seed):
    """N_c = 2 N_b − 2 + n_free: 1 for a cell that only dilates, 2 with free diagonals."""
    packing = compress(random_sample(200, seed=seed), diagonals=diagonals)
    free = 2 if diagonals else 1
    assert abs(_excess(packing) - free) <= 2
    stress = stress_tensor(packing)
    assert np.trace(stress) / 2 == pytest.approx(1.0, abs=1e-6)
    if diagonals:
        assert np.diag(stress) == pytest.approx([1.0, 1.0], abs=1e-5)
    speed = packing.grains.velocity
    assert speed is not None
    assert np.abs(speed).max() < 1e-4


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
