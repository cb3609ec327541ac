"""Figures of the velocity field and of the fluctuations show the numbers they were given."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Circle
from matplotlib.quiver import Quiver

from granufab import plots
from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import fluctuation_spectrum, fluctuations, velocity_field
from granufab.packing import Cell, Grains, Packing

RATE = np.array([[0.0, 1.0], [0.0, 0.0]])


def _states(number: int = 9, side: int = 24) -> list[Packing]:
    random = np.random.default_rng(1)
    axes = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1)
    position = axes.reshape(-1, 2) + random.uniform(0.3, 0.7, (side**2, 2))
    found, matrix, growth = [], side * np.eye(2), np.eye(2) + 0.01 * RATE
    for k in range(number):
        velocity = 0.1 * random.normal(size=position.shape)
        grains = Grains(position=position, radius=np.full(len(position), 0.5), velocity=velocity)
        found.append(Packing(grains=grains, cell=Cell(matrix=matrix, rate=RATE), time=0.01 * k))
        position = position @ growth.T + 0.01 * random.normal(size=position.shape)
        matrix = growth @ matrix
    return found


@pytest.fixture(scope="module")
def field() -> xr.Dataset:
    return velocity_field(_states(3), criterion="gap:0.2")


@pytest.fixture(scope="module")
def moved() -> xr.Dataset:
    return fluctuations(_states())


@pytest.mark.parametrize("part", ["velocity", "affine", "difference"])
def test_every_box_with_pairs_has_its_arrow(field: xr.Dataset, part) -> None:
    ax = plots.velocity_field(field, part=part)
    (arrows,) = (c for c in ax.collections if isinstance(c, Quiver))
    seen = field["count"].to_numpy() >= 20
    drawn = np.stack([np.asarray(arrows.U), np.asarray(arrows.V)])
    np.testing.assert_allclose(drawn, field[part].to_numpy()[:, seen])
    np.testing.assert_allclose(arrows.XY.T, field["position"].to_numpy()[:, seen])
    (disk,) = (p for p in ax.patches if isinstance(p, Circle))
    assert disk.radius == 1.0
    assert ax.get_xlim() == pytest.approx((-4.0, 4.0))
    assert "x" in ax.get_xlabel()


def test_field_and_affine_part_share_their_scale(field: xr.Dataset) -> None:
    panels = plots.velocity_panels(field)
    scales = [next(c for c in panel.collections if isinstance(c, Quiver)).scale for panel in panels]
    assert len(panels) == 3
    assert scales[0] == pytest.approx(scales[1])
    assert scales[2] < scales[0]


def test_the_profile_shows_both_shares(field: xr.Dataset) -> None:
    ax = plots.velocity_profile(field)
    curves = [line for line in ax.get_lines() if len(np.asarray(line.get_xdata())) > 5]
    for line, name in zip(curves, ("normal_share", "tangential_share"), strict=True):
        x, y = (np.asarray(v, dtype=float) for v in line.get_data())
        expected = field[name].sel(distance=x, method="nearest")
        np.testing.assert_allclose(y, expected)


def test_the_distribution_lies_on_the_gaussian(moved: xr.Dataset) -> None:
    ax = plots.fluctuation_pdf(moved)
    gauss = next(line for line in ax.get_lines() if line.get_label() == "Gaussian")
    x, y = (np.asarray(v, dtype=float) for v in gauss.get_data())
    assert np.trapezoid(y, x) == pytest.approx(1.0, abs=1e-3)
    assert ax.get_yscale() == "log"


def test_growth_and_spectrum_draw_their_power_laws(moved: xr.Dataset) -> None:
    spectrum = fluctuation_spectrum(_states(), fit=(2.0, 24.0))
    panels = plots.fluctuations(moved, spectrum)
    assert len(panels) == 4
    for panel, slope in ((panels[2], moved["exponent"]), (panels[3], -spectrum["slope"])):
        law = next(line for line in panel.get_lines() if "$" in str(line.get_label()))
        x, y = (np.asarray(v, dtype=float) for v in law.get_data())
        assert np.polyfit(np.log(x), np.log(y), 1)[0] == pytest.approx(float(slope), abs=1e-9)
    assert len(plots.fluctuations(moved)) == 3


def test_refusals(field: xr.Dataset) -> None:
    with pytest.raises(InvalidSettings, match="unknown"):
        plots.velocity_field(field, part="mean")  # type: ignore[arg-type]
    with pytest.raises(MissingData, match="20 pairs"):
        plots.velocity_field(field.assign(count=0 * field["count"]))
