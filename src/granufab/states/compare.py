"""Paired comparison of two runs of the same samples, window by window of strain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array
from granufab.states.bootstrap import autocorrelation_time
from granufab.states.series import as_series, same_length

__all__ = ["PairedDifference", "paired_difference"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedDifference:
    """What :func:`paired_difference` found, in the units of the series.

    Attributes:
        value: mean of x − y.
        standard_error: the larger of ``within`` and ``between``.
        low: lower end of the interval, by Student's t.
        high: upper end.
        within: standard error from the scatter along strain, memory included.
        between: standard error from the scatter of the samples' means; None for one sample.
        sample_count: number of samples.
    """

    value: float
    standard_error: float
    low: float
    high: float
    within: float
    between: float | None
    sample_count: int


def paired_difference(
    x: Any,
    y: Any,
    *,
    strain_x: Any = None,
    strain_y: Any = None,
    window: tuple[float, float] | None = None,
    windows: int = 25,
    level: float = 0.95,
) -> PairedDifference:
    """Mean of x − y over the same strain windows of the same samples, with its error.

    Along one sample the mean of n differences has the variance τ var(x − y)/n, τ the integrated
    autocorrelation time of x − y (at least 1); over m samples the means' own scatter s/√m
    includes that. The larger of the two is the standard error.

    Args:
        x: one series per sample (a series, or a sequence of series).
        y: the same samples under other settings.
        strain_x: strain of ``x`` [-]; with both strains given, x and y may be recorded at
            different strains: joined by straight lines, they are first averaged over equal
            strain windows. Without, x and y must have the same lengths and are compared state
            by state.
        strain_y: strain of ``y`` [-].
        window: (first, last) strain compared; by default what both cover. Needs strains.
        windows: number of equal strain windows.
        level: probability of the interval.
    Raises:
        InvalidSettings: series that do not fit together.
        MissingData: fewer than 4 differences, or strains that do not cover the window.
    """
    xs, ys = as_series(x, "x"), as_series(y, "y")
    if (strain_x is None) != (strain_y is None):
        raise InvalidSettings("give both strain_x and strain_y, or neither")
    if strain_x is None:
        if window is not None:
            raise InvalidSettings("window needs strain_x and strain_y")
        same_length(xs, ys, ("x", "y"))
        differences = [one - two for one, two in zip(xs, ys, strict=True)]
    else:
        differences = _by_window(
            xs, ys, as_series(strain_x, "strain_x"), as_series(strain_y, "strain_y"),
            window, windows,
        )  # fmt: skip
    return _summary(differences, level)


def _summary(differences: Sequence[Array], level: float) -> PairedDifference:
    count = len(differences)
    means = np.array([series.mean() for series in differences])
    times = [max(autocorrelation_time(series), 1.0) for series in differences]
    variances = [
        time * float(np.var(series, ddof=1)) / len(series)
        for time, series in zip(times, differences, strict=True)
    ]
    within = float(np.sqrt(np.sum(variances)) / count)
    effective = sum(len(s) / time for s, time in zip(differences, times, strict=True))
    tail = 0.5 * (1.0 + level)
    half = float(t.ppf(tail, max(effective - count, 1.0))) * within
    between = None
    if count > 1:
        between = float(means.std(ddof=1) / np.sqrt(count))
        half = max(half, float(t.ppf(tail, count - 1)) * between)
    value = float(means.mean())
    return PairedDifference(
        value=value,
        standard_error=max(within, between or 0.0),
        low=value - half,
        high=value + half,
        within=within,
        between=between,
        sample_count=count,
    )


def _by_window(
    xs: Sequence[Array],
    ys: Sequence[Array],
    strain_x: Sequence[Array],
    strain_y: Sequence[Array],
    window: tuple[float, float] | None,
    windows: int,
) -> list[Array]:
    same_length(strain_x, xs, ("strain_x", "x"))
    same_length(strain_y, ys, ("strain_y", "y"))
    if len(xs) != len(ys):
        raise InvalidSettings(f"x holds {len(xs)} samples, y holds {len(ys)}")
    differences = []
    for x, y, at_x, at_y in zip(xs, ys, strain_x, strain_y, strict=True):
        first, last = window or (max(at_x.min(), at_y.min()), min(at_x.max(), at_y.max()))
        if not first < last:
            raise InvalidSettings(f"strain window {first:g}..{last:g} is empty")
        edges = np.linspace(first, last, windows + 1)
        differences.append(_window_means(x, at_x, edges) - _window_means(y, at_y, edges))
    return differences


def _window_means(series: Array, strain: Array, edges: Array) -> Array:
    """Means over the strain windows of the series joined by straight lines."""
    if (np.diff(strain) < 0.0).any():
        row = int(np.argmax(np.diff(strain) < 0.0)) + 1
        raise InvalidSettings(f"strain turns back at row {row}; give the accumulated strain")
    slack = 1e-6 * (edges[-1] - edges[0])
    if strain[0] > edges[0] + slack or strain[-1] < edges[-1] - slack:
        raise MissingData(
            f"window {edges[0]:.4g}..{edges[-1]:.4g} is not covered: "
            f"a series has strains {strain[0]:.4g}..{strain[-1]:.4g}"
        )
    grid = np.union1d(strain, edges)
    value = np.interp(grid, strain, series)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(grid))])
    return np.diff(area[np.searchsorted(grid, edges)]) / np.diff(edges)
