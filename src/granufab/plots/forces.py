"""Distribution of contact forces and of the friction that they mobilise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.errors import MissingData
from granufab.plots.style import COLOURS, FIT, INK, POINTS, new_figure, style

__all__ = ["force_density", "mobilisation"]

MARKERS = ("o", "^", "s", "D")
Results = xr.Dataset | Mapping[str, xr.Dataset]


def force_density(
    results: Results, *, logarithmic_force: bool = True, ax: Axes | None = None
) -> Axes:
    """Density of f_n/<f_n> with the power law below the mean and the exponential above it.

    Args:
        results: result of :func:`granufab.fabric.force_statistics`, or several with labels.
        logarithmic_force: log-log axes, where a power law is straight; else the abscissa is
            linear, where an exponential is straight.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    """
    several = {"": results} if isinstance(results, xr.Dataset) else results
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        ax.set_yscale("log")
        if logarithmic_force:
            ax.set_xscale("log")
        for index, (label, data) in enumerate(several.items()):
            colour = COLOURS[index % len(COLOURS)]
            _points(ax, data, MARKERS[index % len(MARKERS)], colour, label, logarithmic_force)
            _laws(ax, data, colour)
        ax.axvline(1.0, color=FIT, lw=0.7, ls=":", zorder=0.5)
        ax.set_xlabel(r"normal force $f_n/\langle f_n\rangle$ [-]")
        ax.set_ylabel(r"$\langle f_n\rangle P$ [-]")
        if any(several):
            ax.legend(loc="lower left")
    return ax


def mobilisation(results: Results, *, ax: Axes | None = None) -> Axes:
    """Density of the mobilised friction |f_t|/(µ f_n); sliding contacts stand in the last bin.

    Args:
        results: result of :func:`granufab.fabric.force_statistics` with µ, or several with
            labels.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    Raises:
        MissingData: a result was made without µ.
    """
    several = {"": results} if isinstance(results, xr.Dataset) else results
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        for index, (label, data) in enumerate(several.items()):
            if "mobilisation" not in data:
                raise MissingData("mobilised friction needs the coefficient of friction")
            text = f"sliding {100 * float(data['sliding_fraction']):.1f} %"
            value = data["mobilisation"].to_numpy()
            density, error = (
                data[name].to_numpy() for name in ("P_mobilisation", "P_mobilisation_error")
            )
            colour = COLOURS[index % len(COLOURS)]
            name = f"{label}: {text}" if label else text
            ax.plot(value, density, drawstyle="steps-mid", color=colour, label=name)
            ax.fill_between(
                value, density - error, density + error, step="mid", color=colour, alpha=0.25, lw=0
            )
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        ax.set_ylim(10.0 ** np.floor(np.log10(low)), 10.0 ** np.ceil(np.log10(high)))
        ax.set_xlim(0.0, 1.0)
        ax.set_xlabel(r"mobilised friction $|f_t|/(\mu f_n)$ [-]")
        ax.set_ylabel("probability density [-]")
        ax.legend(loc="upper center")
    return ax


def _points(
    ax: Axes, data: xr.Dataset, marker: str, colour: str, label: str, everything: bool
) -> None:
    x, density = data["x"].to_numpy(), data["P_force"].to_numpy()
    # On a linear abscissa the many bins of weak forces would cover each other.
    shown = (density > 0) & (everything | (x > 0.05))
    ax.errorbar(
        x[shown],
        density[shown],
        yerr=np.minimum(data["P_force_error"].to_numpy()[shown], 0.9 * density[shown]),
        fmt=marker,
        **POINTS,
        color=colour,
        label=label or None,
    )


def _laws(ax: Axes, data: xr.Dataset, colour: str) -> None:
    """The two laws over their ranges, each holding as many contacts as the data there."""
    x, density = data["x"].to_numpy(), data["P_force"].to_numpy()
    ratio = x[1] / x[0]
    mass = density * x * (np.sqrt(ratio) - 1.0 / np.sqrt(ratio))
    first = float(data.attrs["weak_from"])
    alpha, beta = float(data["weak_exponent"]), float(data["strong_decay"])
    low, high = np.geomspace(first, 1.0, 50), np.geomspace(1.0, x[-1], 50)
    weak = mass[(x > first) & (x < 1.0)].sum()
    strong = float(data["contact_share"].sel(part="strong"))
    power = low**alpha
    power *= weak / np.trapezoid(power, low)
    style = {"color": INK if colour == COLOURS[0] else colour, "lw": 1.0, "zorder": 4}
    ax.plot(low, power, **style)
    ax.plot(high, strong * beta * np.exp(-beta * (high - 1.0)), **style, ls="--")
    if ax.get_legend_handles_labels()[1] == []:
        text = rf"$\alpha={alpha:.2f}$, $\beta={beta:.2f}$"
        linear = ax.get_xscale() == "linear"
        where = {"x": 0.96, "y": 0.94, "ha": "right", "va": "top"}
        where = where if linear else {"x": 0.05, "y": 0.06, "ha": "left", "va": "bottom"}
        ax.text(s=text, transform=ax.transAxes, **where)
