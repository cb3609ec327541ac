"""Figures of branches, forces, stress–force–fabric and texture show what was measured."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granufab import plots
from granufab.errors import MissingData
from granufab.fabric import branches, force_statistics, stress_force_fabric, texture

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fabric"))
from synthetic_forces import stressed

OPTIONS = {"criterion": "listed", "z_definition": "z"}


def _packing(dimension: int):
    axis = np.eye(dimension)[-1]
    packing = stressed(np.random.default_rng(1), 2000, 0.2, 0.03, 0.3, 0.1, axis)
    return packing, {"axis": axis} | OPTIONS


def _points(ax, index: int = 0) -> np.ndarray:
    return np.column_stack(ax.containers[index].lines[0].get_data()).astype(float)


def _draws(ax) -> None:
    ax.get_figure(root=True).canvas.draw()


@pytest.mark.parametrize("dimension", [2, 3])
def test_branch_panels_hold_the_means_by_direction(dimension) -> None:
    packing, options = _packing(dimension)
    data = branches(packing, **options)
    panels = plots.branches(data)
    expected = data["mean_length"] / data["average_length"]
    points = _points(panels[1])
    np.testing.assert_allclose(points[:, 0], np.degrees(data["theta"]))
    np.testing.assert_allclose(points[:, 1], expected)
    assert panels[1].get_xlim() == (0, 180 if dimension == 2 else 90)
    joint = plots.branches_joint(data)
    np.testing.assert_allclose(
        np.asarray(joint.collections[0].get_array()).ravel(),
        (data["average_length"] * data["P_joint"]).to_numpy().ravel(),
    )
    _draws(panels[0])
    _draws(joint)


@pytest.mark.parametrize("dimension", [2, 3])
def test_force_curves_carry_their_anisotropies(dimension) -> None:
    packing, options = _packing(dimension)
    data = stress_force_fabric(packing, replicas=20, **options)
    panels = plots.stress_force_fabric(data)
    np.testing.assert_allclose(_points(panels[0], 1)[:, 1], data["normal_force"] / data["force_0"])
    np.testing.assert_allclose(_points(panels[1])[:, 1], data["tangential_force"] / data["force_0"])
    legend = panels[0].get_legend()
    assert legend is not None
    assert f"a_n={float(data['a_n']):.3f}" in legend.get_texts()[1].get_text()
    _draws(panels[0])


def test_stress_ratios_stand_against_the_measured_ones_whatever_their_sign() -> None:
    packing, options = _packing(2)
    data = stress_force_fabric(packing, replicas=20, **options)
    across = stress_force_fabric(packing, replicas=20, **(options | {"axis": np.array([1.0, 0.0])}))
    assert float(across["q_over_p_signed"]) < 0
    ax = plots.stress_ratios({"along": data, "across": across})
    points = _points(ax, 1)
    assert (points > 0).all()
    np.testing.assert_allclose(points[0, 0], points[1, 0])
    assert points[0, 1] == pytest.approx(float(data["q_over_p_full"]))
    _draws(ax)


def test_force_density_draws_both_laws_with_their_mass() -> None:
    packing, options = _packing(2)
    data = force_statistics(packing, friction=0.5, replicas=20, **options)
    for logarithmic in (True, False):
        ax = plots.force_density(data, logarithmic_force=logarithmic)
        assert ax.get_xscale() == ("log" if logarithmic else "linear")
        power, tail = ax.get_lines()[-3:-1]
        x, density = (np.asarray(part) for part in tail.get_data())
        rate = float(data["strong_decay"])
        assert density[0] == pytest.approx(float(data["contact_share"][1]) * rate)
        assert np.log(density[0] / density[-1]) == pytest.approx(rate * (x[-1] - 1))
        assert np.asarray(power.get_xdata())[-1] == pytest.approx(1.0)
        _draws(ax)
    ax = plots.mobilisation({"here": data})
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), data["P_mobilisation"])
    _draws(ax)
    with pytest.raises(MissingData, match="coefficient of friction"):
        plots.mobilisation(force_statistics(packing, replicas=0, **options))


@pytest.mark.parametrize("dimension", [2, 3])
def test_texture_shows_fractions_angles_and_windows(dimension) -> None:
    packing, options = _packing(dimension)
    data = texture(packing, delta_theta=1.0, **options)
    panels = plots.texture(data)
    heights = [bar.get_height() for bar in panels[0].patches[: data.sizes["contact_number"]]]
    np.testing.assert_allclose(heights, data["fraction"])
    density = panels[1].get_lines()[0].get_ydata()
    np.testing.assert_allclose(density, np.radians(data["P_angle"]))
    ax = plots.occupation(data)
    np.testing.assert_allclose(_points(ax)[:, 1], data["occupation"])
    fit = np.asarray(ax.get_lines()[1].get_ydata())
    pull = (fit - data["occupation"].to_numpy()) / data["occupation_error"].to_numpy()
    assert np.abs(pull).max() < 5
    _draws(panels[0])
    _draws(ax)


def test_joint_density_of_a_single_length_is_drawn() -> None:
    packing, options = _packing(2)
    contacts = replace(packing.contacts, branch=packing.contacts.normal)
    data = branches(replace(packing, contacts=contacts), length_bins=1, **options)
    assert isinstance(data, xr.Dataset)
    ax = plots.branches_joint(data)
    assert np.asarray(ax.collections[0].get_array()).shape == (1, data.sizes["theta"])
    _draws(ax)
