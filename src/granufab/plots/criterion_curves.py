"""z, a and az against the contact criterion: force threshold beside gap threshold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from matplotlib.typing import ColorType

from granufab.errors import MissingData
from granufab.plots.style import FIT, INK, new_figure, style

__all__ = ["criterion_curves"]

_ROWS = (
    ("z", "$z$ [-]", "$z$ [-]"),
    ("a", "$a$ [-]", "$a$\N{PRIME} [-]"),
    ("az", r"$a\,z$ [-]", "$a$\N{PRIME}$\\,z$ [-]"),
)
_COLUMNS = (
    ("force", r"$f_n/\langle f_n\rangle$ above [-]"),
    ("gap", r"gap below [$d$]"),
)


def criterion_curves(curves: xr.Dataset | Mapping[str, xr.Dataset]) -> list[Axes]:
    """z, a and a z against the force and the gap threshold, with bands of one standard error.

    Both columns share their ordinates. The dotted level is the value at the default criterion,
    f_n > 10⁻⁶ <f_n>, marked by the open circle. a is signed where the curves' attributes say so.

    Args:
        curves: result of :func:`granufab.fabric.criterion_curves`, or several with labels.
    Returns:
        The six panels, row by row; of one column only where the data hold no forces.
    Raises:
        MissingData: there is nothing to draw.
    """
    several = {"": curves} if isinstance(curves, xr.Dataset) else curves
    shown = [c for c in _COLUMNS if any(f"z_{c[0]}" in data for data in several.values())]
    if not shown:
        raise MissingData("criterion curves need at least one data set with z_force or z_gap")
    with style():
        panels = _panels(len(shown))
        signed = all(data.attrs["anisotropy"] == "signed" for data in several.values())
        for row, (name, unsigned_symbol, signed_symbol) in enumerate(_ROWS):
            for column, (kind, _) in enumerate(shown):
                ax = panels[row * len(shown) + column]
                for index, (label, data) in enumerate(several.items()):
                    if f"{name}_{kind}" in data:
                        _draw(ax, data, name, kind, f"C{index}", label)
            panels[row * len(shown)].set_ylabel(signed_symbol if signed else unsigned_symbol)
        for ax, (_, text) in zip(panels[-len(shown) :], shown, strict=True):
            ax.set_xlabel(text)
        if any(several):
            panels[0].legend(loc="lower left")
    return panels


def _panels(columns: int) -> list[Axes]:
    figure, first = new_figure(height=4.2, rows=3)
    if columns == 1:
        panels = first
    else:
        figure.clear()
        grid = figure.subplots(3, columns, sharex="col", sharey="row")
        panels = list(grid.ravel())
    for ax in panels:
        ax.set_xscale("log")
        ax.yaxis.set_major_locator(MaxNLocator(5))
        ax.margins(y=0.12)
        ax.label_outer()
    return panels


def _draw(ax: Axes, data: xr.Dataset, name: str, kind: str, colour: ColorType, label: str) -> None:
    axis, value = f"{kind}_threshold", data[f"{name}_{kind}"].to_numpy()
    threshold, error = data[axis].to_numpy(), data[f"{name}_{kind}_error"].to_numpy()
    ax.plot(threshold, value, color=colour, label=label or None, zorder=3)
    band = np.nan_to_num(error)
    ax.fill_between(threshold, value - band, value + band, color=colour, alpha=0.25, lw=0)
    if f"{name}_force" not in data:
        return
    standard = float(data.attrs["default_force_threshold"])
    force = data["force_threshold"].to_numpy()
    level = float(np.interp(np.log(standard), np.log(force), data[f"{name}_force"].to_numpy()))
    ax.axhline(level, color=FIT, lw=0.6, ls=":", zorder=1)
    if kind == "force":
        ax.plot([standard], [level], "o", mfc="white", mec=INK, mew=0.8, ms=4, zorder=4)
