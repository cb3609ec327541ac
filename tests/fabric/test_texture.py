"""Connectivity and angles of lattices are exact; windows hold as many contacts as counted."""

from __future__ import annotations

import numpy as np
import pytest
from fabric_cases import draw_plane, draw_sphere, face_centred, hexagonal, jittered, square
from synthetic_forces import packing_of

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import texture
from granufab.packing import Contacts, Grains, Packing
from granufab.states import steric_coordination, steric_margin, window_occupation

TOUCH = {"criterion": "gap:0.001"}


@pytest.mark.parametrize(
    ("lattice", "number", "angle"),
    [(hexagonal, 6, np.pi / 3), (square, 4, np.pi / 2), (face_centred, 12, np.pi / 3)],
)
def test_lattices_are_exact(lattice, number, angle) -> None:
    data = texture(lattice(), bins=37, delta_theta=1.0, **TOUCH)
    for name in ("fraction", "fraction_backbone"):
        assert float(data[name].sel(contact_number=number)) == 1.0
        assert float(data[name].sum()) == 1.0
    for name in ("delta_theta", "smallest_angle"):
        assert float(data[name]) == pytest.approx(angle, abs=1e-9)
    assert float(data["z"]) == number
    assert int((data["P_angle"] > 0).sum()) == 1
    top = 2 * np.pi if number < 12 else np.pi
    assert abs(float(data["P_angle"].idxmax()) - angle) < top / 37
    assert float(data["delta_theta_geometric"]) == pytest.approx(np.pi / 3)
    excess = angle - np.pi / 3
    assert float(data["smallest_excess"]) == pytest.approx(excess, abs=1e-9)


def test_hexagonal_packing_fills_every_window() -> None:
    data = texture(hexagonal(), windows=18, **TOUCH)
    assert float(data["z_steric"]) == pytest.approx(6.0)
    np.testing.assert_allclose(data["occupation"], 1.0, atol=1e-9)
    assert float(data["steric_margin"]) == pytest.approx(0.0, abs=1e-9)
    assert float(steric_margin(6.0, 0.0, np.pi / 3)) == pytest.approx(0.0, abs=1e-12)


def test_connectivity_counts_rattlers_once() -> None:
    """A triangle of touching disks, a chain of one more, and one alone."""
    height = np.sqrt(0.75)
    position = [[0, 0], [1, 0], [0.5, height], [1.5, height], [5, 5]]
    pair = np.array([[0, 1], [1, 2], [0, 2], [2, 3]])
    branch = np.diff(np.array(position)[pair], axis=1)[:, 0]
    packing = Packing(
        grains=Grains(position=np.array(position, dtype=float), radius=np.full(5, 0.5)),
        contacts=Contacts(pair=pair, normal=branch, branch=branch),
    )
    data = texture(packing, criterion="listed", delta_theta=1.0)
    np.testing.assert_allclose(data["fraction"], [0.2, 0.2, 0.4, 0.2])
    np.testing.assert_allclose(data["fraction_backbone"], [0, 0, 1, 0])
    # Inside the triangle the angle is π/3, outside 5π/3.
    assert float(data["smallest_angle"]) == pytest.approx(np.pi / 3)
    width = float(data["angle"][1] - data["angle"][0])
    mean = float((data["angle"] * data["P_angle"]).sum() * width)
    assert mean == pytest.approx(np.pi, abs=width / 2)


def test_angles_respect_the_sizes_of_the_grains() -> None:
    """Disks that touch and do not overlap: no angle is below what its three radii allow."""
    small, large = 0.4, 0.6
    one, two = large + small, small + small
    half = np.arcsin(two / 2 / one)
    turn = np.array([-half, half])
    position = np.vstack([[0.0, 0.0], one * np.column_stack([np.cos(turn), np.sin(turn)])])
    pair = np.array([[0, 1], [0, 2], [1, 2]])
    branch = position[pair[:, 1]] - position[pair[:, 0]]
    packing = Packing(
        grains=Grains(position=position, radius=np.array([large, small, small])),
        contacts=Contacts(
            pair=pair, normal=branch / np.linalg.norm(branch, axis=1)[:, None], branch=branch
        ),
    )
    data = texture(packing, criterion="listed", delta_theta=1.0)
    assert float(data["smallest_angle"]) == pytest.approx(2 * half)
    assert float(data["smallest_excess"]) == pytest.approx(0.0, abs=1e-9)
    assert float(data["delta_theta_geometric_min"]) == pytest.approx(2 * half)
    assert float(data["smallest_angle"]) < np.pi / 3


@pytest.mark.parametrize("dimension", [2, 3])
def test_windows_hold_what_the_second_order_density_says(dimension) -> None:
    generator = np.random.default_rng(dimension)
    axis, width, a = np.eye(dimension)[-1], 0.9, 0.4
    if dimension == 2:
        normal = draw_plane(60000, a, np.pi / 2, generator)
    else:
        normal = draw_sphere(60000, a, axis, generator)
    packing = packing_of(normal, 0.0, 0.0, 0.0, axis)
    data = texture(
        packing, criterion="listed", z_definition="z", delta_theta=width, axis=axis, windows=9
    )
    theta = data["theta"].to_numpy()
    offset = theta - np.pi / 2 if dimension == 2 else theta
    expected = window_occupation(float(data["z"]), a, width, offset, dimension)
    pull = (data["occupation"] - expected) / data["occupation_error"]
    assert float(np.abs(pull).max()) < 4.0
    assert float(data["z_steric"]) == pytest.approx(steric_coordination(width, dimension))
    assert float(data["steric_margin"]) == pytest.approx(1 - float(data["occupation"].max()))


@pytest.mark.parametrize("dimension", [2, 3])
def test_pair_and_neighbour_angles_of_a_disordered_state(dimension) -> None:
    packing = jittered(np.random.default_rng(4), 400 if dimension == 2 else 343, dimension)
    options = {"criterion": "gap:0.05", "z_definition": "z", "delta_theta": 1.0}
    data = texture(packing, **options)
    width = float(data["angle"][1] - data["angle"][0])
    assert float(data["P_angle"].sum() * width) == pytest.approx(1.0)
    if dimension == 3:
        assert float(data["P_pair"].sum() * width) == pytest.approx(1.0)
        near, pair = (float((data["angle"] * data[n]).sum()) for n in ("P_angle", "P_pair"))
        assert near < pair
    again = texture([packing, packing], **options)
    np.testing.assert_allclose(again["fraction"], data["fraction"])
    np.testing.assert_allclose(again["P_angle"], data["P_angle"])


def test_bad_options_are_named() -> None:
    with pytest.raises(InvalidSettings, match="delta_theta is 4"):
        texture(hexagonal(), delta_theta=4.0, **TOUCH)
    with pytest.raises(InvalidSettings, match="quantile"):
        texture(hexagonal(), quantile=1.0, **TOUCH)
    with pytest.raises(InvalidSettings, match="at least 3 bins"):
        texture(hexagonal(), bins=1, **TOUCH)
    lone = Packing(
        grains=Grains(position=np.array([[0.0, 0], [1, 0]]), radius=np.full(2, 0.5)),
        contacts=Contacts(pair=np.array([[0, 1]]), normal=np.array([[1.0, 0.0]])),
    )
    with pytest.raises(MissingData, match="no grain has two contacts"):
        texture(lone, criterion="listed", z_definition="z")
