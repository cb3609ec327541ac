"""Branch lengths: densities that integrate to one, exact lattices, known anisotropy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import draw_sphere, hexagonal, jittered, square
from synthetic_forces import packing_of, stressed

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import branches, neighbours_within


@pytest.mark.parametrize(("lattice", "lines"), [(hexagonal, 3), (square, 2)])
def test_lattice_has_one_length(lattice, lines) -> None:
    data = branches(lattice(), criterion="gap:0.001", axis=np.array([1.0, 0.0]), length_bins=5)
    assert float(data["average_length"]) == pytest.approx(1.0, abs=1e-12)
    assert float(data["length_deviation"]) == pytest.approx(0.0, abs=1e-12)
    step = float(data["length"][1] - data["length"][0])
    np.testing.assert_allclose(np.sort(data["P_length"] * step), [0, 0, 0, 0, 1], atol=1e-9)
    assert float(data["a_l"]) == pytest.approx(0.0, abs=1e-9)
    filled = data["theta"].to_numpy()[data["count"].to_numpy() > 0]
    away = np.mod(filled + 0.5 * np.pi / lines, np.pi / lines) - 0.5 * np.pi / lines
    assert (np.abs(away) < 0.5 * np.pi / 18 + 1e-9).all()
    assert len(filled) >= lines
    assert np.nanmax(np.abs(data["mean_length"] - 1.0)) < 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
def test_densities_integrate_to_one_and_agree(dimension) -> None:
    packing = jittered(np.random.default_rng(1), 512, dimension)
    data = branches(packing, criterion="gap:0.05", z_definition="z", bins=9, length_bins=12)
    step = float(data["length"][1] - data["length"][0])
    width = (np.pi if dimension == 2 else 2 * np.pi) / 9
    assert float(data["P_length"].sum() * step) == pytest.approx(1.0)
    np.testing.assert_allclose(data["P_joint"].sum("theta") * width, data["P_length"], atol=1e-12)
    share = data["count"] / data["count"].sum()
    np.testing.assert_allclose(data["P_joint"].sum("length") * step * width, share, atol=1e-12)
    average = float((data["mean_length"] * share).sum())
    assert average == pytest.approx(float(data["average_length"]))


@pytest.mark.parametrize("axis", [(1.0, 2.0), (1.0, 2.0, -1.0)])
def test_known_anisotropy_comes_back(axis) -> None:
    packing = stressed(np.random.default_rng(7), 20000, 0.3, 0.06, 0.0, 0.0, axis)
    data = branches(packing, axis=np.array(axis), criterion="listed", z_definition="z")
    assert 0 < float(data["a_l_error"]) < 0.005
    assert float(data["a_l"]) == pytest.approx(0.06, abs=3 * float(data["a_l_error"]))
    assert float(data["length_0"]) == pytest.approx(1.0, abs=0.002)
    pull = (data["mean_length"] - data["mean_length_fit"]) / data["mean_length_error"]
    assert float((pull**2).mean()) < 2.5


def test_axis_defaults_to_the_fabric_and_anisotropy_keeps_its_sign() -> None:
    axis = np.array([0.0, 0.6, 0.8])
    normal = draw_sphere(20000, 0.6, axis, np.random.default_rng(3))
    data = branches(packing_of(normal, -0.05, 0.0, 0.0, axis), criterion="listed", z_definition="z")
    assert abs(float(data.attrs["axis"] @ axis)) > 0.999
    assert float(data["a_l"]) == pytest.approx(-0.05, abs=2e-3)


def test_direction_is_that_of_the_normal_or_of_the_branch() -> None:
    """Contacts of elongated grains: all normals lie along (3, 4), branches as in a lattice."""
    packing = hexagonal()
    contacts = neighbours_within(packing, 1e-9)
    turn = np.radians(5.0)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    branch = contacts.normal @ matrix.T * np.array([1.0])
    normal = np.where(np.arange(contacts.count)[:, None] % 3 > 0, contacts.normal, [0.6, 0.8])
    odd = replace(packing, contacts=replace(contacts, normal=normal, branch=branch))
    options = {"criterion": "listed", "bins": 18, "axis": np.array([1.0, 0.0])}
    by_branch = branches(odd, orientation="branch", **options)
    theta = np.degrees(by_branch["theta"][by_branch["count"] > 0])
    np.testing.assert_allclose(theta, [5.0, 65.0, 125.0])
    by_normal = branches(odd, **options)
    assert int(by_normal["count"].sel(theta=np.radians(55.0), method="nearest")) > 0


def test_bad_options_are_named() -> None:
    packing = hexagonal()
    with pytest.raises(InvalidSettings, match="orientation 'radius' is unknown"):
        branches(packing, orientation="radius", criterion="gap:0.01")  # type: ignore[arg-type]
    with pytest.raises(InvalidSettings, match="at least 3 bins"):
        branches(packing, bins=2, criterion="gap:0.01")
    with pytest.raises(InvalidSettings, match="length_bins"):
        branches(packing, length_bins=0, criterion="gap:0.01")
    with pytest.raises(MissingData, match="no contacts"):
        branches(
            replace(packing, grains=replace(packing.grains, radius=np.full(36, 0.1))),
            criterion="gap:0.01",
        )
