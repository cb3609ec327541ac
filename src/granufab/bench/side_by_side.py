"""Two timings taken in turn, and the ratio of each pair.

What disturbs a machine disturbs both of a pair alike, so the median of the pairs' ratios holds
where a quotient of two separate timings would not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["Ratio", "ratio_of", "take_turns"]

Timing = Callable[[], float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """A ratio of two costs over some repetitions.

    Attributes:
        median: of the pairs' ratios [-].
        low, high: their quartiles [-].
        pairs: how many.
    """

    median: float
    low: float
    high: float
    pairs: int


def ratio_of(above: Sequence[float | None], below: Sequence[float | None]) -> Ratio | None:
    """Median and quartiles of above/below, pair by pair; None where either is missing."""
    pairs = [
        a / b for a, b in zip(above, below, strict=True) if a is not None and b is not None and b
    ]
    if not pairs:
        return None
    low, median, high = (float(x) for x in np.quantile(pairs, (0.25, 0.5, 0.75)))
    return Ratio(median=median, low=low, high=high, pairs=len(pairs))


def take_turns(timings: Sequence[Timing], repetitions: int) -> list[list[float | None]]:
    """Call each timing in turn, ``repetitions`` times over, after one call that does not count.

    Returns:
        The seconds of each timing, shape (timings, repetitions); None where it has none.
    """
    for timing in timings:
        timing()
    rounds = [[timing() for timing in timings] for _ in range(repetitions)]
    return [list(column) for column in zip(*rounds, strict=True)]
