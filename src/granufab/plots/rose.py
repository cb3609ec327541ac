"""Polar plot of contact orientations with the second-order fit (Fig. 3a), in 2D and 3D."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.projections.polar import PolarAxes
from matplotlib.typing import ColorType

from granufab.errors import MissingData
from granufab.plots.style import POINTS, new_figure, style

__all__ = ["rose"]

MARKERS = ("o", "^", "s", "D")


def rose(orientations: xr.Dataset | Mapping[str, xr.Dataset], *, ax: Axes | None = None) -> Axes:
    """E(θ), contacts per grain and direction, with error bars [Radjai2012, eqs. 14, 15, Fig. 3].

    2D: the full line is the second-order fit E = z/(2π) {1 + a cos 2(θ − θ_c)}; E is defined over
    half a turn and drawn over the whole one, as E(θ + π) = E(θ). 3D: the section through the
    axis, which stands upright, θ being the polar angle from it;
    E = z/(4π) {1 + a (3 cos²θ − 1)}, the same in all four quarters.

    Args:
        orientations: result of :func:`granufab.orientation`, or several with labels.
        ax: polar panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    Raises:
        MissingData: 2D and 3D orientations are mixed.
    """
    several = {"": orientations} if isinstance(orientations, xr.Dataset) else orientations
    solid = {"phase" not in data for data in several.values()}
    if len(solid) != 1:
        raise MissingData("a rose needs orientations of one dimension, got 2D and 3D")
    with style():
        ax = ax if ax is not None else new_figure(height=2.9, projection="polar")[1][0]
        top = 0.0
        for index, (label, data) in enumerate(several.items()):
            (line,) = ax.plot([], [])
            _draw(ax, data, label, MARKERS[index % len(MARKERS)], line.get_color())
            top = max(top, float((data["E"] + data["E_error"]).max()))
        ax.set_ylim(0, 1.1 * top)
        _dress(ax, top, solid.pop())
        if any(several):
            ax.legend(loc="upper left", bbox_to_anchor=(0.94, 1.08), borderaxespad=0)
    return ax


def _draw(ax: Axes, data: xr.Dataset, label: str, marker: str, colour: ColorType) -> None:
    solid = "phase" not in data
    theta = data["theta"].to_numpy()
    whole = (
        np.concatenate([theta, -theta, np.pi - theta, np.pi + theta])
        if solid
        else np.concatenate([theta, theta + np.pi])
    )
    copies = len(whole) // len(theta)
    value, error = (np.tile(data[name].to_numpy(), copies) for name in ("E", "E_error"))
    ax.errorbar(
        whole,
        value,
        yerr=error,
        fmt=marker,
        **POINTS,
        color=colour,
        label=label or None,
        zorder=3,
    )
    angle = np.linspace(0, 2 * np.pi, 361)
    z, a = float(data.attrs["z"]), float(data["a"])
    if solid:
        fit = z / (4 * np.pi) * (1 + a * (3 * np.cos(angle) ** 2 - 1))
    else:
        phase = np.radians(float(data["phase"][0]))
        fit = z / (2 * np.pi) * (1 + a * np.cos(2 * (angle - phase)))
    ax.plot(angle, fit, color=colour, zorder=2)


def _dress(ax: Axes, top: float, solid: bool) -> None:
    ax.grid(color="#d5d5d5", lw=0.5)
    step = next(s for s in (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10) if top / s <= 4.5)
    rings = np.arange(step, 1.1 * top, step)
    ax.set_yticks(rings, labels=[""] * len(rings))
    ax.set_xticks(np.radians(np.arange(0, 360, 45)))
    ax.minorticks_off()
    ax.tick_params(axis="x", pad=2)
    # Numbers on the rings would hide points, so the label says what a ring is worth.
    unit = "sr" if solid else "rad"
    ax.set_ylabel(rf"$E(\theta)$ [{unit}$^{{-1}}$], rings every {step:g}", labelpad=24)
    if solid:
        cast(PolarAxes, ax).set_theta_zero_location("N")
        cast(PolarAxes, ax).set_theta_direction(-1)
        polar_angle = (0, 45, 90, 135, 180, 135, 90, 45)
        ax.set_xticks(ax.get_xticks(), labels=[f"{angle}°" for angle in polar_angle])
