from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import hexagonal, square

from granufab.errors import MissingData
from granufab.fabric import neighbours_within, solid_fraction, stress_ratio, stress_tensor
from granufab.packing import Cell, Contacts, Grains, Packing, WallContacts


def pressed(packing, force):
    """The lattice with f = force(n) on each of its contacts."""
    contacts = neighbours_within(packing, 0.01)
    return replace(packing, contacts=replace(contacts, force=force(contacts.normal)))


def test_square_lattice_under_unequal_forces():
    # One contact of each kind per grain and unit area: σ_xx = f_x ℓ/ℓ² = f_x.
    state = pressed(square(), lambda n: n * [3.0, 1.0])
    np.testing.assert_allclose(stress_tensor(state), np.diag([3.0, 1.0]), atol=1e-12)
    assert stress_ratio(stress_tensor(state)) == pytest.approx(0.5)


def test_hexagonal_lattice_under_equal_forces():
    # 3 contacts per grain of area √3/2: σ = (2/√3)·(3/2) f 1 = √3 f 1.
    stress = stress_tensor(pressed(hexagonal(), lambda n: 2.0 * n))
    np.testing.assert_allclose(stress, 2 * np.sqrt(3) * np.eye(2), atol=1e-12)
    assert stress_ratio(stress) == pytest.approx(0, abs=1e-12)


def test_pulling_gives_a_negative_stress():
    assert np.trace(stress_tensor(pressed(square(), lambda n: -n))) < 0


def test_a_disk_between_walls_carries_the_wall_force_over_their_length():
    # Walls 2R = 2 apart, 5 long, pressed with 10: σ_yy = 10/5.
    state = Packing(
        grains=Grains(position=[[2.5, 1.0]], radius=[1.0]),
        cell=Cell(matrix=np.diag([5.0, 2.0]), periodic=(True, False)),
        wall_contacts=WallContacts(
            grain=np.array([0, 0]),
            wall=np.array([2, 3]),
            normal=np.array([[0, -1.0], [0, 1.0]]),
            gap=np.zeros(2),
            force=np.array([[0, -10.0], [0, 10.0]]),
        ),
    )
    np.testing.assert_allclose(stress_tensor(state), np.diag([0.0, 2.0]), atol=1e-12)


def test_stress_scales_with_force_and_length_and_turns_with_the_state():
    state = pressed(hexagonal(4), lambda n: n * [3.0, 1.0])
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    contacts = state.contacts
    turned = Packing(
        grains=Grains(position=state.grains.position @ turn.T, radius=state.grains.radius),
        cell=Cell(matrix=turn @ state.cell.matrix),
        contacts=Contacts(
            pair=contacts.pair,
            normal=contacts.normal @ turn.T,
            branch=contacts.branch @ turn.T,
            force=contacts.force @ turn.T,
        ),
    )
    np.testing.assert_allclose(
        stress_tensor(turned), turn @ stress_tensor(state) @ turn.T, atol=1e-12
    )


def test_solid_fractions_of_lattices():
    assert solid_fraction(hexagonal()) == pytest.approx(np.pi / (2 * np.sqrt(3)))
    cubic = Packing(
        grains=Grains(position=np.zeros((1, 3)), radius=[0.5]), cell=Cell(matrix=np.eye(3))
    )
    assert solid_fraction(cubic) == pytest.approx(np.pi / 6)


def test_what_is_missing_is_named():
    cloud = Packing(grains=hexagonal().grains)
    with pytest.raises(MissingData, match="cell"):
        stress_tensor(cloud)
    with pytest.raises(MissingData, match="cell"):
        solid_fraction(cloud)
    with pytest.raises(MissingData, match="contacts"):
        stress_tensor(hexagonal())
    with pytest.raises(MissingData, match="mean stress is zero"):
        stress_ratio(np.zeros((2, 2)))
