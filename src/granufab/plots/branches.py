"""Branch lengths: their density, and their mean by direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.plots.style import COLOURS, POINTS, letter_panels, new_figure, style

__all__ = ["branches", "branches_joint", "direction_axis"]


def branches(data: xr.Dataset, *, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """P_ℓ(ℓ), and <ℓ>(θ) with error bars and its second-order fit [Radjai2012, §2].

    Lengths are in units of their mean.

    Args:
        data: result of :func:`granufab.fabric.branches`.
        ax: two panels to draw into; a new column-wide figure by default.
    Returns:
        The two panels.
    """
    mean = float(data["average_length"])
    with style():
        panels = list(ax) if ax is not None else new_figure(rows=2, share=False)[1]
        length = data["length"].to_numpy() / mean
        density, error = (mean * data[name].to_numpy() for name in ("P_length", "P_length_error"))
        (line,) = panels[0].plot(length, density, drawstyle="steps-mid")
        low, high = density - error, density + error
        panels[0].fill_between(
            length, low, high, step="mid", color=line.get_color(), alpha=0.25, lw=0
        )
        panels[0].set_xlim(left=length[0] - 0.16 * (length[-1] - length[0]) - 1e-6)
        panels[0].set_ylim(bottom=0.0)
        panels[0].set_xlabel(r"branch length $\ell/\langle\ell\rangle$ [-]")
        panels[0].set_ylabel(r"$\langle\ell\rangle\,P_\ell$ [-]")
        theta = np.degrees(data["theta"].to_numpy())
        panels[1].errorbar(
            theta,
            data["mean_length"] / mean,
            yerr=data["mean_length_error"] / mean,
            fmt="o",
            **POINTS,
            color=COLOURS[0],
        )
        panels[1].plot(theta, data["mean_length_fit"] / mean, color=COLOURS[0])
        low, high = panels[1].get_ylim()
        panels[1].set_ylim(low - 0.14 * (high - low), high)
        direction_axis(panels[1], int(data.attrs["dimension"]))
        panels[1].set_ylabel(r"$\langle\ell\rangle(\theta)/\langle\ell\rangle$ [-]")
        letter_panels(panels)
    return panels


def branches_joint(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Joint density P_ℓn(ℓ, θ), times the mean length, as a map [Radjai2012, §2].

    Args:
        data: result of :func:`granufab.fabric.branches`.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    """
    mean, plane = float(data["average_length"]), data.attrs["dimension"] == 2
    bins = data.sizes["theta"]
    if plane:
        edges = np.linspace(0.0, 180.0, bins + 1)
    else:
        edges = np.degrees(np.arccos(np.linspace(1.0, 0.0, bins + 1)))
    length = data["length"].to_numpy() / mean
    step = length[1] - length[0] if len(length) > 1 else 1e-3
    length_edges = np.append(length - 0.5 * step, length[-1] + 0.5 * step)
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        image = ax.pcolormesh(
            edges, length_edges, mean * data["P_joint"].to_numpy(), cmap="Blues", rasterized=True
        )
        figure = ax.get_figure(root=True)
        assert figure is not None
        bar = figure.colorbar(image, ax=ax, pad=0.02)
        unit = r"rad$^{-1}$" if plane else r"sr$^{-1}$"
        bar.set_label(rf"$\langle\ell\rangle\,P_{{\ell n}}$ [{unit}]")
        bar.outline.set_linewidth(0.6)  # pyright: ignore[reportCallIssue]
        direction_axis(ax, 2 if plane else 3)
        ax.set_ylabel(r"$\ell/\langle\ell\rangle$ [-]")
    return ax


def direction_axis(ax: Axes, dimension: int) -> None:
    """Abscissa over half of all directions, in degrees."""
    last, step = (180, 45) if dimension == 2 else (90, 15)
    ax.set_xlim(0, last)
    ax.set_xticks(np.arange(0, last + 1, step))
    where = "from the $x$ axis" if dimension == 2 else "from the symmetry axis"
    ax.set_xlabel(rf"direction $\theta$ {where} [degree]")
