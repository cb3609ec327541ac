"""Paths of states (strain, z, a): checking, the late-strain plateau, smoothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array

__all__ = ["MINIMUM_STATES", "Plateau", "StatePath", "as_series", "plateau_rows", "smooth"]

MINIMUM_STATES = 8
Plateau = float | tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StatePath:
    """One history of states.

    Attributes:
        strain: never decreasing [-], shape (state_count,).
        z: coordination number [-], shape (state_count,).
        a: anisotropy with sign [-], shape (state_count,).
        plateau: the rows over which the critical state is averaged.
    """

    strain: Array
    z: Array
    a: Array
    plateau: slice

    @property
    def count(self) -> int:
        """Number of states."""
        return len(self.strain)

    @property
    def window(self) -> tuple[float, float]:
        """First and last strain of the plateau [-]."""
        strain = self.strain[self.plateau]
        return float(strain[0]), float(strain[-1])


def as_series(values: Any, name: str) -> list[Array]:
    """One series or several as a list of finite 1-D arrays.

    Args:
        values: one 1-D array, or a sequence of 1-D arrays (unequal lengths allowed).
        name: for messages.
    Raises:
        InvalidSettings: not numeric, not 1-D, empty or not finite.
    """
    several = isinstance(values, Iterable) and np.ndim(next(iter(values), 0)) > 0
    parts: list[Array] = []
    for number, part in enumerate(values if several else [values]):
        where = f"{name} of path {number}" if several else name
        try:
            array = np.asarray(part, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidSettings(f"{where} is not numeric: {error}") from None
        if array.ndim != 1 or array.size == 0:
            raise InvalidSettings(f"{where} has shape {array.shape}, expected (state_count,)")
        if not np.isfinite(array).all():
            row = int(np.argmin(np.isfinite(array)))
            raise InvalidSettings(f"{where} is {array[row]} in row {row}, must be finite")
        parts.append(array)
    return parts


def same_length(reference: Sequence[Array], other: Sequence[Array], names: tuple[str, str]) -> None:
    """Raise :class:`InvalidSettings` unless both hold as many paths of the same lengths."""
    if len(reference) != len(other):
        raise InvalidSettings(
            f"{names[0]} holds {len(reference)} paths, {names[1]} holds {len(other)}"
        )
    for number, (one, two) in enumerate(zip(reference, other, strict=True)):
        if len(one) != len(two):
            raise InvalidSettings(
                f"path {number}: {names[0]} has {len(one)} states, {names[1]} has {len(two)}"
            )


def load_paths(eps_q: Any, z: Any, a: Any, plateau: Plateau) -> list[StatePath]:
    """Checked paths with their plateaus.

    Args:
        eps_q: strain along the path [-]; one series or a sequence of series.
        z: coordination number [-], shaped like ``eps_q``.
        a: anisotropy with sign [-], shaped like ``eps_q``.
        plateau: see :func:`plateau_rows`.
    Raises:
        InvalidSettings: series that do not fit together, or z ≤ 0.
        MissingData: a plateau with too few states.
    """
    strains, zs, anisotropies = as_series(eps_q, "eps_q"), as_series(z, "z"), as_series(a, "a")
    same_length(strains, zs, ("eps_q", "z"))
    same_length(strains, anisotropies, ("eps_q", "a"))
    paths = []
    for number, (strain, z_, a_) in enumerate(zip(strains, zs, anisotropies, strict=True)):
        if (z_ <= 0.0).any():
            row = int(np.argmin(z_))
            raise InvalidSettings(f"z of path {number} is {z_[row]:g} in row {row}, must be > 0")
        rising = _rising(strain, number)
        rows = plateau_rows(rising, plateau, f"path {number}")
        paths.append(StatePath(strain=rising, z=z_, a=a_, plateau=rows))
    return paths


def _rising(strain: Array, number: int) -> Array:
    steps = np.diff(strain)
    if (steps >= 0.0).all():
        return strain
    if (steps <= 0.0).all():
        return -strain
    row = int(np.argmax(np.sign(steps) == -np.sign(strain[-1] - strain[0]))) + 1
    raise InvalidSettings(
        f"eps_q of path {number} turns back at row {row}; "
        "give the accumulated strain (eps_q_total) or cut the path at the reversal"
    )


def plateau_rows(strain: Array, plateau: Plateau, where: str = "the path") -> slice:
    """Rows of the late-strain plateau.

    Args:
        strain: never decreasing [-], shape (state_count,).
        plateau: None for the last third of the strain covered; a number for every state from
            that strain on; or (first, last) strain.
        where: for messages.
    Raises:
        InvalidSettings: a window that ends before it starts.
        MissingData: fewer than 8 states in the window.
    """
    start, end = strain[0] + (strain[-1] - strain[0]) * 2.0 / 3.0, strain[-1]
    if isinstance(plateau, tuple | list):
        if len(plateau) != 2 or not plateau[0] < plateau[1]:
            raise InvalidSettings(
                f"plateau is {plateau!r}, must be (first, last) with first < last"
            )
        start, end = plateau
    elif plateau is not None:
        start = float(plateau)
    slack = 1e-9 * max(abs(strain[0]), abs(strain[-1]))
    first = int(np.searchsorted(strain, start - slack, side="left"))
    last = int(np.searchsorted(strain, end + slack, side="right"))
    if last - first < MINIMUM_STATES:
        raise MissingData(
            f"{where} has {max(last - first, 0)} states in the plateau {start:.4g}..{end:.4g} "
            f"(strain covers {strain[0]:.4g}..{strain[-1]:.4g}), needs {MINIMUM_STATES}; "
            "record more often or widen the plateau"
        )
    return slice(first, last)


def smooth(series: Array, window: int) -> Array:
    """Centred moving average over ``window`` states; at the ends over those that exist.

    Args:
        series: shape (state_count,).
        window: odd number of states.
    """
    half = min(window, len(series)) // 2
    total = np.concatenate([[0.0], np.cumsum(series)])
    row = np.arange(len(series))
    first = np.maximum(row - half, 0)
    last = np.minimum(row + half + 1, len(series))
    return (total[last] - total[first]) / (last - first)
