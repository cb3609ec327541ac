"""What the figures show: lines where the theory puts them, each grain and contact once."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.image import imread

from granufab import plots
from granufab.errors import MissingData
from granufab.fabric import local_strain, orientation
from granufab.packing import Cell, Contacts, Grains, Packing
from granufab.states import AccessibleDomain, fit_accessible_states
from granufab.states import mohr as mohr_circle

DOMAIN = AccessibleDomain.from_critical(3.35, 0.24)


def _series(z_0: float, seed: int = 1) -> xr.Dataset:
    eps = np.linspace(0, 0.3, 301)
    random = np.random.default_rng(seed)
    z = 3.35 + (z_0 - 3.35) * np.exp(-eps / 0.03) + 0.005 * random.standard_normal(301)
    a = 0.24 * (1 - np.exp(-eps / 0.03)) + 0.005 * random.standard_normal(301)
    columns = {"eps_q": eps, "eps_q_total": eps, "z_backbone": z, "z": 0.9 * z, "a_signed": a}
    return xr.Dataset({name: ("record", value) for name, value in columns.items()})


def _random_packing(periodic: bool = True) -> Packing:
    """Touching and overlapping disks in a tilted cell, positions far outside of it."""
    random = np.random.default_rng(3)
    count, matrix = 60, np.array([[8.0, 2.5], [0.0, 6.0]])
    position = random.random((count, 2)) @ matrix.T
    pair, branch = [], []
    for i in range(count):
        for j in range(i + 1, count):
            share = np.linalg.solve(matrix, position[j] - position[i])
            link = matrix @ (share - np.round(share) if periodic else share)
            if np.linalg.norm(link) < 1.0:
                pair.append((i, j))
                branch.append(link)
    links = np.array(branch)
    normal = links / np.linalg.norm(links, axis=1)[:, None]
    force = random.uniform(0.5, 2.0, (len(links), 1)) * normal
    shift = random.integers(-3, 4, (count, 2)) @ matrix.T if periodic else 0.0
    return Packing(
        grains=Grains(position=position + shift, radius=random.uniform(0.3, 0.6, count)),
        contacts=Contacts(pair=np.array(pair), normal=normal, branch=links, force=force),
        cell=Cell(matrix=matrix) if periodic else None,
    )


def _line_through(ax, z: float, ordinate: float) -> int:
    """How many lines of the panel pass through a point."""
    hits = 0
    for line in ax.get_lines():
        x, y = (np.asarray(v, dtype=float) for v in line.get_data())
        if len(x) > 2 and x.min() < z < x.max():
            hits += abs(np.interp(z, x, y) - ordinate) < 2e-3
    return hits


@pytest.mark.parametrize("figure", ["path", "zaz"])
def test_both_limit_lines_meet_in_the_critical_state(figure: str) -> None:
    empty = xr.Dataset(
        {
            n: ("record", np.zeros(1) + v)
            for n, v in {"eps_q": 0, "eps_q_total": 0, "z_backbone": 3.7, "a_signed": 0}.items()
        }
    )
    ax = getattr(plots, figure)(empty, domain=DOMAIN)
    scale = 3.35 if figure == "zaz" else 1.0
    assert _line_through(ax, 3.35, 0.24 * scale) == 2
    bottom, top = ax.get_ylim()
    assert bottom <= 0 < 0.24 * scale < top
    low, high = ax.get_xlim()
    assert low < DOMAIN.z_min < DOMAIN.z_max < high


def test_zaz_limits_are_straight_with_slopes_of_two() -> None:
    ax = plots.zaz(_series(3.7), domain=DOMAIN)
    slopes = set()
    for line in ax.get_lines():
        x, y = (np.asarray(v, dtype=float) for v in line.get_data())
        if len(x) == 400:
            slopes.add(round(float(np.polyfit(x, y, 1)[0]), 6))
            assert np.abs(np.diff(y, 2)).max() < 1e-12
    assert slopes == {2.0, -2.0}


def test_each_path_may_have_its_own_domain() -> None:
    fits = {}
    for label, z_0 in (("one", 3.7), ("two", 3.1)):
        s = _series(z_0)
        fits[label] = fit_accessible_states(
            s["eps_q"].values, s["z_backbone"].values, s["a_signed"].values
        )
    ax = plots.zaz({"one": _series(3.7), "two": _series(3.1)}, domain=fits)
    colours = [line.get_color() for line in ax.get_lines() if len(line.get_xdata()) == 400]
    assert len(colours) == 4
    assert len(set(colours)) == 2


def test_the_series_shows_the_value_it_was_given() -> None:
    panels = plots.series({"dense": [_series(3.7, 1), _series(3.7, 2)]}, critical=(3.35, 0.24))
    assert len(panels) == 2
    curve = max(panels[0].get_lines(), key=lambda line: len(line.get_xdata()))
    z = np.asarray(curve.get_ydata(), dtype=float)
    assert z[0] == pytest.approx(3.7, abs=0.02)
    assert z[200:].mean() == pytest.approx(3.35, abs=0.003)
    assert "[-]" in panels[1].get_xlabel()


def test_an_unknown_column_is_named() -> None:
    with pytest.raises(MissingData, match="z_mechanical"):
        plots.path(_series(3.5), z_definition="z_mechanical")


def test_the_critical_mohr_circle_touches_the_cone() -> None:
    ax = plots.mohr({"state": mohr_circle(3.4, 0.1)}, domain=DOMAIN)
    cone = [line for line in ax.get_lines() if len(line.get_xdata()) == 2]
    (x, y) = max((np.asarray(line.get_data(), dtype=float) for line in cone), key=lambda d: d[1][1])
    slope = y[1] / x[1]
    circles = [
        np.asarray(line.get_data()) for line in ax.get_lines() if len(line.get_xdata()) == 361
    ]
    largest = max(circles, key=lambda points: np.ptp(points[0]))
    outside = largest[1] - slope * largest[0]  # > 0 above the line
    assert outside.max() == pytest.approx(0.0, abs=1e-5)
    assert np.ptp(largest[0]) == pytest.approx((DOMAIN.z_max - DOMAIN.z_min) / 4)
    assert all(np.ptp(c[0]) <= np.ptp(largest[0]) + 1e-12 for c in circles)


def test_every_contact_is_drawn_once_inside_the_cell() -> None:
    packing = _random_packing()
    ax = plots.network(packing)
    (lines,) = (c for c in ax.collections if isinstance(c, LineCollection))
    assert packing.cell is not None
    assert packing.contacts is not None
    inverse = np.linalg.inv(packing.cell.matrix)
    drawn = sum(_length_inside(np.asarray(s), inverse) for s in lines.get_segments())
    branch = packing.contacts.branch
    assert branch is not None
    assert drawn == pytest.approx(float(np.linalg.norm(branch, axis=1).sum()), rel=1e-3)


def _length_inside(segment: np.ndarray, inverse: np.ndarray) -> float:
    share = np.linspace(0, 1, 4001)[:-1, None] + 0.5 / 4000
    points = (segment[0] + share * (segment[1] - segment[0])) @ inverse.T
    inside = ((points >= 0) & (points < 1)).all(axis=1)
    return float(inside.mean() * np.linalg.norm(segment[1] - segment[0]))


def test_every_part_of_a_grain_is_drawn_once_inside_the_cell() -> None:
    packing = _random_packing()
    ax = plots.network(packing)
    (disks,) = (c for c in ax.collections if isinstance(c, EllipseCollection))
    assert packing.cell is not None
    probe = np.random.default_rng(5).random((20_000, 2)) @ packing.cell.matrix.T
    centre, radius = np.asarray(disks.get_offsets()), np.asarray(disks.get_widths()) / 2
    covered = 0.0
    for c, r in zip(centre, radius, strict=True):
        covered += (((probe - c) ** 2).sum(axis=1) < r * r).mean()
    expected = float((np.pi * packing.grains.radius**2).sum()) / packing.cell.volume
    assert covered == pytest.approx(expected, rel=0.01)


def test_line_width_is_proportional_to_the_normal_force() -> None:
    packing = _random_packing(periodic=False)
    ax = plots.network(packing)
    (lines,) = (c for c in ax.collections if isinstance(c, LineCollection))
    assert packing.contacts is not None
    assert packing.contacts.force is not None
    force = (packing.contacts.force * packing.contacts.normal).sum(axis=1)
    ratio = np.asarray(lines.get_linewidths(), dtype=float) / force
    np.testing.assert_allclose(ratio, ratio[0])


def test_the_rose_repeats_after_half_a_turn_and_its_fit_has_the_anisotropy() -> None:
    angle = np.random.default_rng(4).random(40_000) * np.pi
    angle = angle[np.random.default_rng(5).random(40_000) * 1.3 < 1 + 0.3 * np.cos(2 * angle)]
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    contacts = Contacts(pair=np.zeros((len(angle), 2), dtype=int), normal=normal)
    ax = plots.rose(orientation(contacts, z=4.0))
    fit = next(line for line in ax.get_lines() if len(line.get_xdata()) == 361)
    value = np.asarray(fit.get_ydata(), dtype=float)
    assert (value.max() - value.min()) / (value.max() + value.min()) == pytest.approx(0.3, abs=0.02)
    np.testing.assert_allclose(value[:180], value[180:360])
    assert np.trapezoid(value[:181], dx=np.pi / 180) == pytest.approx(2.0, rel=1e-4)  # z/2


def test_homogeneous_strain_gives_a_map_of_ones() -> None:
    random = np.random.default_rng(6)
    position = random.random((400, 2)) * 20
    stretch = np.diag([1.02, 0.98])

    def state(x: np.ndarray, matrix: np.ndarray) -> Packing:
        return Packing(
            grains=Grains(position=x, radius=np.full(400, 0.5)), cell=Cell(matrix=matrix)
        )

    before = state(position, 20 * np.eye(2))
    after = state(position @ stretch, 20 * stretch)
    ax = plots.homogeneity(local_strain(before, after))
    field = np.asarray(ax.images[0].get_array(), dtype=float)
    np.testing.assert_allclose(field, 1.0, atol=1e-9)


def test_three_dimensions_are_refused_in_one_line() -> None:
    spheres = Packing(grains=Grains(position=np.zeros((1, 3)), radius=np.ones(1)))
    with pytest.raises(MissingData, match="3D"):
        plots.network(spheres)


def test_a_figure_is_a_column_wide_with_embedded_fonts(tmp_path: Path) -> None:
    ax = plots.path(_series(3.7), _series(3.1), domain=DOMAIN)
    pdf, png = plots.save(ax.figure, tmp_path / "fig.v1")
    assert (pdf.name, png.name) == ("fig.v1.pdf", "fig.v1.png")
    assert imread(png).shape[1] == round(84 / 25.4 * 300)
    content = pdf.read_bytes()
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ", content)
    assert box is not None
    assert float(box[1]) == pytest.approx(84 / 25.4 * 72, abs=0.1)
    assert b"/Type3" not in content
    sizes = [
        text.get_fontsize() for text in ax.figure.findobj(lambda o: hasattr(o, "get_fontsize"))
    ]
    assert min(sizes) >= 8


def test_importing_figures_leaves_pyplot_and_the_defaults_alone() -> None:
    code = (
        "import sys, matplotlib; before = dict(matplotlib.rcParams); import granufab.plots as p;"
        "p.new_figure(); assert 'matplotlib.pyplot' not in sys.modules;"
        "assert dict(matplotlib.rcParams) == before"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
