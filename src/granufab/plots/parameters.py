"""Results of a campaign over a parameter: z*(µ), a*(µ), z_min(µ), z_max(µ)…"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array
from granufab.plots.style import COLUMN, POINTS, letter_panels, new_figure, style

__all__ = ["QUANTITIES", "parameter_curves"]

QUANTITIES = ("z_star", "a_star", "z_min", "z_max")
"""What is drawn unless something else is asked for."""

SYMBOLS = {
    "z_star": r"$z^*$ [-]",
    "a_star": r"$a^*$ [-]",
    "z_min": r"$z_\mathrm{min}$ [-]",
    "z_max": r"$z_\mathrm{max}$ [-]",
    "q_over_p_star": r"$(q/p)^*$ [-]",
    "phi_star": r"$\phi^*$ [-]",
    "z_0": r"$z_0$ [-]",
    "residual_max": "largest residual [-]",
    "nonconverged_share": "steps not converged [-]",
    "overlap_max": "worst overlap [$d$]",
    "inertial_number_max": r"$I$ [-]",
}

NAMES = {
    "material.friction": r"$\mu$",
    "sample.friction": r"$\mu_\mathrm{c}$",
    "sample.coordination": r"wanted $z_0$",
    "sample.grain_count": r"$N$",
    "inertial_number": r"$I$",
    "strain": r"$\varepsilon_q$",
}

MARKERS = "osD^vP*X"
LOG_RATIO = 30.0  # an axis of positive values that span more is logarithmic


def parameter_curves(
    results: xr.Dataset,
    against: str,
    *,
    by: str | None = None,
    quantities: Sequence[str] = QUANTITIES,
    where: Mapping[str, Any] | None = None,
    axes: Sequence[Axes] | None = None,
) -> list[Axes]:
    """Draw results of a campaign over a parameter, one panel for each quantity.

    Points are values over all seeds of the same parameters, bands and bars their 95 % intervals.
    Where a third parameter differs between the points (a Latin hypercube) no lines join them.

    Args:
        results: from :func:`granufab.campaign.gather`, or ``results.nc``.
        against: parameter on the abscissa: its column, or its key (material.friction).
        by: second parameter, one line for each of its values.
        quantities: variables of ``results``.
        where: parameter → value: only these cases.
        axes: panels to draw into; by default a new figure of a journal column's width.
    Returns:
        The panels, one for each quantity.
    Raises:
        InvalidSettings: an unknown parameter or quantity.
        MissingData: nothing to draw.
    """
    against = _parameter(results, against)
    by = None if by is None else _parameter(results, by)
    for name in quantities:
        if name not in results or name not in SYMBOLS:
            known = ", ".join(name for name in SYMBOLS if name in results)
            raise InvalidSettings(f"unknown quantity {name}, allowed {known}")
    chosen = _chosen(results, where or {})
    joined = not _others_vary(chosen, {against, by})
    if axes is None:
        height = 0.5 * COLUMN * len(quantities) + 0.15 * COLUMN
        axes = new_figure(rows=len(quantities), height=height)[1]
    with style():
        for panel, name in zip(axes, quantities, strict=True):
            _panel(panel, chosen, name, against, by, joined)
        axes[-1].set_xlabel(_label(chosen, against))
        _scale(axes, np.asarray(chosen[against].values))
        if by is not None:
            axes[0].legend(title=_label(chosen, by), loc="best")
        if len(axes) > 1:
            letter_panels(axes)
            for panel in axes[:-1]:
                panel.tick_params(labelbottom=False)
    return list(axes)


def _parameter(results: xr.Dataset, name: str) -> str:
    """The coordinate of a parameter, by its column or its key."""
    known = [p for p in str(results.attrs.get("parameters", "")).split(", ") if p] + ["seed"]
    for column in known:
        if column in results.coords and name in (column, results[column].attrs.get("long_name")):
            return column
    raise InvalidSettings(f"unknown parameter {name}, allowed {', '.join(known)}")


def _chosen(results: xr.Dataset, where: Mapping[str, Any]) -> xr.Dataset:
    keep = np.ones(results.sizes["case"], dtype=bool)
    for name, wanted in where.items():
        column = _parameter(results, name)
        values = results[column].values
        if values.dtype.kind in "OSU":
            keep &= values.astype(str) == str(wanted)
            continue
        try:
            keep &= np.isclose(values.astype(float), float(wanted), rtol=1e-9, atol=0.0)
        except ValueError:
            raise InvalidSettings(f"{name} = {wanted}: expected a number") from None
    if not keep.any():
        said = ", ".join(f"{name} = {value}" for name, value in where.items())
        raise MissingData(f"no finished case has {said}" if said else "there is no finished case")
    return results.isel(case=keep)


def _others_vary(results: xr.Dataset, drawn: set[str | None]) -> bool:
    """Whether a parameter that is not drawn differs among the points."""
    names = str(results.attrs.get("parameters", "")).split(", ")
    return any(
        name and name not in drawn and len(np.unique(results[name].values)) > 1 for name in names
    )


def _panel(
    panel: Axes, results: xr.Dataset, name: str, against: str, by: str | None, joined: bool
) -> None:
    values = np.unique(results[by].values) if by is not None else [None]
    for value, marker in zip(values, cycle(MARKERS)):
        part = results if by is None else results.isel(case=results[by].values == value)
        _curve(panel, part, name, against, marker, joined, _text(value))
    panel.set_ylabel(SYMBOLS[name])


def _curve(
    panel: Axes,
    part: xr.Dataset,
    name: str,
    against: str,
    marker: str,
    joined: bool,
    label: str | None,
) -> None:
    rows = _one_per_point(part, split=against == "seed" or f"{name}_seeds" not in part)
    part = part.isel(case=rows)
    seeds = "_seeds" if against != "seed" and f"{name}_seeds" in part else ""
    x = np.asarray(part[against].values)
    order = np.argsort(x, kind="stable")
    y = np.asarray(part[f"{name}{seeds}"].values, dtype=float)[order]
    x = x[order] if x.dtype.kind not in "OSU" else np.asarray(x[order].astype(str))
    line = "-" if joined and x.dtype.kind not in "OSU" else "none"
    look = {k: v for k, v in POINTS.items() if k != "elinewidth"}
    (drawn,) = panel.plot(x, y, ls=line, marker=marker, label=label, zorder=3, **look)
    if f"{name}{seeds}_low" not in part:
        return
    low, high = (
        np.asarray(part[f"{name}{seeds}_{end}"].values, dtype=float)[order]
        for end in ("low", "high")
    )
    _interval(panel, x, (low, y, high), drawn.get_color(), band=line == "-" and len(x) > 1)


def _interval(
    panel: Axes, x: Array, values: tuple[Array, Array, Array], colour: Any, *, band: bool
) -> None:
    low, y, high = values
    if band:
        panel.fill_between(x, low, high, color=colour, alpha=0.2, lw=0, zorder=2)
        return
    bars = [np.maximum(y - low, 0.0), np.maximum(high - y, 0.0)]
    panel.errorbar(x, y, yerr=bars, fmt="none", ecolor=colour, elinewidth=0.7, zorder=2)


def _one_per_point(part: xr.Dataset, *, split: bool) -> list[int]:
    """The first case of each parameter set; every case where the seeds are drawn apart."""
    if split:
        return list(range(part.sizes["case"]))
    points = part["point"].values.tolist()
    return [k for k, point in enumerate(points) if point not in points[:k]]


def _scale(axes: Sequence[Axes], x: Array) -> None:
    if x.dtype.kind in "OSU" or len(x) < 2 or x.min() <= 0 or x.max() / x.min() < LOG_RATIO:
        return
    for panel in axes:
        panel.set_xscale("log")


def _label(results: xr.Dataset, name: str) -> str:
    key = str(results[name].attrs.get("long_name", name))
    return NAMES.get(key) or NAMES.get(key.rpartition(".")[2]) or name.replace("_", " ")


def _text(value: Any) -> str | None:
    if value is None:
        return None
    return str(value) if isinstance(value, str) else f"{value:g}"
