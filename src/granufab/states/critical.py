"""Critical state: means over the late-strain plateau with honest intervals."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array
from granufab.states.bootstrap import (
    Bootstrap,
    Draw,
    Estimate,
    autocorrelation_time,
    block_length,
    resamples,
    widening,
)
from granufab.states.series import Plateau, StatePath, as_series, load_paths, same_length

__all__ = ["CriticalState", "critical_state"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CriticalState:
    """What :func:`critical_state` found.

    Attributes:
        z_star: coordination number [-].
        a_star: size of the mean signed anisotropy [-].
        others: the other series by name, in their own units.
        plateau: first and last strain averaged over, one pair per path [-].
        block_length: states per bootstrap block.
        drift: per series, the mean of the plateau's second half less that of its first, in
            standard errors; beyond about ±3 the plateau is not stationary.
        between_seeds: mean ± Student's t · s/√n over the seeds, by name; None without seeds.
    """

    z_star: Estimate
    a_star: Estimate
    others: Mapping[str, Estimate]
    plateau: tuple[tuple[float, float], ...]
    block_length: int
    drift: Mapping[str, float]
    between_seeds: Mapping[str, Estimate] | None


def critical_state(
    eps_q: Any,
    z: Any,
    a: Any,
    *,
    others: Mapping[str, Any] | None = None,
    plateau: Plateau = None,
    seeds: Sequence[Hashable] | None = None,
    bootstrap: Bootstrap | None = None,
) -> CriticalState:
    """z*, \\|a*\\| and other means over the late-strain plateau, with bootstrap intervals.

    Every state of a plateau and every path has the same weight. The sign of a' is that of the
    path's plateau mean, taken after averaging, so noise does not bias \\|a*\\|. Paths are
    one-dimensional series, or sequences of series (several paths, seeds or both).

    Args:
        eps_q: strain that does not turn back along a path [-].
        z: coordination number [-].
        a: signed anisotropy a' [-].
        others: more series to average, such as ``{"q_over_p": …}``.
        plateau: None for the last third of each path's strain, a strain to start from, or
            (first, last).
        seeds: the sample seed of each path; with two or more, seeds are resampled too.
        bootstrap: samples, level, seed, block length.
    Raises:
        InvalidSettings: series that do not fit together.
        MissingData: fewer than 8 states on a plateau.
    Source: [Radjai2012], section 4; moving blocks: Künsch, Ann. Stat. 17, 1217 (1989).
    """
    settings = bootstrap or Bootstrap()
    paths = load_paths(eps_q, z, a, plateau)
    check_seeds(seeds, len(paths))
    table = plateau_table(paths, _other_series(others or {}, paths))
    names = ["z", "a", *(others or {})]
    time, length = memory_of(table, settings)
    value = _grand_mean(table)
    deviation = mean_deviations(table, time, length, settings, seeds)
    estimates = {
        name: interval(value[k], value[k] + deviation[:, k], settings.level)
        for k, name in enumerate(names)
    }
    return CriticalState(
        z_star=estimates.pop("z"),
        a_star=estimates.pop("a"),
        others=estimates,
        plateau=tuple(path.window for path in paths),
        block_length=length,
        drift=dict(zip(names, _drift(table), strict=True)),
        between_seeds=between_seeds(
            seeds, lambda rows: _grand_mean([table[k] for k in rows]), names, settings.level
        ),
    )


def _other_series(others: Mapping[str, Any], paths: Sequence[StatePath]) -> list[list[Array]]:
    loaded = [as_series(values, name) for name, values in others.items()]
    for name, series in zip(others, loaded, strict=True):
        same_length([path.strain for path in paths], series, ("eps_q", name))
    return loaded


def plateau_table(
    paths: Sequence[StatePath], others: Sequence[Sequence[Array]] = ()
) -> list[Array]:
    """Per path the plateau's z, a (turned so that its mean is ≥ 0) and other series, as columns."""
    table = []
    for number, path in enumerate(paths):
        a = path.a[path.plateau]
        columns = [path.z[path.plateau], -a if a.mean() < 0.0 else a]
        columns += [series[number][path.plateau] for series in others]
        table.append(np.column_stack(columns))
    return table


def memory_of(table: Sequence[Array], settings: Bootstrap) -> tuple[float, int]:
    """(τ, block length): of z or a, whichever remembers longer, averaged over the paths."""
    times = [[autocorrelation_time(rows[:, k]) for k in range(2)] for rows in table]
    time = float(np.mean(times, axis=0).max())
    count = round(float(np.mean([len(rows) for rows in table])))
    return time, min(settings.block_length or block_length(time, count), max(count // 2, 1))


def _grand_mean(table: Sequence[Array]) -> Array:
    return np.mean([rows.mean(axis=0) for rows in table], axis=0)


def mean_deviations(
    table: Sequence[Array],
    time: float,
    length: int,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None,
) -> Array:
    """Deviations of resampled grand means from their mean, shape (samples, column_count)."""
    counts = [len(rows) for rows in table]

    def statistic(draw: Draw) -> Array:
        return np.mean([table[k][rows].mean(axis=0) for k, rows in draw], axis=0)

    draws = np.array([statistic(draw) for draw in resamples(counts, length, settings, seeds)])
    return (draws - draws.mean(axis=0)) * widening(time, length, counts, settings.level)


def interval(value: float, draws: Array, level: float) -> Estimate:
    """Percentile interval of ``draws``, made to hold ``value``."""
    low, high = np.quantile(draws, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return Estimate(float(value), float(min(low, value)), float(max(high, value)))


def check_seeds(seeds: Sequence[Hashable] | None, path_count: int) -> None:
    """Raise :class:`InvalidSettings` unless there is one seed label per path."""
    if seeds is not None and len(seeds) != path_count:
        raise InvalidSettings(f"seeds has {len(seeds)} entries, but there are {path_count} paths")


def between_seeds(
    seeds: Sequence[Hashable] | None,
    solve: Callable[[list[int]], Array],
    names: Sequence[str],
    level: float,
) -> dict[str, Estimate] | None:
    """Mean ± t_{n−1} s/√n of the values that each seed's paths give alone.

    Args:
        seeds: label of each path.
        solve: paths (by number) → one value per name.
        names: of the values.
        level: probability of the interval.
    Returns:
        None unless there are two seeds or more.
    """
    labels = list(dict.fromkeys(seeds or ()))
    if seeds is None or len(labels) < 2:
        return None
    values = []
    for label in labels:
        try:
            values.append(solve([k for k, s in enumerate(seeds) if s == label]))
        except (InvalidSettings, MissingData) as error:
            raise type(error)(f"seed {label}: {error}") from None
    count = len(values)
    mean, spread = np.mean(values, axis=0), np.std(values, axis=0, ddof=1) / np.sqrt(count)
    half = float(t.ppf(0.5 * (1.0 + level), count - 1)) * spread
    return {
        name: Estimate(float(mean[k]), float(mean[k] - half[k]), float(mean[k] + half[k]))
        for k, name in enumerate(names)
    }


def _drift(table: Sequence[Array]) -> list[float]:
    """Second half less first half of each column, in standard errors of that difference.

    The errors are those about the plateau's straight-line trend, which would else hide itself.
    """
    drift = []
    for column in range(table[0].shape[1]):
        differences, variances = [], []
        for rows in table:
            series = rows[:, column]
            halves = np.array_split(series, 2)
            differences.append(halves[1].mean() - halves[0].mean())
            row = np.arange(len(series))
            scatter = series - np.polyval(np.polyfit(row, series, 1), row)
            variances += [_mean_variance(half) for half in np.array_split(scatter, 2)]
        error = np.sqrt(np.sum(variances))
        drift.append(float(np.sum(differences) / error) if error > 0.0 else 0.0)
    return drift


def _mean_variance(series: Array) -> float:
    return max(autocorrelation_time(series), 1.0) * float(np.var(series, ddof=1)) / len(series)
