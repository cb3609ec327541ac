"""Polar plot of contact orientations with the second-order fit (Fig. 3a)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.typing import ColorType

from granufab.errors import MissingData
from granufab.plots.style import new_figure, style

__all__ = ["rose"]

MARKERS = ("o", "^", "s", "D")


def rose(orientations: xr.Dataset | Mapping[str, xr.Dataset], *, ax: Axes | None = None) -> Axes:
    """E(θ), contacts per grain and direction, with error bars [Radjai2012, eq. 14, Fig. 3].

    The full line is the second-order fit E = z/(2π) {1 + a cos 2(θ − θ_c)}. E is defined over
    half a turn and drawn over the whole one, as E(θ + π) = E(θ).

    Args:
        orientations: result of :func:`granufab.orientation` in 2D, or several with labels.
        ax: polar panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    Raises:
        MissingData: an orientation is that of a 3D state.
    """
    several = {"": orientations} if isinstance(orientations, xr.Dataset) else orientations
    with style():
        ax = ax if ax is not None else new_figure(height=2.9, projection="polar")[1][0]
        top = 0.0
        for index, (label, data) in enumerate(several.items()):
            if "phase" not in data:
                raise MissingData("the rose is drawn for 2D orientations; this state is 3D")
            (line,) = ax.plot([], [])
            _draw(ax, data, label, MARKERS[index % len(MARKERS)], line.get_color())
            top = max(top, float((data["E"] + data["E_error"]).max()))
        ax.set_ylim(0, 1.1 * top)
        _dress(ax, top)
        if any(several):
            ax.legend(loc="upper left", bbox_to_anchor=(0.94, 1.08), borderaxespad=0)
    return ax


def _draw(ax: Axes, data: xr.Dataset, label: str, marker: str, colour: ColorType) -> None:
    theta = data["theta"].to_numpy()
    whole = np.concatenate([theta, theta + np.pi])
    value, error = (np.tile(data[name].to_numpy(), 2) for name in ("E", "E_error"))
    ax.errorbar(
        whole,
        value,
        yerr=error,
        fmt=marker,
        ms=3,
        mfc="white",
        mew=0.8,
        color=colour,
        elinewidth=0.7,
        label=label or None,
        zorder=3,
    )
    angle = np.linspace(0, 2 * np.pi, 361)
    a, phase = float(data["a"]), np.radians(float(data["phase"][0]))
    fit = data.attrs["z"] / (2 * np.pi) * (1 + a * np.cos(2 * (angle - phase)))
    ax.plot(angle, fit, color=colour, zorder=2)


def _dress(ax: Axes, top: float) -> None:
    ax.grid(color="#d5d5d5", lw=0.5)
    step = next(s for s in (0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10) if top / s <= 4.5)
    rings = np.arange(step, 1.1 * top, step)
    ax.set_yticks(rings, labels=[""] * len(rings))
    ax.set_xticks(np.radians(np.arange(0, 360, 45)))
    ax.minorticks_off()
    ax.tick_params(axis="x", pad=2)
    # Numbers on the rings would hide points, so the label says what a ring is worth.
    ax.set_ylabel(rf"$E(\theta)$ [rad$^{{-1}}$], rings every {step:g}", labelpad=24)
