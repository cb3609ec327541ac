"""Three ways from paths of states to (z_min, z_max): critical state, envelope, limit lines."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from granufab.errors import MissingData
from granufab.packing import Array, IntArray
from granufab.states.bootstrap import (
    Bootstrap,
    block_length,
    resamples,
    widening,
)
from granufab.states.critical import mean_deviations, memory_of, plateau_table
from granufab.states.series import StatePath, smooth

__all__ = ["Limits", "critical_limits", "envelope_limits", "line_limits", "path_extremes"]

_QUANTILE = 0.95
_ITERATIONS = 20
_SHORTEST_WINDOW = 9

Slopes = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Point values (z_min, z_max) and resampled ones, shape (samples, 2)."""

    value: Array
    draws: Array
    block_length: int


def path_extremes(z: Array, a: Array, slopes: Slopes) -> Array:
    """(2D·G_D, 2D·G_1) of each state as columns; a ≥ 0 in the sense of the loading.

    Where a < 0 the major and minor axes have changed places, and with them the two slopes.
    """
    loss, gain = slopes
    turned = a < 0.0
    size = np.abs(a)
    low = z * (1.0 - size / np.where(turned, gain, loss))
    high = z * (1.0 + size / np.where(turned, loss, gain))
    return np.column_stack([low, high])


def critical_limits(
    paths: Sequence[StatePath],
    slopes: Slopes,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None,
) -> Limits:
    """Plateau means (z*, a*) put into z_min = z*(1 − a*/s_loss), z_max = z*(1 + a*/s_gain)."""
    table = plateau_table(paths)
    time, length = memory_of(table, settings)
    mean = np.mean([rows.mean(axis=0) for rows in table], axis=0)
    draws = mean + mean_deviations(table, time, length, settings, seeds)
    signs = np.array([-1.0, 1.0]) / np.array(slopes)
    return Limits(
        value=mean[0] * (1.0 + mean[1] * signs),
        draws=draws[:, :1] * (1.0 + draws[:, 1:] * signs),
        block_length=length,
    )


def line_limits(
    paths: Sequence[StatePath],
    slopes: Slopes,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None,
) -> Limits:
    """Lines of given slope through the saturated part of (z, a·z).

    With the slope fixed, the least-squares z_min is the mean of z − a z/s_loss over the states
    saturated in loss, z_max the mean of z + a z/s_gain over those saturated in gain. A path is
    saturated from the first state whose smoothed value comes within one standard deviation (of
    the smoothed plateau) of the limit, which is found by iteration from the plateau's.
    """
    time, short = memory_of(plateau_table(paths), settings)
    tables = [_saturated_columns(path, slopes, short, time) for path in paths]
    table = [columns[first:] for columns, first in tables]
    count = round(float(np.mean([len(columns) for columns in table])))
    length = min(settings.block_length or block_length(time, count), max(count // 2, 1))
    value = np.mean([columns.mean(axis=0) for columns in table], axis=0)
    deviation = mean_deviations(table, time, length, settings, seeds)
    return Limits(value=value, draws=value + deviation, block_length=length)


def _saturated_columns(
    path: StatePath, slopes: Slopes, length: int, time: float
) -> tuple[Array, int]:
    """Per state the two intercepts, weighted so that column means are the path's limits.

    Rows before saturation hold the limit itself and rows after it the deviation scaled up, so
    that one draw of rows resamples both limits with their correlation kept.
    """
    linear = np.column_stack([path.z * (1 - path.a / slopes[0]), path.z * (1 + path.a / slopes[1])])
    window = _window(length, time, path.count)
    smoothed = np.column_stack([smooth(linear[:, k], window) for k in range(2)])
    noise = smoothed[path.plateau].std(axis=0)
    starts = []
    for k in range(2):
        start = path.plateau.start
        for _ in range(_ITERATIONS):
            limit = linear[start:, k].mean()
            near = np.abs(smoothed[: path.plateau.start, k] - limit) <= noise[k]
            found = int(np.argmax(near)) if near.any() else path.plateau.start
            if found == start:
                break
            start = found
        starts.append(start)
    first = min(starts)
    rows = np.arange(path.count)
    columns = np.empty_like(linear)
    for k in range(2):
        limit = linear[starts[k] :, k].mean()
        weight = (path.count - first) / (path.count - starts[k])
        columns[:, k] = limit + np.where(rows >= starts[k], weight * (linear[:, k] - limit), 0.0)
    return columns, first


def envelope_limits(
    paths: Sequence[StatePath],
    slopes: Slopes,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None,
) -> Limits:
    """Largest 2D·G_1 and smallest 2D·G_D after each path has entered the domain.

    A largest single value grows with the number of states. So z and a z are smoothed over about
    two blocks, the 95 % quantile (5 % for G_D) of all smoothed states is taken, and the same
    quantile of the smoothed plateau's scatter is subtracted: a path that only fluctuates about
    its limit gives the limit. Intervals: plateau fluctuations, resampled in blocks, are laid on
    the smoothed curves; the entries stay as found.

    A path has entered at its first smoothed state inside the domain. The domain is that of the
    critical fit, wider by twice the smoothed plateau's scatter, then the envelope itself, until
    the entries no longer change. A path that never enters counts from its plateau on.
    """
    time, length = memory_of(plateau_table(paths), settings)
    start = critical_limits(paths, slopes, Bootstrap(samples=20), None).value
    entries = _entries(paths, slopes, start, length, time)
    traces = []
    for path, entry in zip(paths, entries, strict=True):
        rows = np.column_stack([path.z, path.z * path.a])
        window = _window(length, time, path.count - entry)
        traces.append(_Trace(states=rows[entry:], plateau=rows[path.plateau], window=window))
    value = _noise_free_extremes(traces, slopes)
    counts = [len(trace.plateau) for trace in traces]
    sizes = [len(trace.states) for trace in traces]
    draws = np.array(
        [
            _noise_free_extremes([traces[k].redrawn(rows) for k, rows in draw], slopes)
            for draw in resamples(counts, length, settings, seeds, sizes)
        ]
    )
    deviation = (draws - draws.mean(axis=0)) * widening(time, length, counts, settings.level)
    return Limits(value=value, draws=value + deviation, block_length=length)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trace:
    """States (z, a z) of one path after its entry, and those of its plateau."""

    states: Array
    plateau: Array
    window: int

    def redrawn(self, rows: IntArray) -> _Trace:
        """The smoothed states with plateau fluctuations of the drawn ``rows`` laid on them."""
        mean = self.plateau.mean(axis=0)
        noise = self.plateau[rows] - mean
        return _Trace(
            states=_smooth_columns(self.states, self.window) + noise,
            plateau=mean + noise[: len(self.plateau)],
            window=self.window,
        )


def _noise_free_extremes(traces: Sequence[_Trace], slopes: Slopes) -> Array:
    """Quantiles of the smoothed extremes, less those of the smoothed plateau's scatter."""
    smoothed = [_smoothed_extremes(trace.states, trace.window, slopes) for trace in traces]
    scatter = [
        _smoothed_extremes(trace.plateau, trace.window, slopes).std(axis=0) for trace in traces
    ]
    inwards = float(norm.ppf(_QUANTILE)) * np.array([1.0, -1.0])
    return _quantiles(smoothed) + np.mean(scatter, axis=0) * inwards


def _entries(
    paths: Sequence[StatePath], slopes: Slopes, start: Array, length: int, time: float
) -> list[int]:
    smoothed = []
    for path in paths:
        window = _window(length, time, path.count)
        rows = np.column_stack([path.z, path.z * path.a])
        smoothed.append(_smoothed_extremes(rows, window, slopes))
    plateaus = [rows[path.plateau] for rows, path in zip(smoothed, paths, strict=True)]
    noise = np.sqrt(np.mean([rows.var(axis=0) for rows in plateaus], axis=0))
    limits = start + 2.0 * noise * np.array([-1.0, 1.0])
    entries: list[int] = []
    for _ in range(_ITERATIONS):
        found = [
            _entry(rows, limits, path.plateau.start)
            for rows, path in zip(smoothed, paths, strict=True)
        ]
        if found == entries:
            break
        entries = found
        limits = _quantiles([rows[row:] for rows, row in zip(smoothed, entries, strict=True)])
    return entries


def _entry(extremes: Array, limits: Array, latest: int) -> int:
    inside = (extremes[:latest, 0] >= limits[0]) & (extremes[:latest, 1] <= limits[1])
    return int(np.argmax(inside)) if inside.any() else latest


def _quantiles(extremes: Sequence[Array]) -> Array:
    rows = np.concatenate(extremes)
    return np.array([np.quantile(rows[:, 0], 1.0 - _QUANTILE), np.quantile(rows[:, 1], _QUANTILE)])


def _smoothed_extremes(rows: Array, window: int, slopes: Slopes) -> Array:
    smoothed = _smooth_columns(rows, window)
    return path_extremes(smoothed[:, 0], smoothed[:, 1] / smoothed[:, 0], slopes)


def _smooth_columns(rows: Array, window: int) -> Array:
    return np.column_stack([smooth(rows[:, k], window) for k in range(rows.shape[1])])


def _window(length: int, time: float, count: int) -> int:
    """Odd smoothing window: two blocks or two memories, at most a fifth of the path."""
    wanted = max(2 * length, round(2.0 * time), _SHORTEST_WINDOW)
    return max(min(wanted, count // 5), 1) // 2 * 2 + 1


def check_limits(value: Array, method: str) -> None:
    """Raise :class:`MissingData` unless 0 < z_min < z_max."""
    if not 0.0 < value[0] < value[1]:
        raise MissingData(
            f"method '{method}' gives z_min = {value[0]:.4g}, z_max = {value[1]:.4g}: these "
            "states span no domain (a' on the plateau must differ from 0); give a longer path "
            "or another plateau"
        )
