"""Paths in the (z, a) plane with the limit lines and the critical state (Fig. 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.typing import ColorType

from granufab.errors import MissingData
from granufab.plots.curves import LABELS, Results, collect, column, mean_curve
from granufab.plots.limits import Limits, critical_marker, limit_lines
from granufab.plots.style import new_figure, style

__all__ = ["draw_paths", "path"]


def path(
    *results: Results,
    domain: Limits | None = None,
    z_definition: str = "z_backbone",
    window: float = 0.01,
    ax: Axes | None = None,
) -> Axes:
    """Joint evolution of anisotropy and coordination number [Radjai2012, Fig. 7].

    Open circles mark where the paths start; the limit lines are eq. 19, the shaded region holds
    the accessible states, and the star is the critical state, eqs 20–22.

    Args:
        results: a run, several, or {label: repeats of one path}.
        domain: a domain or a fit of one; None draws the paths alone.
        z_definition: column of the coordination number.
        window: strain over which the running mean is taken; the raw records stay visible.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    Raises:
        MissingData: a series lacks a column, there is no series, or no state has contacts.
    """
    groups = collect(*results)
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        draw_paths(ax, groups, z_definition, window, scaled=False)
        if domain is not None:
            limit_lines(ax, domain, scaled=False)
            critical_marker(ax, domain, scaled=False)
        ax.set_xlabel(LABELS.get(z_definition, z_definition))
        ax.set_ylabel(LABELS["a"])
        ax.legend(loc="best")
    return ax


def draw_paths(
    ax: Axes,
    groups: dict[str, list[xr.Dataset]],
    z_definition: str,
    window: float,
    *,
    scaled: bool,
) -> None:
    """Draw each group as raw records in a light tint and its running mean; a z if ``scaled``."""
    for label, repeats in groups.items():
        (line,) = ax.plot([], [], label=label)
        colour = line.get_color()
        start = []
        for series in repeats:
            z, a = (column(series, name) for name in (z_definition, "a_signed"))
            ax.plot(z, a * z if scaled else a, color=colour, lw=0.4, alpha=0.35, zorder=1.5)
            start.append((z[0], a[0] * z[0] if scaled else a[0]))
        z_curves = mean_curve(repeats, z_definition, against="eps_q_total", window=window)
        a_curves = mean_curve(repeats, "a_signed", against="eps_q_total", window=window)
        for z_curve, a_curve in zip(z_curves, a_curves, strict=True):
            ordinate = a_curve.mean * z_curve.mean if scaled else a_curve.mean
            ax.plot(z_curve.mean, ordinate, color=colour, zorder=3)
        _mark_start(ax, start, colour)
    _fit_view(ax, groups, z_definition, scaled)


def _mark_start(ax: Axes, start: Sequence[tuple[float, float]], colour: ColorType) -> None:
    z, ordinate = np.mean(start, axis=0)
    ax.plot([z], [ordinate], "o", color=colour, mfc="white", mec=colour, mew=1.0, ms=4.5, zorder=4)


def _fit_view(
    ax: Axes, groups: dict[str, list[xr.Dataset]], z_definition: str, scaled: bool
) -> None:
    every = [series for repeats in groups.values() for series in repeats]
    z = np.concatenate([column(series, z_definition) for series in every])
    a = np.concatenate([column(series, "a_signed") for series in every])
    ordinate = a * z if scaled else a
    if not np.isfinite(ordinate).any():
        raise MissingData(f"no state has both {z_definition} and a, so there is no path to draw")
    low, high = float(np.nanmin(z)), float(np.nanmax(z))
    top, bottom = max(float(np.nanmax(ordinate)), 0.0), min(float(np.nanmin(ordinate)), 0.0)
    margin, tall = max(0.07 * (high - low), 0.02), max(top - bottom, 1e-3)
    ax.set_xlim(low - margin, high + margin)
    # Room for the legend on the side that the paths leave zero to.
    above, below = (0.22, 0.04) if top >= -bottom else (0.04, 0.22)
    ax.set_ylim(bottom - below * tall, top + above * tall)
