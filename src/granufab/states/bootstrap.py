"""Intervals for means over correlated series: memory, block length, moving-block bootstrap."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array, IntArray

__all__ = ["Bootstrap", "Estimate", "autocorrelation_time", "block_length", "resamples", "widening"]

Draw = list[tuple[int, IntArray]]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its interval.

    Attributes:
        value: the estimate.
        low: lower end of the interval (95 % unless another level was asked for).
        high: upper end.
    """

    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half the length of the interval."""
        return 0.5 * (self.high - self.low)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bootstrap:
    """How the intervals are drawn; the same record gives the same intervals.

    Attributes:
        samples: number of resampled data sets.
        level: probability that the interval should hold.
        seed: of the random numbers.
        block_length: states per block, or None to set it from the autocorrelation.
    Raises:
        InvalidSettings: a value out of range.
    """

    samples: int = 1000
    level: float = 0.95
    seed: int = 1
    block_length: int | None = None

    def __post_init__(self) -> None:
        if self.samples < 20:
            raise InvalidSettings(f"bootstrap samples is {self.samples}, must be ≥ 20")
        if not 0.0 < self.level < 1.0:
            raise InvalidSettings(f"bootstrap level is {self.level}, must lie between 0 and 1")
        if self.block_length is not None and self.block_length < 1:
            raise InvalidSettings(f"block_length is {self.block_length}, must be ≥ 1")


def autocorrelation_time(series: ArrayLike) -> float:
    """Integrated autocorrelation time τ = 1 + 2 Σ ρ_k, in states.

    1 for white noise, (1 + φ)/(1 − φ) for x_k = φ x_{k−1} + noise. The variance of the mean of n
    states is τ var(x)/n. The sum ends where the neglected tail weighs as much as its noise, and
    is corrected for the unknown mean (Wolff, Comput. Phys. Commun. 156, 143, 2004).

    Args:
        series: shape (state_count,), stationary.
    Returns:
        τ ≥ 0.1; 1 for a constant series.
    Raises:
        MissingData: fewer than 4 states.
    """
    values = np.asarray(series, dtype=np.float64)
    count = len(values)
    if count < 4:
        raise MissingData(f"autocorrelation needs at least 4 states, got {count}")
    correlation = _autocorrelation(values)
    if correlation is None:
        return 1.0
    total = 1.0
    lag = 0
    for lag in range(1, count // 2 + 1):
        total += 2.0 * correlation[lag]
        decay = 1.5 / math.log((total + 1.0) / (total - 1.0)) if total > 1.0 else 1e-9
        if math.exp(-lag / decay) < decay / math.sqrt(lag * count):
            break
    return max(total * (1.0 + (2 * lag + 1) / count), 0.1)


def _autocorrelation(values: Array) -> Array | None:
    """ρ_k for lags 0..n/2, or None for a constant series."""
    count = len(values)
    centred = values - values.mean()
    if not np.ptp(values) > 1e-14 * np.abs(values).max():
        return None
    spectrum = np.abs(np.fft.rfft(centred, 2 * count)) ** 2
    covariance = np.fft.irfft(spectrum, 2 * count)[: count // 2 + 1]
    covariance /= count - np.arange(count // 2 + 1)
    return covariance / covariance[0]


def _memory(time: float) -> float:
    """Σ|k|ρ_k/Σρ_k (both sides) of the exponential memory whose integrated time is τ."""
    return max((time**2 - 1.0) / (2.0 * time), 0.0)


def block_length(time: float, count: int) -> int:
    """States per block for which the variance of a resampled mean has the least error.

    b = (3n/2)^{1/3} κ^{2/3} with κ = (τ² − 1)/(2τ): the optimum of Künsch (1989) and Politis &
    White (2004) for an exponential memory of integrated time τ; 1 for white noise.

    Args:
        time: integrated autocorrelation time τ, in states.
        count: states in the series.
    Returns:
        At least 1, at most a third of the series.
    """
    best = (1.5 * count) ** (1.0 / 3.0) * _memory(time) ** (2.0 / 3.0)
    return max(1, min(round(best), count // 3))


def widening(time: float, length: int, counts: Sequence[int], level: float) -> float:
    """Factor on deviations that repairs what a few short blocks miss.

    Blocks of b states lose the correlation across their ends, a fraction κ(1 − φᵇ)/b of the
    variance of the mean, and centring on the sample loses b/n more; with n/b blocks the spread
    is itself uncertain, which Student's t allows for.

    Args:
        time: integrated autocorrelation time τ, in states.
        length: block length b, in states.
        counts: states in each path.
        level: probability of the interval.
    """
    memory = max((time - 1.0) / (time + 1.0), 0.0)
    ends = 1.0 - _memory(time) * (1.0 - memory**length) / length
    mean_count = float(np.mean(counts))
    variance = max(ends, 0.1) * max(1.0 - length / mean_count, 0.1)
    freedom = max(sum(counts) / length - len(counts), 2.0)
    tail = 0.5 * (1.0 + level)
    return float(t.ppf(tail, freedom) / norm.ppf(tail)) / math.sqrt(variance)


def resamples(
    counts: Sequence[int],
    length: int,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None = None,
    sizes: Sequence[int] | None = None,
) -> Iterator[Draw]:
    """Resampled data sets: sample seeds (where there are several), then blocks of states.

    Args:
        counts: states in each path.
        length: states per block; blocks overlap and start anywhere that they fit.
        settings: number of data sets and seed of the random numbers.
        seeds: the sample seed that each path came from; seeds are drawn with replacement, all
            paths of a drawn seed together. None, or one seed only, keeps every path.
        sizes: states drawn for each path; by default as many as it has.
    Yields:
        A list of (path, rows): the path's number and the states drawn from it, in order.
    """
    random = np.random.default_rng(settings.seed)
    labels = list(dict.fromkeys(seeds)) if seeds is not None else []
    groups = [[k for k, s in enumerate(seeds or ()) if s == label] for label in labels]
    for _ in range(settings.samples):
        chosen: Sequence[int] = range(len(counts))
        if len(groups) > 1:
            chosen = [k for g in random.integers(len(groups), size=len(groups)) for k in groups[g]]
        yield [(k, _blocks(counts[k], length, (sizes or counts)[k], random)) for k in chosen]


def _blocks(count: int, length: int, size: int, random: np.random.Generator) -> IntArray:
    length = min(length, count)
    starts = random.integers(count - length + 1, size=-(-size // length))
    return (starts[:, None] + np.arange(length)).reshape(-1)[:size]
