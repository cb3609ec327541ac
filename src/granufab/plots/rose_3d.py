"""Contact orientations of a 3D state as a surface, beside their section through the axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.projections.polar import PolarAxes
from mpl_toolkits.mplot3d import Axes3D

from granufab.errors import MissingData
from granufab.fabric import sphere_density
from granufab.packing import Array
from granufab.plots.rose import rose
from granufab.plots.style import INK, new_figure, style

__all__ = ["rose_surface"]

_VIEW = (22.0, 35.0)
_STEPS = (61, 121)


def rose_surface(
    sphere: xr.Dataset,
    section: xr.Dataset | None = None,
    *,
    orders: Sequence[int] | None = None,
    points: bool = False,
) -> list[Axes]:
    """E(n) as the distance of a surface from the origin, and its section through the axis.

    The surface is the sum of the spherical harmonics, coloured by E; with ``points`` the dots are
    the cells of one area on the side of the viewer, each at the height of its own count. The
    section holds E(θ) in equal solid angle about the axis with error bars, and the second-order
    fit (:func:`granufab.plots.rose`).

    Args:
        sphere: result of :func:`granufab.fabric.sphere_orientation`.
        section: result of :func:`granufab.orientation` of the same contacts in 3D; None draws
            the surface alone.
        orders: harmonics summed; default all that ``sphere`` holds.
        points: draw the cells; they crowd the surface of a state of few contacts.
    Returns:
        The panels: the surface, and the section where there is one.
    Raises:
        MissingData: ``sphere`` or ``section`` is of another kind.
        InvalidSettings: an order that ``sphere`` does not hold.
    """
    if "coefficient" not in sphere or (section is not None and "phase" in section):
        raise MissingData("rose_surface needs the result of sphere_orientation, and a 3D section")
    with style():
        figure, _ = new_figure(height=2.6 if section is None else 5.2)
        figure.clear()
        grid = figure.add_gridspec(1 if section is None else 2, 1)
        surface = cast(Axes3D, figure.add_subplot(grid[0], projection="3d"))
        panels: list[Axes] = [surface]
        density = _draw_surface(surface, sphere, orders)
        reach = 1.05 * float(density.max())
        if points:
            _draw_cells(surface, sphere)
        _dress(surface, reach, sphere if section is None else section)
        scale = ScalarMappable(Normalize(density.min(), density.max()), colormaps["viridis"])
        bar = figure.colorbar(scale, ax=surface, shrink=0.8, pad=0.0, aspect=18)
        bar.set_label(r"$E(\mathbf{n})$ [sr$^{-1}$]")
        if section is not None:
            polar = figure.add_subplot(grid[1], projection="polar")
            panels.append(rose(section, ax=cast(PolarAxes, polar)))
    return panels


def _draw_surface(ax: Axes3D, sphere: xr.Dataset, orders: Sequence[int] | None) -> Array:
    theta = np.linspace(0, np.pi, _STEPS[0])[:, None]
    azimuth = np.linspace(0, 2 * np.pi, _STEPS[1])[None, :]
    direction = np.stack(
        [
            np.sin(theta) * np.cos(azimuth),
            np.sin(theta) * np.sin(azimuth),
            np.cos(theta) * np.ones_like(azimuth),
        ],
        axis=-1,
    )
    density = np.maximum(sphere_density(sphere, direction, orders=orders), 0.0)
    points = np.moveaxis(direction * density[..., None], -1, 0)
    middle = 0.25 * (density[1:, 1:] + density[1:, :-1] + density[:-1, 1:] + density[:-1, :-1])
    colour = colormaps["viridis"](Normalize(density.min(), density.max())(middle))
    # Thousands of facets would make a heavy file with white seams: the surface alone is pixels.
    ax.plot_surface(
        *points,
        facecolors=colour,
        rstride=1,
        cstride=1,
        shade=False,
        lw=0,
        antialiased=False,
        rasterized=True,
    )
    return density


def _draw_cells(ax: Axes3D, sphere: xr.Dataset) -> None:
    """Cells that face the viewer, on both halves of the sphere."""
    elevation, azimuth = np.radians(_VIEW)
    towards = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    direction = sphere["direction"].to_numpy()
    place = direction * sphere["E"].to_numpy()[:, None]
    both = np.concatenate([place, -place])
    seen = both[np.concatenate([direction, -direction]) @ towards > 0.15]
    ax.plot(*seen.T, "o", color="white", ms=3.2, mec=INK, mew=0.4, zorder=10)


def _dress(ax: Axes3D, reach: float, source: xr.Dataset) -> None:
    ax.set_proj_type("ortho")
    ax.view_init(*_VIEW)
    for limits in (ax.set_xlim, ax.set_ylim, ax.set_zlim):
        limits(-reach, reach)
    ax.set_box_aspect((1, 1, 1), zoom=1.5)  # type: ignore[arg-type]
    ax.set_axis_off()
    for letter, unit in zip("xyz", np.eye(3), strict=True):
        end = 1.15 * reach * unit
        ax.plot(*zip(-end, end, strict=True), color=INK, lw=0.5, zorder=0)
        x, y, z = (1.1 * end).tolist()
        ax.text(x, y, z, f"${letter}$", ha="center", va="center", zorder=20)
    if "axis" in source.attrs:
        end = 1.2 * reach * np.asarray(source.attrs["axis"])
        ax.plot(*zip(-end, end, strict=True), color=INK, lw=0.8, ls=(0, (5, 2)), zorder=0)
