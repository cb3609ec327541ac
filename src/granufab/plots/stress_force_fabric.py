"""Contacts, branches and forces by direction, and the stress ratio that they predict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.plots.branches import direction_axis
from granufab.plots.style import COLOURS, FIT, INK, POINTS, letter_panels, new_figure, style

__all__ = ["stress_force_fabric", "stress_ratios"]


def stress_force_fabric(data: xr.Dataset, *, ax: Sequence[Axes] | None = None) -> list[Axes]:
    """P_n, <f_n> and <ℓ> over their means, and <f_t> over the mean normal force, by direction.

    Lines are the second-order forms with a, a_n, a_ℓ and a_t.

    Args:
        data: result of :func:`granufab.fabric.stress_force_fabric`.
        ax: two panels to draw into; a new column-wide figure by default.
    Returns:
        The two panels.
    """
    dimension = int(data.attrs["dimension"])
    force, length = float(data["force_0"]), float(data["length_0"])
    whole = np.pi if dimension == 2 else 2.0 * np.pi
    curves = (
        (0, "density", 1.0 / whole, "o", rf"$P_n$, $a={float(data['a']):.3f}$"),
        (0, "normal_force", force, "^", rf"$\langle f_n\rangle$, $a_n={float(data['a_n']):.3f}$"),
        (
            0,
            "mean_length",
            length,
            "s",
            rf"$\langle\ell\rangle$, $a_\ell={float(data['a_l']):.3f}$",
        ),
        (1, "tangential_force", force, "D", rf"$a_t={float(data['a_t']):.3f}$"),
    )
    theta = np.degrees(data["theta"].to_numpy())
    with style():
        panels = list(ax) if ax is not None else new_figure(rows=2, height=4.4)[1]
        for index, (panel, name, scale, marker, label) in enumerate(curves):
            panels[panel].errorbar(
                theta,
                data[name] / scale,
                yerr=data[f"{name}_error"] / scale,
                fmt=marker,
                **POINTS,
                color=COLOURS[index],
                label=label,
            )
            panels[panel].plot(theta, data[f"{name}_fit"] / scale, color=COLOURS[index])
        low, high = panels[0].get_ylim()
        panels[0].set_ylim(low, high + 0.42 * (high - low))
        panels[0].set_ylabel("over the isotropic mean [-]")
        panels[0].legend(loc="upper left")
        panels[0].tick_params(labelbottom=False)
        panels[1].axhline(0.0, color=FIT, lw=0.5)
        panels[1].set_ylabel(r"$\langle f_t\rangle/f_0$ [-]")
        panels[1].legend(loc="upper right" if dimension == 2 else "upper center")
        direction_axis(panels[1], dimension)
        letter_panels(panels)
    return panels


def stress_ratios(states: Mapping[str, xr.Dataset], *, ax: Axes | None = None) -> Axes:
    """Stress ratio predicted by the anisotropies against the measured one, along the axis.

    The line is equality, the band ±3 %.

    Args:
        states: results of :func:`granufab.fabric.stress_force_fabric`, with labels.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    """
    kinds = (
        ("q_over_p_linear", "o", "linear form"),
        ("q_over_p_full", "s", "full form"),
        ("q_over_p_harmonic", "^", "orders 2, 4, 6"),
    )
    with style():
        ax = ax if ax is not None else new_figure(height=2.9)[1][0]
        measured = np.array([float(data["q_over_p_signed"]) for data in states.values()])
        error = np.array([float(data["q_over_p_signed_error"]) for data in states.values()])
        sign = np.where(measured < 0.0, -1.0, 1.0)
        ends = [np.abs(measured).min(), np.abs(measured).max()]
        margin = max(0.25 * (ends[1] - ends[0]), 0.04 * ends[1])
        line = np.array([ends[0] - margin, ends[1] + margin])
        ax.fill_between(line, 0.97 * line, 1.03 * line, color=FIT, alpha=0.2, lw=0)
        ax.plot(line, line, color=INK, lw=0.8)
        for index, (name, marker, label) in enumerate(kinds):
            value = np.array([float(data[name]) for data in states.values()])
            spread = np.array([float(data[f"{name}_error"]) for data in states.values()])
            ax.errorbar(
                sign * measured,
                sign * value,
                xerr=error,
                yerr=spread,
                fmt=marker,
                **POINTS,
                color=COLOURS[index],
                label=label,
            )
        ax.set_xlim(*line)
        ax.set_xlabel("$|q|/p$ measured [-]")
        ax.set_ylabel("$|q|/p$ from the anisotropies [-]")
        ax.legend(loc="upper left")
    return ax
