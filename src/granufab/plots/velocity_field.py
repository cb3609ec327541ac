"""Mean velocity field around a grain (Fig. 4), and how it turns affine with distance."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array
from granufab.plots.style import COLOURS, COLUMN, FIT, INK, new_figure, style

__all__ = ["velocity_field", "velocity_panels", "velocity_profile"]

Part = Literal["velocity", "affine", "difference"]

_FEWEST_PAIRS = 20
_WORST = 0.4
_UNIT = r"\dot{\varepsilon}_q\langle\ell\rangle"
_TITLES = {
    "velocity": "relative velocity",
    "affine": "affine part",
    "difference": "difference",
}
_SHORT = {"velocity": "velocity", "affine": "affine", "difference": "difference"}


def velocity_field(data: xr.Dataset, *, ax: Axes | None = None, part: Part = "velocity") -> Axes:
    """Arrows of the mean relative velocity around a grain [Radjai2012, Fig. 4].

    The grey disk has the radius <ℓ>. Boxes with fewer than 20 pairs stay empty.

    Args:
        data: result of :func:`granufab.fabric.velocity_field`.
        ax: panel to draw into; a new column-wide figure by default.
        part: ``velocity``, its ``affine`` part, or the ``difference`` of the two.
    Returns:
        The panel.
    Raises:
        InvalidSettings: no such part.
        MissingData: no box holds 20 pairs.
    """
    if part not in _TITLES:
        raise InvalidSettings(f"part {part!r} is unknown; allowed: {', '.join(_TITLES)}")
    seen = data["count"].to_numpy() >= _FEWEST_PAIRS
    if not seen.any():
        raise MissingData("no box of the map holds 20 pairs; use more states or a wider spacing")
    with style():
        ax = ax if ax is not None else new_figure(height=3.4)[1][0]
        place = data["position"].to_numpy()[:, seen]
        arrow = data[part].to_numpy()[:, seen]
        step = float(np.diff(data["y"].to_numpy()).mean())
        longest = _longest(data["velocity" if part == "affine" else part].to_numpy()[:, seen])
        ax.add_patch(Circle((0, 0), data.attrs["excluded_radius"], fc="#dcdcdc", ec=FIT, lw=0.6))
        arrows = ax.quiver(
            *place,
            *arrow,
            angles="xy",
            scale_units="xy",
            scale=longest / (1.3 * step),
            width=0.005,
            headwidth=3.6,
            headlength=4,
            headaxislength=3.6,
            minlength=0.5,
            color=COLOURS[1] if part == "difference" else INK,
            zorder=3,
        )
        key = _round(longest)
        label = rf"${key:g}\,{_UNIT}$"
        _dress(ax, data)
        height = 1.022 if data.attrs["section"] == "axisymmetric" else 1.042
        ax.quiverkey(arrows, 0.62, height, key, label, labelpos="E", labelsep=0.05)
        ax.set_title(_TITLES[part], loc="left", pad=4)
    return ax


def velocity_panels(data: xr.Dataset) -> list[Axes]:
    """The field, its affine part and the difference side by side, over two columns.

    Args:
        data: result of :func:`granufab.fabric.velocity_field`.
    Returns:
        The three panels; the difference has its own scale of arrows.
    """
    with style():
        half = data.attrs["section"] == "axisymmetric"
        width, height = (1.6, 3.6) if half else (2.07, 2.75)
        figure, (whole,) = new_figure(width=width * COLUMN, height=height)
        whole.remove()
        grid = figure.add_gridspec(1, 3)
        panels = [figure.add_subplot(grid[0, column]) for column in range(3)]
        parts: tuple[Part, ...] = ("velocity", "affine", "difference")
        for panel, part, letter in zip(panels, parts, "abc", strict=True):
            velocity_field(data, ax=panel, part=part)
            panel.set_title(f"({letter}) {_SHORT[part]}", loc="left", pad=4)
        for panel in panels[1:]:
            panel.set_ylabel("")
            panel.tick_params(labelleft=False)
    return panels


def velocity_profile(data: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Relative velocity along and across the branch over its affine value, by distance.

    Args:
        data: result of :func:`granufab.fabric.velocity_field`.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, with bands of ± one standard error; 1 is affine. Shells with fewer than 20
        pairs or an error above 0.4 are left out.
    """
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        distance = data["distance"].to_numpy()
        names = ("normal_share_error", "tangential_share_error")
        worst = np.fmax(*(data[name].to_numpy() for name in names))
        enough = (data["pair_count"].to_numpy() >= _FEWEST_PAIRS) & ~(worst > _WORST)
        ax.axhline(1.0, color=FIT, lw=0.7)
        ax.axvline(data.attrs["excluded_radius"], color=FIT, lw=0.7, ls=":")
        for name, marker, colour, label in (
            ("normal_share", "o", COLOURS[0], "along the branch"),
            ("tangential_share", "s", COLOURS[1], "across"),
        ):
            value, error = (data[key].to_numpy()[enough] for key in (name, f"{name}_error"))
            ax.fill_between(
                distance[enough], value - error, value + error, color=colour, alpha=0.25, lw=0
            )
            ax.plot(distance[enough], value, marker, ls="-", ms=2.4, color=colour, label=label)
        ax.set_xlabel(r"$|r_j - r_i|/\langle\ell\rangle$ [-]")
        ax.set_ylabel("relative velocity / affine [-]")
        ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
        ax.legend(loc="best")
    return ax


def _dress(ax: Axes, data: xr.Dataset) -> None:
    half = data.attrs["section"] == "axisymmetric"
    reach = float(data["y"].max() + 0.5 * np.diff(data["y"].to_numpy()).mean())
    ax.set_xlim(0 if half else -reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
    names = (r"\rho", r"\zeta") if half else _axis_symbols(data)
    ax.set_xlabel(rf"${names[0]}/\langle\ell\rangle$ [-]")
    ax.set_ylabel(rf"${names[1]}/\langle\ell\rangle$ [-]")


def _axis_symbols(data: xr.Dataset) -> tuple[str, str]:
    """x, y or z where the section's axes are those of the frame."""
    rows = np.asarray(data.attrs["basis"]).reshape(2, -1)
    if not np.allclose(rows.max(axis=1), 1.0, atol=1e-6):
        return "x_1", "x_2"
    first, second = ("xyz"[k] for k in np.argmax(rows, axis=1))
    return first, second


def _longest(arrow: Array) -> float:
    """Length that scales a panel; the field and its affine part share theirs."""
    return float(np.quantile(np.hypot(*arrow), 0.99)) or 1.0


def _round(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``value``."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m * power for m in (1.0, 2.0, 5.0) if m * power <= value * (1 + 1e-12)))
