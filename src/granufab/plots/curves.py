"""What the figures of paths share: reading runs and series, labels, running means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from granufab.errors import MissingData
from granufab.history import Run
from granufab.packing import Array, IntArray

__all__ = ["LABELS", "Results", "collect", "column", "mean_curve", "running_mean", "stages"]

Results = Run | xr.Dataset | Sequence[Run | xr.Dataset] | Mapping[str, Any]
"""A run, a series, several of them, or {label: one or several repeats of the same path}."""

LABELS: dict[str, str] = {
    "eps_q": r"$\varepsilon_q$ [-]",
    "eps_q_total": r"$\int|\mathrm{d}\varepsilon_q|$ [-]",
    "z": r"$z$ [-]",
    "z_backbone": r"$z$ [-]",
    "z_mechanical": r"$z_m$ [-]",
    "a": r"$a$ [-]",
    "a_signed": "$a$\N{PRIME} [-]",
    "q_over_p": r"$q/p$ [-]",
    "phi": r"$\phi$ [-]",
}
"""Symbol and unit of each column on an axis (z counts as its definition says)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Mean over repeats and its spread, along one path.

    Attributes:
        strain: abscissa, shape (record_count,).
        mean: running mean, averaged over the repeats, shape (record_count,).
        spread: standard deviation, over the repeats where there are several, else of the
            fluctuations inside the window of the running mean, shape (record_count,).
    """

    strain: Array
    mean: Array
    spread: Array


def collect(*results: Results) -> dict[str, list[xr.Dataset]]:
    """The series behind ``results``, by label; each label holds one or several repeats.

    Raises:
        MissingData: there is no series with at least one record.
    """
    groups: dict[str, list[xr.Dataset]] = {}
    for result in results:
        if isinstance(result, Mapping) and not isinstance(result, xr.Dataset):
            groups |= {str(label): _datasets(value) for label, value in result.items()}
            continue
        for item in _datasets(result, keep_runs=True):
            label = _name(item) or "path"
            taken = sum(1 for key in groups if key == label or key.startswith(f"{label} ("))
            groups[f"{label} ({taken + 1})" if taken else label] = _datasets(item)
    if not groups or any(not d.sizes.get("record") for repeats in groups.values() for d in repeats):
        raise MissingData("a figure of a path needs at least one series with records, got none")
    return groups


def _single(results: object) -> bool:
    return isinstance(results, Run | xr.Dataset)


def _name(item: Any) -> str:
    return (
        item.name
        if isinstance(item, Run)
        else str(item.attrs.get("name") or item.attrs.get("path", ""))
    )


def _datasets(value: Any, *, keep_runs: bool = False) -> list[Any]:
    items = [value] if _single(value) else list(value)
    return [i.series if isinstance(i, Run) and not keep_runs else i for i in items]


def column(series: xr.Dataset, name: str) -> Array:
    """One column of a series.

    Raises:
        MissingData: the series has no such column.
    """
    if name not in series:
        held = ", ".join(str(key) for key in series.data_vars)
        raise MissingData(f"the series has no column {name}; it holds {held}")
    return np.asarray(series[name].values, dtype=float)


def stages(series: xr.Dataset) -> list[slice]:
    """Slices of the series between reversals of the strain; neighbours share the turning record."""
    strain = column(series, "eps_q")
    sign = np.sign(np.diff(strain))
    moving = np.flatnonzero(sign)
    turns = moving[1:][sign[moving[1:]] != sign[moving[:-1]]]
    edges = [0, *turns.tolist(), len(strain) - 1]
    if len(strain) == 1:
        return [slice(0, 1)]
    return [slice(low, high + 1) for low, high in pairwise(edges)]


def running_mean(strain: Array, value: Array, window: float) -> tuple[Array, Array]:
    """Running mean over a window of strain, and the scatter about it in the window.

    The window is centred and shrinks towards both ends, so that the first and last records keep
    their own values.

    Args:
        strain: monotonic, shape (record_count,).
        value: shape (record_count,); NaN where unknown.
        window: full width [same unit as ``strain`` ]; 0 for none.
    """
    count = len(value)
    if count < 3 or window <= 0:
        return value.copy(), np.zeros(count)
    travelled = np.abs(strain - strain[0])
    reach = np.minimum(window / 2, np.minimum(travelled, travelled[-1] - travelled))
    low = np.searchsorted(travelled, travelled - reach - 1e-12, side="left")
    high = np.searchsorted(travelled, travelled + reach + 1e-12, side="right")
    mean = _window_mean(value, low, high)
    return mean, np.sqrt(_window_mean((value - mean) ** 2, low, high))


def _window_mean(value: Array, low: IntArray, high: IntArray) -> Array:
    known = np.isfinite(value)
    total = np.concatenate(([0.0], np.cumsum(np.where(known, value, 0.0))))
    number = np.concatenate(([0], np.cumsum(known)))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (total[high] - total[low]) / (number[high] - number[low])
    return np.where(high - low == 1, value, mean)


def mean_curve(
    repeats: Sequence[xr.Dataset], name: str, *, against: str, window: float
) -> list[Curve]:
    """Running mean of ``name`` along each stage, averaged over the repeats.

    Args:
        repeats: series of the same path.
        name: column of the ordinate.
        against: column of the abscissa.
        window: strain over which the running mean is taken.
    Returns:
        One curve per stage, split where the strain is reversed.
    """
    curves = []
    for index, part in enumerate(stages(repeats[0])):
        strain = column(repeats[0], against)[part]
        total = _travelled(repeats[0], part)
        means, spreads = [], []
        for series in repeats:
            parts = stages(series)
            if index >= len(parts):
                continue
            own = _travelled(series, parts[index])
            mean, spread = running_mean(own, column(series, name)[parts[index]], window)
            means.append(np.interp(total, own, mean, right=np.nan))
            spreads.append(np.interp(total, own, spread, right=np.nan))
        several = len(means) > 1
        deviation = np.std(means, axis=0, ddof=1) if several else spreads[0]
        curves.append(Curve(strain=strain, mean=np.mean(means, axis=0), spread=deviation))
    return curves


def _travelled(series: xr.Dataset, part: slice) -> Array:
    strain = column(series, "eps_q")[part]
    return np.abs(strain - strain[0])
