"""Rates of gain, loss and current over a window of strain, and how sampling changes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from granufab.errors import MissingData
from granufab.fabric.balance_run import (
    LEAST_STRAIN,
    balance_intervals,
    count_error,
    follow_run,
)
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.history import Run
from granufab.packing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["average_balance", "rates_by_sampling"]

_ERRORS = (
    "the larger of that of Poisson events and of the scatter between intervals, taken as "
    "independent"
)


def average_balance(data: xr.Dataset, *, window: tuple[float, float] | None = None) -> xr.Dataset:
    r"""Mean rates over a window of strain: what eq. (16) says of a steady state, term by term.

    Totals over total strain, so that in every bin ``storage_rate`` = ``net_rate`` −
    ``divergence`` still holds, and in a steady state :math:`I = \partial J/\partial\theta`
    within the errors.

    Args:
        data: result of :func:`~granufab.fabric.balance_run`.
        window: ∫|dε_q| from and to; intervals that lie inside count, so let it not span a
            reversal. Default: the last third of the first stage that walks at least half as far
            as the longest one.
    Returns:
        Over ``bin`` [1/rad in 2D, 1/sr in 3D]: E, gain_rate, loss_rate, net_rate, divergence
        (of J), storage_rate (∂E/∂ε_q), and divergence_affine; over ``edge`` [-]: current_rate,
        current_rate_affine; scalars: gain_rate_total, loss_rate_total [contacts per grain and
        unit strain]; with ``_error`` where it is a measured rate.
    Raises:
        MissingData: no interval with strain lies in the window.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    part, window = _inside(data, window)
    strain = part["strain"].to_numpy()
    size, grains = float(data.attrs["bin_measure"]), int(data.attrs["grain_count"])
    unit = "1/rad" if data.attrs["dimension"] == 2 else "1/sr"
    counts = {name: part[name].to_numpy().astype(float) for name in _COUNTED}
    counts["net"] = counts["gain"] - counts["loss"]
    counts["divergence"] = np.diff(counts["current"], axis=1)
    counts["storage"] = counts["after"] - counts["before"]
    poisson = counts | {"current": counts["crossings"], "net": counts["gain"] + counts["loss"]}
    poisson["divergence"] = counts["crossings"][:, :-1] + counts["crossings"][:, 1:]
    table: dict[str, tuple] = {}
    for name, (dim, text) in _RATES.items():
        scale = grains * (1.0 if dim == "edge" else size)
        words = {"units": "-" if dim == "edge" else unit, "long_name": text}
        rate, error = _rate(counts[name], poisson[name], strain, scale)
        key = name if name == "divergence" else f"{name}_rate"
        table[key] = (dim, rate, words)
        if name != "storage":
            long = {"units": words["units"], "long_name": f"standard error of {text}"}
            table[f"{key}_error"] = (dim, error, long)
    table |= _affine(part, strain, grains, size, unit)
    table |= _totals(part, strain, grains)
    attributes = data.attrs | {"window": np.array(window), "intervals": len(strain)}
    attributes |= {"error_bars": _ERRORS, "sampling_strain": float(strain.mean())}
    return xr.Dataset(table, coords=data.coords, attrs=attributes)


_COUNTED = ("before", "after", "gain", "loss", "current", "crossings")
_RATES = {
    "gain": ("bin", "contacts gained per grain and unit strain"),
    "loss": ("bin", "contacts lost per grain and unit strain"),
    "net": ("bin", "gain less loss"),
    "divergence": ("bin", "divergence of the current J"),
    "storage": ("bin", "change of E per unit strain"),
    "current": ("edge", "current J per grain and unit strain, growing θ positive"),
}


def _inside(
    data: xr.Dataset, window: tuple[float, float] | None
) -> tuple[xr.Dataset, tuple[float, float]]:
    if not np.isfinite(data["strain"].to_numpy()).any():
        raise MissingData("the strain between the frames is unknown; give --strain (per frame)")
    low, high = window or _plateau(data)
    slack = 1e-6 * (1.0 + abs(high))
    inside = (
        (data["eps_q_total_before"] >= low - slack)
        & (data["eps_q_total"] <= high + slack)
        & (data["strain"] > LEAST_STRAIN)
    )
    part = data.isel(interval=np.flatnonzero(inside.to_numpy()))
    if part.sizes["interval"] == 0:
        end = float(data["eps_q_total"].max())
        raise MissingData(
            f"no interval lies within the strain window {low:g}..{high:g}; the intervals reach "
            f"from {float(data['eps_q_total_before'].min()):g} to {end:g}"
        )
    return part, (low, high)


def _plateau(data: xr.Dataset) -> tuple[float, float]:
    """Last third of the first long stage, at least its last interval."""
    stage = data["stage"].to_numpy()
    walked = {int(s): float(data["strain"].to_numpy()[stage == s].sum()) for s in np.unique(stage)}
    longest = max(walked.values())
    chosen = next(s for s, strain in walked.items() if strain >= 0.5 * longest)
    part = data.isel(interval=np.flatnonzero(stage == chosen))
    start, end = float(part["eps_q_total_before"][0]), float(part["eps_q_total"][-1])
    return min(end - (end - start) / 3.0, float(part["eps_q_total_before"][-1])), end


def _rate(count: Array, events: Array, strain: Array, scale: float) -> tuple[Array, Array]:
    """Σ count / Σ strain and its standard error, counts over (interval, …)."""
    total = strain.sum()
    rate = count.sum(axis=0) / total
    number = len(strain)
    error = count_error(events.sum(axis=0)) / total
    if number > 1:
        rest = count - strain.reshape(-1, *(1,) * (count.ndim - 1)) * rate
        scatter = np.sqrt(number / (number - 1.0) * (rest**2).sum(axis=0)) / total
        error = np.maximum(error, scatter)
    return rate / scale, error / scale


def _affine(part: xr.Dataset, strain: Array, grains: int, size: float, unit: str) -> dict:
    current = part["current_affine"].to_numpy().sum(axis=0) / (strain.sum() * grains)
    density = 0.5 * (part["before"] + part["after"]).mean("interval").to_numpy()
    return {
        "current_rate_affine": (
            "edge",
            current,
            {"units": "-", "long_name": "J of the mean flow per grain and unit strain"},
        ),
        "divergence_affine": (
            "bin",
            np.diff(current) / size,
            {"units": unit, "long_name": "divergence of J of the mean flow"},
        ),
        "E": (
            "bin",
            density / (grains * size),
            {"units": unit, "long_name": "contacts per grain and direction"},
        ),
    }


def _totals(part: xr.Dataset, strain: Array, grains: int) -> dict:
    table = {}
    for name, counted in (("gain", "gained"), ("loss", "lost")):
        count = part[counted].to_numpy().astype(float)
        rate, error = _rate(count, count, strain, grains)
        text = f"contacts {counted} per grain and unit strain"
        table[f"{name}_rate_total"] = ((), float(rate), {"units": "-", "long_name": text})
        text = f"standard error of {text}"
        table[f"{name}_rate_total_error"] = ((), float(error), {"units": "-", "long_name": text})
    return table


def rates_by_sampling(
    run: Run,
    *,
    multiples: Sequence[int] = (1, 2, 5, 10),
    criterion: str | Criterion | None = None,
    z_definition: ZDefinition = "z",
    keep: float | None = None,
    window: tuple[float, float] | None = None,
) -> xr.Dataset:
    """Rates of gain and loss against the strain between the states that are compared.

    A contact that opens and closes within an interval is not seen, so that rates fall with the
    sampling strain, the faster the more a criterion flickers.

    Args:
        run: recorded frames.
        multiples: frames per interval; those too long for the window are left out.
        criterion: default the run's own, else ``force``.
        z_definition: as for :func:`~granufab.fabric.balance`.
        keep: as for :func:`~granufab.fabric.balance_run`; contacts are followed frame by frame.
        window: as for :func:`average_balance`, the same for all.
    Returns:
        Over ``sampling``: strain (mean of the intervals), frames, intervals, gain_rate,
        loss_rate [contacts per grain and unit strain], persistent_fraction (of the contacts at
        the start), and errors.
    Raises:
        MissingData: no multiple fits.
        InvalidSettings: as for :func:`~granufab.fabric.balance_run`.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    followed = follow_run(run, criterion=criterion, z_definition=z_definition, keep=keep)
    rows: list[dict[str, float]] = []
    attributes: dict = {}
    last: MissingData | None = None
    for every in sorted(set(multiples)):
        try:
            data = balance_intervals(followed, every=every)
            if window is None:
                window = _plateau(data)
            part, _ = _inside(data, window)
        except MissingData as error:
            last = error
            continue
        rows.append(_sampled(data, part, every, window))
        attributes = dict(data.attrs)
    if not rows:
        raise last or MissingData("no sampling strain is asked for; give multiples such as 1, 2, 5")
    table = {
        name: ("sampling", np.array([row[name] for row in rows]), _SAMPLED[name])
        for name in rows[0]
    }
    kept = ("criterion", "keep", "z_definition", "dimension", "grain_count", "path")
    attributes = {name: attributes[name] for name in kept}
    return xr.Dataset(table, attrs=attributes | {"window": np.array(window), "error_bars": _ERRORS})


_SAMPLED = {
    name: {"units": "-", "long_name": text}
    for name, text in {
        "frames": "frames per interval",
        "intervals": "number of intervals",
        "strain": "sampling strain",
        "gain_rate": "contacts gained per grain and unit strain",
        "gain_rate_error": "standard error of the gain rate",
        "loss_rate": "contacts lost per grain and unit strain",
        "loss_rate_error": "standard error of the loss rate",
        "persistent_fraction": "share of the contacts that last an interval",
    }.items()
}


def _sampled(
    data: xr.Dataset, part: xr.Dataset, every: int, window: tuple[float, float]
) -> dict[str, float]:
    mean = average_balance(data, window=window)
    held, lost = float(part["persistent"].sum()), float(part["lost"].sum())
    row = {
        "frames": float(every),
        "intervals": float(part.sizes["interval"]),
        "strain": float(part["strain"].mean()),
        "persistent_fraction": held / (held + lost) if held + lost > 0 else np.nan,
    }
    for name in ("gain_rate", "loss_rate"):
        row[name] = float(mean[f"{name}_total"])
        row[f"{name}_error"] = float(mean[f"{name}_total_error"])
    return row
