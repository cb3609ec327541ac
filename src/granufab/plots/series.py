"""Coordination number and signed anisotropy against strain (Fig. 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.errors import MissingData
from granufab.plots.curves import LABELS, Results, collect, column, mean_curve, stages
from granufab.plots.style import FIT, letter_panels, new_figure, style

__all__ = ["series"]


def series(
    *results: Results,
    columns: Sequence[str] = ("z_backbone", "a_signed"),
    against: str = "eps_q_total",
    window: float = 0.01,
    critical: Sequence[float | None] | None = None,
    ax: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Fabric parameters along the strain path, one panel each [Radjai2012, Fig. 5].

    Lines are running means; bands hold one standard deviation, over the repeats where there are
    several, else of the fluctuations in the window. A dotted upright marks a reversal.

    Args:
        results: a run, several, or {label: repeats of one path}.
        columns: what is drawn, from top to bottom.
        against: ``eps_q_total`` (cumulative strain) or ``eps_q`` (running strain).
        window: strain over which the running mean is taken.
        critical: value of the critical state in each panel, or None.
        ax: as many panels as columns; a new column-wide figure by default.
    Returns:
        The panels, from top to bottom.
    Raises:
        MissingData: a series lacks a column, there is no series, or no strain is known.
    """
    groups = collect(*results)
    for label, repeats in groups.items():
        if not np.isfinite(column(repeats[0], against)).any():
            raise MissingData(f"{label}: no strain is known ({against}); give --strain (per frame)")
    with style():
        panels = list(ax) if ax is not None else new_figure(rows=len(columns), height=4.2)[1]
        for index, (panel, name) in enumerate(zip(panels, columns, strict=True)):
            if critical is not None and critical[index] is not None:
                panel.axhline(float(critical[index] or 0.0), color=FIT, lw=0.7, ls=(0, (4, 3)))
            for label, repeats in groups.items():
                _draw(panel, label, repeats, name, against, window)
            _mark_reversals(panel, groups, against)
            panel.set_ylabel(LABELS.get(name, f"{name} [-]"))
        if "a_signed" in columns:
            panel = panels[list(columns).index("a_signed")]
            if panel.get_ylim()[0] < -0.02:
                panel.axhline(0.0, color=FIT, lw=0.5)
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
        panels[-1].set_xlabel(
            r"cumulative $\varepsilon_q$ [-]" if against == "eps_q_total" else LABELS["eps_q"]
        )
        panels[0].legend(loc="best")
        if len(panels) > 1:
            letter_panels(panels)
    return panels


def _draw(
    panel: Axes, label: str, repeats: list[xr.Dataset], name: str, against: str, window: float
) -> None:
    (line,) = panel.plot([], [], label=label)
    colour = line.get_color()
    for curve in mean_curve(repeats, name, against=against, window=window):
        low, high = curve.mean - curve.spread, curve.mean + curve.spread
        panel.fill_between(curve.strain, low, high, color=colour, alpha=0.22, lw=0)
        panel.plot(curve.strain, curve.mean, color=colour)


def _mark_reversals(panel: Axes, groups: dict[str, list[xr.Dataset]], against: str) -> None:
    turns = {
        round(float(column(repeats[0], against)[part.stop - 1]), 6)
        for repeats in groups.values()
        for part in stages(repeats[0])[:-1]
    }
    for turn in turns:
        panel.axvline(turn, color=FIT, lw=0.7, ls=":", zorder=0.5)
    last = max(float(np.nanmax(column(r[0], against))) for r in groups.values())
    first = min(float(np.nanmin(column(r[0], against))) for r in groups.values())
    panel.set_xlim(first - 0.01 * (last - first), last + 0.01 * (last - first))
