"""Measured paths beside what an evolution law predicts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from granufab.errors import MissingData
from granufab.plots.curves import LABELS, Results, collect, column, mean_curve
from granufab.plots.limits import Limits, critical_marker, limit_lines
from granufab.plots.path import draw_paths
from granufab.plots.style import FIT, INK, letter_panels, new_figure, style

__all__ = ["evolution"]


def evolution(
    measured: Results,
    predicted: Mapping[str, xr.Dataset],
    *,
    domain: Limits | None = None,
    z_definition: str = "z_backbone",
    window: float = 0.01,
) -> Figure:
    """z and a' against strain and the paths in the (z, a') plane, measured and predicted.

    Tinted bands and coloured lines are the measured running mean and its scatter; dashed black
    lines are the law, between its own band's dotted edges where the prediction has one.

    Args:
        measured: {label: run, series or repeats}; see :func:`granufab.plots.series`.
        predicted: {label: dataset of :func:`granufab.states.predict_evolution` or of
            :meth:`granufab.states.EvolutionFit.predict`}, the same labels.
        domain: accessible domain or its fit, drawn in the third panel; None leaves it out.
        z_definition: column of the measured coordination number.
        window: strain over which the running mean is taken.
    Returns:
        A column-wide figure of three panels: z and a' against cumulative strain, a' against z.
    Raises:
        MissingData: a label is predicted but not measured, or a series lacks a column.
    """
    groups = collect(measured)
    unknown = [label for label in predicted if label not in groups]
    if unknown:
        raise MissingData(
            f"nothing measured is called {unknown[0]!r} (measured: {', '.join(groups)})"
        )
    figure, panels = new_figure(rows=3, height=6.6, share=False, ratios=(1.0, 1.0, 1.25))
    with style():
        names = ((z_definition, "z", "z"), ("a_signed", "a_signed", "a"))
        for panel, (column_name, name, short) in zip(panels[:2], names, strict=True):
            for label, repeats in groups.items():
                _draw_measured(panel, label, repeats, column_name, window)
            for result in predicted.values():
                _draw_predicted(panel, result, name, short)
            panel.set_ylabel(LABELS[column_name])
            panel.set_xlabel(LABELS["eps_q_total"])
            panel.margins(x=0.01)
        bottom, top = panels[0].get_ylim()
        panels[0].set_ylim(bottom - 0.18 * (top - bottom), top)  # room for the letter
        panels[0].tick_params(labelbottom=False)
        panels[0].set_xlabel("")
        panels[1].axhline(0.0, color=FIT, lw=0.5, zorder=0.5)
        panels[0].plot([], [], color=INK, ls=(0, (4, 2)), lw=0.9, label="law")
        panels[0].legend(loc="best")
        _draw_plane(panels[2], groups, predicted, domain, z_definition, window)
        letter_panels(panels)
    return figure


def _draw_measured(
    panel: Axes, label: str, repeats: list[xr.Dataset], name: str, window: float
) -> None:
    (line,) = panel.plot([], [], label=label)
    for curve in mean_curve(repeats, name, against="eps_q_total", window=window):
        low, high = curve.mean - curve.spread, curve.mean + curve.spread
        panel.fill_between(curve.strain, low, high, color=line.get_color(), alpha=0.25, lw=0)
        panel.plot(curve.strain, curve.mean, color=line.get_color())


def _draw_predicted(panel: Axes, result: xr.Dataset, name: str, short: str) -> None:
    strain = column(result, "eps_q_total")
    line: dict[str, Any] = {"color": INK, "zorder": 4}
    panel.plot(strain, column(result, name), ls=(0, (4, 2)), lw=0.9, **line)
    if f"{short}_low" in result:
        for end in ("low", "high"):
            panel.plot(strain, column(result, f"{short}_{end}"), ls=":", lw=0.6, **line)


def _draw_plane(
    panel: Axes,
    groups: dict[str, list[xr.Dataset]],
    predicted: Mapping[str, xr.Dataset],
    domain: Limits | None,
    z_definition: str,
    window: float,
) -> None:
    draw_paths(panel, groups, z_definition, window, scaled=False)
    reversed_ = any(float(np.nanmin(column(r, "a_signed"))) < -0.05 for r in predicted.values())
    if domain is not None:
        limit_lines(panel, domain, scaled=False)
        critical_marker(panel, domain, scaled=False)
    for result in predicted.values():
        z, a = column(result, "z"), column(result, "a_signed")
        panel.plot(z, a, color=INK, ls=(0, (4, 2)), lw=0.9, zorder=4)
    if reversed_:
        panel.axhline(0.0, color=FIT, lw=0.5, zorder=0.5)
    panel.set_xlabel(LABELS[z_definition])
    panel.set_ylabel(LABELS["a_signed"])
    panel.legend(loc="best", handlelength=1.0)
