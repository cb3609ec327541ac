"""Connectivity, angles between contacts, and the room that excluded volume leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.plots.branches import direction_axis
from granufab.plots.style import COLOURS, FIT, INK, POINTS, new_figure, style
from granufab.states import window_occupation

__all__ = ["occupation", "texture"]


def texture(data: xr.Dataset, *, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """Fraction of grains with c contacts, and the angles that these leave each other.

    The dashed upright is δθ, the dotted one its geometric value.

    Args:
        data: result of :func:`granufab.fabric.texture`.
        ax: two panels to draw into; a new column-wide figure by default.
    Returns:
        The two panels.
    """
    with style():
        panels = list(ax) if ax is not None else new_figure(rows=2, share=False)[1]
        number = data["contact_number"].to_numpy()
        rows = (("fraction", "all grains"), ("fraction_backbone", "grains in use"))
        for index, (name, label) in enumerate(rows):
            panels[0].bar(
                number + 0.4 * (index - 0.5),
                data[name],
                0.38,
                yerr=data[f"{name}_error"],
                color=COLOURS[index],
                error_kw={"lw": 0.7, "ecolor": INK},
                label=label,
            )
        panels[0].set_xticks(number)
        panels[0].tick_params(axis="x", which="minor", length=0)
        panels[0].set_xlabel("contacts of a grain $c$ [-]")
        panels[0].set_ylabel("fraction $P_c$ [-]")
        panels[0].legend(loc="upper right")
        _angles(panels[1], data)
    return panels


def occupation(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Contacts of a grain in a window δθ against the window's centre [Radjai2012, eq. 17].

    Points are counted, the line is the second-order E; 1 is the limit of excluded volume.

    Args:
        data: result of :func:`granufab.fabric.texture`.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    """
    plane = data.attrs["dimension"] == 2
    theta = data["theta"].to_numpy()
    fit = window_occupation(
        float(data["z"]),
        float(data["a"]),
        float(data.attrs["window"]),
        theta - np.radians(float(data["theta_c"])) if plane else theta,
        dimension=int(data.attrs["dimension"]),
    )
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        ax.errorbar(
            np.degrees(theta),
            data["occupation"],
            yerr=data["occupation_error"],
            fmt="o",
            **POINTS,
            label="counted",
        )
        ax.plot(np.degrees(theta), fit, color=COLOURS[0], label="second-order $E$")
        ax.axhline(1.0, color=FIT, lw=0.8, ls=(0, (4, 3)))
        ax.set_ylim(0.0, 1.1)
        direction_axis(ax, 2 if plane else 3)
        ax.set_ylabel(r"$\int_{\delta\theta}\;E\,\mathrm{d}\theta$ [contacts]")
        ax.legend(loc="upper left", bbox_to_anchor=(0.0, 0.9))
    return ax


def _angles(panel: Axes, data: xr.Dataset) -> None:
    angle = np.degrees(data["angle"].to_numpy())
    plane = data.attrs["dimension"] == 2
    curves = [("P_angle", "successive" if plane else "nearest")]
    curves += [] if plane else [("P_pair", "all pairs")]
    for index, (name, label) in enumerate(curves):
        density, error = (np.radians(data[column].to_numpy()) for column in (name, f"{name}_error"))
        panel.plot(angle, density, drawstyle="steps-mid", color=COLOURS[index], label=label)
        panel.fill_between(
            angle,
            density - error,
            density + error,
            step="mid",
            color=COLOURS[index],
            alpha=0.25,
            lw=0,
        )
    marks = (("delta_theta", "--", r"$\delta\theta$"), ("delta_theta_geometric", ":", "geometric"))
    for name, dash, label in marks:
        value = np.degrees(float(data[name]))
        panel.axvline(value, color=INK, lw=0.8, ls=dash, label=rf"{label} = {value:.1f}$^\circ$")
    last = 360 if plane else 180
    panel.set_xlim(0, last)
    panel.set_xticks(np.arange(0, last + 1, last // 6))
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("angle between contacts [degree]")
    panel.set_ylabel(r"density [degree$^{-1}$]")
    panel.legend(loc="upper right")
