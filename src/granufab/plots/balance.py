"""Figures of the detailed balance: terms by direction, attribution along a path, sampling."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.ticker import LogFormatter

from granufab.errors import MissingData
from granufab.fabric import average_balance
from granufab.packing import Array
from granufab.plots.curves import LABELS, running_mean
from granufab.plots.style import COLOURS, COLUMN, INK, POINTS, new_figure, style

__all__ = ["attribution", "balance", "sampling_rates"]

BLUE, RED, GREEN = COLOURS[:3]


def balance(data: xr.Dataset, *, window: tuple[float, float] | None = None) -> list[Axes]:
    r"""Gain, loss and current by direction over a window of strain [Radjai2012, eq. 16].

    Top: I⁺ and I⁻. Middle: the net gain I = I⁺ − I⁻ (steps, 1 σ band) beside ∂J/∂θ of the
    measured current; the two agree in a steady state. Bottom: J, measured and of contacts that
    turn with the mean flow. In 3D everything is summed over azimuth and drawn against cos θ, and
    J is per unit of solid angle, ∂J/∂Ω.

    Args:
        data: result of :func:`granufab.fabric.balance_run`, or of
            :func:`granufab.fabric.average_balance`.
        window: ∫|dε_q| from and to, as for :func:`granufab.fabric.average_balance`.
    Returns:
        The three panels from top to bottom.
    Raises:
        MissingData: no interval lies in the window.
    """
    mean = average_balance(data, window=window) if "interval" in data.dims else data
    plane = mean.attrs["dimension"] == 2
    with style():
        panels = new_figure(height=1.75 * COLUMN, rows=3)[1]
        x, edges = _abscissa(mean)
        _draw_rates(panels[0], mean, x)
        _draw_net(panels[1], mean, x, edges)
        _draw_current(panels[2], mean, edges)
        unit = "rad" if plane else "sr"
        panels[0].set_ylabel(rf"$I^{{\pm}}$ [{unit}$^{{-1}}$]")
        slope = r"\partial J/\partial\theta" if plane else r"\partial J/\partial\Omega"
        panels[1].set_ylabel(rf"$I,\ {slope}$ [{unit}$^{{-1}}$]")
        panels[2].set_ylabel(r"$J$ [-]")
        panels[2].set_xlabel(r"$\theta$ [$^\circ$]" if plane else r"$\cos\theta$ [-]")
        if plane:
            panels[2].set_xlim(-90, 90)
            panels[2].set_xticks(np.arange(-90, 91, 45))
        else:
            panels[2].set_xlim(1, 0)
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
    return panels


def _abscissa(mean: xr.Dataset) -> tuple[Array, Array]:
    """Middles and edges: θ from −90° to 90° about the direction in 2D, cos θ in 3D."""
    theta, edge = mean["theta"].to_numpy(), mean["theta_edge"].to_numpy()
    if mean.attrs["dimension"] == 3:
        return 0.5 * (np.cos(edge[1:]) + np.cos(edge[:-1])), np.cos(edge)
    return np.degrees(theta), np.degrees(edge)


def _turn(mean: xr.Dataset, *columns: Array) -> list[Array]:
    """Bins in the order of the abscissa: in 2D the second half of [0, π) comes first."""
    if mean.attrs["dimension"] == 3:
        return list(columns)
    angle = columns[0]
    moved = np.where(angle >= 90.0, angle - 180.0, angle)
    order = np.argsort(moved)
    return [moved[order], *(column[order] for column in columns[1:])]


def _draw_rates(ax: Axes, mean: xr.Dataset, x: Array) -> None:
    for name, label, marker, colour in (
        ("gain", "gain $I^+$", "o", BLUE),
        ("loss", "loss $I^-$", "s", RED),
    ):
        rate, error = (mean[f"{name}_rate{end}"].to_numpy() for end in ("", "_error"))
        _points(ax, *_turn(mean, x, rate, error), label=label, marker=marker, colour=colour)
    ax.set_ylim(bottom=0)
    ax.margins(y=0.25)
    ax.legend(loc="lower center", ncols=2)


def _draw_net(ax: Axes, mean: xr.Dataset, x: Array, edges: Array) -> None:
    names = ("net_rate", "net_rate_error", "divergence", "divergence_error")
    columns = [mean[name].to_numpy() for name in names]
    place, net, net_error, slope, slope_error = _turn(mean, x, *columns)
    half = 0.5 * np.abs(edges[1] - edges[0])
    for middle, value, error in zip(place, net, net_error, strict=True):
        span = [middle - half, middle + half]
        ax.fill_between(span, value - error, value + error, color=INK, alpha=0.15, lw=0)
        ax.plot(span, [value, value], color=INK)
    ax.plot([], [], color=INK, label="$I = I^+ - I^-$")
    label = (
        r"$\partial J/\partial\theta$"
        if mean.attrs["dimension"] == 2
        else (r"$\partial J/\partial\Omega$")
    )
    _points(ax, place, slope, slope_error, label=label, marker="D", colour=GREEN)
    ax.axhline(0, color=INK, lw=0.5)
    ax.margins(y=0.3)
    ax.legend(loc="upper center", ncols=2)


def _draw_current(ax: Axes, mean: xr.Dataset, edges: Array) -> None:
    names = ("current_rate", "current_rate_error", "current_rate_affine")
    columns = [mean[name].to_numpy() for name in names]
    if mean.attrs["dimension"] == 2:  # the last edge is the first; ±90° are one edge, drawn twice
        columns = _turn(mean, edges[:-1], *(column[:-1] for column in columns))
        edges = np.append(columns[0], columns[0][0] + 180.0)
        columns = [np.append(column, column[0]) for column in columns[1:]]
    place, (current, error, affine) = edges, columns
    _points(ax, place, current, error, label="measured", marker="D", colour=GREEN)
    ax.plot(place, affine, color=GREEN, ls="--", label="affine")
    ax.axhline(0, color=INK, lw=0.5)
    ax.margins(y=0.3)
    ax.legend(loc="upper left")


def _points(
    ax: Axes, x: Array, y: Array, error: Array, *, label: str, marker: str, colour: str
) -> ErrorbarContainer:
    return ax.errorbar(x, y, yerr=error, fmt=marker, color=colour, label=label, zorder=3, **POINTS)


def attribution(data: xr.Dataset, *, smooth: float = 0.05) -> list[Axes]:
    """What changes z and z a' along a path: gain, loss and rotation, per unit of ∫|dε_q|.

    Lines are running means over ``smooth`` of strain within each stage, bands their standard
    errors. Dashed: the rotation of contacts that turn with the mean flow.

    Args:
        data: result of :func:`granufab.fabric.balance_run`.
        smooth: strain of the running mean, 0 for none.
    Returns:
        The panels of dz/dε_q and of d(z a')/dε_q.
    Raises:
        MissingData: no interval has strain.
    """
    moving = np.isfinite(data["current_rate"].to_numpy()).all(axis=1)
    if not moving.any():
        raise MissingData("no interval of the run has any strain, so there are no rates to draw")
    data = data.isel(interval=np.flatnonzero(moving))
    with style():
        panels = new_figure(height=1.35 * COLUMN, rows=2)[1]
        stage = data["stage"].to_numpy()
        for number in np.unique(stage):
            part = data.isel(interval=np.flatnonzero(stage == number))
            first = number == stage[0]
            for name, colour, label in _PARTS:
                for panel, quantity in zip(panels, ("z", "az"), strict=True):
                    if quantity == "z" and name == "rotation":
                        continue
                    _line(panel, part, f"{quantity}_{name}", colour, label, smooth, first)
            _dashed(panels[1], part, smooth, first)
        for panel in panels:
            panel.axhline(0, color=INK, lw=0.5)
        panels[0].set_ylabel(r"$\mathrm{d}z/\mathrm{d}\varepsilon_q$ [-]")
        panels[1].set_ylabel("$\\mathrm{d}(za$\N{PRIME}$)/\\mathrm{d}\\varepsilon_q$ [-]")
        panels[1].set_xlabel(LABELS["eps_q_total"])
        panels[0].tick_params(labelbottom=False)
        panels[1].margins(y=0.05)
        panels[0].legend(
            *panels[1].get_legend_handles_labels(),
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            ncols=3,
            columnspacing=1.0,
        )
    return panels


_PARTS = (
    ("gain", BLUE, "gain"),
    ("loss", RED, "loss"),
    ("rotation", GREEN, "rotation"),
    ("total", INK, "sum"),
)


def _line(
    ax: Axes, part: xr.Dataset, name: str, colour: str, label: str, smooth: float, named: bool
) -> None:
    quantity = name.split("_")[0]
    if name.endswith("total"):
        parts = [f"{quantity}_{p}" for p in ("gain", "loss", "rotation")]
        value = part[f"{quantity}_after"] - part[f"{quantity}_before"]
        held = [part[f"{p}_error"] for p in parts if f"{p}_error" in part]
        error = np.sqrt(sum((e.to_numpy() ** 2 for e in held), np.zeros(part.sizes["interval"])))
    else:
        value, error = part[name], part[f"{name}_error"].to_numpy()
    strain, rate = _smoothed(part, value.to_numpy(), smooth)
    _, single = _smoothed(part, error, 0.0)
    travelled = strain - strain[0]  # the window shrinks towards both ends
    reach = np.minimum(smooth / 2, np.minimum(travelled, travelled[-1] - travelled))
    band = single / np.sqrt(1.0 + 2.0 * reach / part["strain"].to_numpy())
    ax.plot(strain, rate, color=colour, label=label if named else None)
    ax.fill_between(strain, rate - band, rate + band, color=colour, alpha=0.2, lw=0)


def _dashed(ax: Axes, part: xr.Dataset, smooth: float, named: bool) -> None:
    strain, rate = _smoothed(part, part["az_rotation_affine"].to_numpy(), smooth)
    ax.plot(strain, rate, color=GREEN, ls="--", label="rotation, affine" if named else None)


def _smoothed(part: xr.Dataset, change: Array, smooth: float) -> tuple[Array, Array]:
    """Middle of each interval, and the running mean of a change per unit strain."""
    low, high = (part[name].to_numpy() for name in ("eps_q_total_before", "eps_q_total"))
    strain = 0.5 * (low + high)
    return strain, running_mean(strain, change / part["strain"].to_numpy(), smooth)[0]


def sampling_rates(rates: xr.Dataset | Mapping[str, xr.Dataset], *, ax: Axes | None = None) -> Axes:
    """Rates of gain and loss against the sampling strain, on logarithmic axes.

    Args:
        rates: result of :func:`granufab.fabric.rates_by_sampling`, or several with labels, such
            as one per criterion.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel. Full symbols are gains, open ones losses.
    """
    several = {"": rates} if isinstance(rates, xr.Dataset) else dict(rates)
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        for index, (label, data) in enumerate(several.items()):
            colour = COLOURS[index % len(COLOURS)]
            strain = data["strain"].to_numpy()
            for name, fill in (("gain", colour), ("loss", "white")):
                rate, error = (data[f"{name}_rate{end}"].to_numpy() for end in ("", "_error"))
                text = f"{label}: {name}" if label else name
                look = {"fmt": "o-" if name == "gain" else "s--", "ms": 3.5, "mew": 0.8}
                ax.errorbar(
                    strain, rate, yerr=error, color=colour, mfc=fill, label=text, lw=0.8, **look
                )
        ax.set_xscale("log")
        ax.set_yscale("log")
        for which in (ax.yaxis.set_major_formatter, ax.yaxis.set_minor_formatter):
            which(LogFormatter(minor_thresholds=(1.2, 0.5)))
        ax.set_xlabel(r"$\Delta\varepsilon_q$ between the states [-]")
        ax.set_ylabel("contacts per grain and strain [-]")
        ax.legend()
    return ax
