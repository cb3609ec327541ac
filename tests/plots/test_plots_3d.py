"""Figures of 3D states and of the contact criterion: what is drawn, and where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granufab import plots
from granufab.errors import MissingData
from granufab.fabric import criterion_curves, neighbours_within, orientation, sphere_orientation
from granufab.packing import Cell, Contacts, Grains, Packing
from granufab.states import AccessibleDomain, MohrCircle
from granufab.states import mohr as mohr_circle

COMPRESSION = AccessibleDomain(z_min=4, z_max=6, dimension=3)
EXTENSION = AccessibleDomain(z_min=4, z_max=6, dimension=3, mode="extension")


def _contacts(count: int = 2000) -> Contacts:
    normal = np.random.default_rng(1).normal(size=(count, 3)) * [1.0, 1.0, 1.3]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    pair = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    return Contacts(pair=pair, normal=normal)


def _series(z_0: float, z_star: float, a_star: float) -> xr.Dataset:
    eps = np.linspace(0, 0.3, 101)
    walked = 1 - np.exp(-eps / 0.03)
    columns = {"z_backbone": z_0 + (z_star - z_0) * walked, "a_signed": a_star * walked}
    columns |= {"eps_q": eps, "eps_q_total": eps}
    return xr.Dataset({name: ("record", value) for name, value in columns.items()})


def _lines_through(ax, z: float, ordinate: float) -> int:
    """How many of the limit lines (400 points) pass through a point."""
    hits = 0
    for line in ax.get_lines():
        x, y = (np.asarray(v, dtype=float) for v in line.get_data())
        if len(x) == 400:
            hits += abs(np.interp(z, x, y) - ordinate) < 2e-3
    return hits


@pytest.mark.parametrize("figure", ["path", "zaz"])
@pytest.mark.parametrize(("domain", "sign"), [(COMPRESSION, 1), (EXTENSION, -1)])
def test_limits_meet_on_the_side_of_the_path(figure: str, domain, sign: int) -> None:
    series = _series(5.8, domain.z_star, sign * domain.a_star)
    ax = getattr(plots, figure)(series, domain=domain)
    scale = domain.z_star if figure == "zaz" else 1.0
    apex = sign * domain.a_star * scale
    assert _lines_through(ax, domain.z_star, apex) == 2
    assert _lines_through(ax, domain.z_star, -apex) == 0
    bottom, top = ax.get_ylim()
    assert bottom < apex < top


def test_compression_and_extension_share_a_panel_with_both_critical_states() -> None:
    paths = {
        "compression": _series(5.5, COMPRESSION.z_star, COMPRESSION.a_star),
        "extension": _series(5.5, EXTENSION.z_star, -EXTENSION.a_star),
    }
    ax = plots.path(paths, domain=COMPRESSION)
    assert _lines_through(ax, 14 / 3, 5 / 14) == 2
    assert _lines_through(ax, 16 / 3, -5 / 16) == 2
    stars = [line for line in ax.get_lines() if line.get_marker() == "*"]
    places = [(float(s.get_xdata()[0]), float(s.get_ydata()[0])) for s in stars]
    np.testing.assert_allclose(places, [(14 / 3, 5 / 14), (16 / 3, -5 / 16)])
    assert [t.get_text() for t in ax.get_legend().get_texts()].count("critical state") == 1


def test_the_lines_in_zaz_have_the_slopes_of_extension() -> None:
    ax = plots.zaz(_series(5.8, EXTENSION.z_star, -EXTENSION.a_star), domain=EXTENSION)
    slopes = sorted(
        float(np.polyfit(*line.get_data(), 1)[0])
        for line in ax.get_lines()
        if len(line.get_xdata()) == 400
    )
    assert slopes == pytest.approx([-1.25, 2.5])


def test_a_general_state_has_three_circles_an_axisymmetric_one_a_single() -> None:
    general = MohrCircle.from_tensor(np.diag([0.9, 0.75, 0.65]))
    for circle, wide in ((general, 3), (mohr_circle(4.6, 0.3, 3), 1)):
        ax = plots.mohr(circle)
        spans = [
            (float(np.min(x)), float(np.max(x)))
            for x, _ in (line.get_data() for line in ax.get_lines())
            if len(np.atleast_1d(x)) > 100
        ]
        assert len(spans) == wide
    np.testing.assert_allclose(
        sorted(tuple(np.round(s, 3)) for s in _spans(plots.mohr(general))),
        [(0.65, 0.75), (0.65, 0.9), (0.75, 0.9)],
        atol=1e-3,
    )


def _spans(ax) -> list[tuple[float, float]]:
    data = [np.asarray(line.get_xdata(), dtype=float) for line in ax.get_lines()]
    return [(float(x.min()), float(x.max())) for x in data if len(x) > 100]


@pytest.mark.parametrize("domain", [COMPRESSION, EXTENSION])
def test_the_limit_states_of_spheres_are_points_at_a_sixth_of_z(domain) -> None:
    ax = plots.mohr(mohr_circle(5.0, 0.1, 3), domain=domain)
    points = [float(line.get_xdata()[0]) for line in ax.get_lines() if line.get_marker() == "o"]
    assert points == pytest.approx([4 / 6, 6 / 6])


def test_the_section_of_a_3d_rose_is_the_distribution_about_its_axis() -> None:
    data = orientation(_contacts(), z=4.8, bins=10)
    ax = plots.rose(data)
    fit = max(ax.get_lines(), key=lambda line: len(line.get_xdata()))
    angle, value = (np.asarray(v, dtype=float) for v in fit.get_data())
    expected = 4.8 / (4 * np.pi) * (1 + float(data.a) * (3 * np.cos(angle) ** 2 - 1))
    np.testing.assert_allclose(value, expected)
    assert "sr" in ax.get_ylabel()
    flat = orientation(Contacts(pair=np.array([[0, 1], [1, 2]]), normal=np.eye(2)), z=2.0, bins=4)
    with pytest.raises(MissingData, match="one dimension"):
        plots.rose({"plane": flat, "space": data})


def test_the_surface_is_drawn_with_its_scale_and_a_light_file(tmp_path: Path) -> None:
    contacts = _contacts()
    sphere = sphere_orientation(contacts, z=4.8)
    panels = plots.rose_surface(sphere, orientation(contacts, z=4.8), points=True)
    assert len(panels) == 2
    figure = panels[0].figure
    assert any("sr" in ax.get_ylabel() for ax in figure.axes)
    pdf, png = plots.save(figure, tmp_path / "rose")
    assert 10_000 < pdf.stat().st_size < 600_000
    assert png.stat().st_size > 20_000
    assert len(plots.rose_surface(sphere)) == 1
    with pytest.raises(MissingData, match="sphere_orientation"):
        plots.rose_surface(orientation(contacts, z=4.8))


def _lattice(forces: bool) -> Packing:
    side = 6
    steps = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    packing = Packing(
        grains=Grains(position=steps + 0.5, radius=np.full(side**2, 0.5)),
        cell=Cell(matrix=side * np.eye(2)),
    )
    if not forces:
        return packing
    found = neighbours_within(packing, 0.01)
    contacts = Contacts(pair=found.pair, normal=found.normal, gap=found.gap, force=found.normal)
    return Packing(grains=packing.grains, cell=packing.cell, contacts=contacts)


def test_criterion_curves_have_a_column_for_each_threshold_and_a_mark() -> None:
    data = criterion_curves(_lattice(True), bootstrap=0)
    panels = plots.criterion_curves(data)
    assert len(panels) == 6
    mark = next(line for line in panels[0].get_lines() if line.get_marker() == "o")
    assert (float(mark.get_xdata()[0]), float(mark.get_ydata()[0])) == pytest.approx((1e-6, 4.0))
    assert all(ax.get_xscale() == "log" for ax in panels)
    assert "gap" in panels[5].get_xlabel()
    assert len(plots.criterion_curves(criterion_curves(_lattice(False), bootstrap=0))) == 3
    both = plots.criterion_curves({"one": data, "two": data})
    assert [text.get_text() for text in both[0].get_legend().get_texts()] == ["one", "two"]
