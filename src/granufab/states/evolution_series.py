"""Recorded paths as strain histories: checked, cut at reversals, with their plateau's limits."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.states.bootstrap import Bootstrap
from granufab.states.domain import saturation_slopes
from granufab.states.evolution import (
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    proportional_gradient,
)
from granufab.states.evolution_path import predict_evolution
from granufab.states.limits import check_limits, critical_limits
from granufab.states.series import as_series, load_paths, same_length

__all__ = ["RecordedPath", "StrainData", "load_strain_paths"]

_AXIS = 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedPath:
    """One recorded path.

    Attributes:
        z: coordination number [-], shape (state_count,).
        a: signed anisotropy a' [-], shape (state_count,).
        stages: strain history through the recorded states, cut where it turns back.
    """

    z: Array
    a: Array
    stages: tuple[StrainStage, ...]

    def walk(self, law: EvolutionLaw, tolerance: float = 1e-7) -> tuple[Array, Array]:
        """z and a' that the law gives from the first state on, at every state."""
        direction = np.eye(law.dimension)[_AXIS]
        start = fabric_from_state(self.z[0], self.a[0], direction=direction)
        result = predict_evolution(
            law, start, self.stages, direction=direction, tolerance=tolerance
        )
        return result["z"].values, result["a_signed"].values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrainData:
    """Paths to fit, and what their plateaus say.

    Attributes:
        paths: the paths.
        dimension: 2 or 3.
        scatter: standard deviation of z and of a' on the plateaus, about a straight line [-].
        limits: (z_min, z_max) of the critical state [-].
        limit_draws: resampled limits, shape (samples, 2).
    """

    paths: tuple[RecordedPath, ...]
    dimension: int
    scatter: tuple[float, float]
    limits: Array
    limit_draws: Array


def load_strain_paths(
    eps_q: Any, z: Any, a: Any, *, dimension: int, b: float | None, settings: Bootstrap
) -> StrainData:
    """Check the series, cut them into stages and find the limits from the first stages.

    Raises:
        InvalidSettings: series that do not fit together, or paths of unlike loading.
        MissingData: too few states on a plateau.
    """
    saturation_slopes(dimension, b=b)
    strains, zs, anisotropies = as_series(eps_q, "eps_q"), as_series(z, "z"), as_series(a, "a")
    same_length(strains, zs, ("eps_q", "z"))
    same_length(strains, anisotropies, ("eps_q", "a"))
    paths, cut, signs = [], [], set()
    for number, rows in enumerate(zip(strains, zs, anisotropies, strict=True)):
        strain, z_, a_ = _moving(*rows)
        if len(strain) < 3:
            raise InvalidSettings(f"path {number} has {len(strain)} states of different strain")
        edges = _turns(strain)
        stages = [_stage(strain[low : high + 1], dimension, b) for low, high in pairwise(edges)]
        first = slice(edges[1] + 1)
        signs.add(_sense(strain[first], a_[first], number))
        paths.append(RecordedPath(z=z_, a=a_, stages=tuple(stages)))
        cut.append((strain[first], z_[first], a_[first]))
    if dimension == 3 and b is None and len(signs) > 1:
        raise InvalidSettings("some paths start in compression, others in extension; fit one kind")
    return _with_limits(tuple(paths), cut, dimension, b, signs, settings)


def _with_limits(
    paths: tuple[RecordedPath, ...],
    cut: list[tuple[Array, Array, Array]],
    dimension: int,
    b: float | None,
    signs: set[float],
    settings: Bootstrap,
) -> StrainData:
    extension = dimension == 3 and b is None and signs == {-1.0}
    slopes = saturation_slopes(dimension, "extension" if extension else "compression", b)
    strain, z, a = ([rows[k] for rows in cut] for k in range(3))
    first = load_paths(strain, z, a, None)
    limits = critical_limits(first, slopes, settings, None)
    check_limits(limits.value, "critical")
    scatter = [
        [_scatter(path.strain[path.plateau], series[path.plateau]) for series in (path.z, path.a)]
        for path in first
    ]
    level_z, level_a = np.maximum(np.sqrt(np.mean(np.square(scatter), axis=0)), 1e-6)
    return StrainData(
        paths=paths,
        dimension=dimension,
        scatter=(float(level_z), float(level_a)),
        limits=limits.value,
        limit_draws=limits.draws,
    )


def _sense(strain: Array, a: Array, number: int) -> float:
    """Sign of the first stage's strain, which its late a' must have too."""
    sign = float(np.sign(strain[-1] - strain[0]))
    late = float(a[-(-2 * len(a) // 3) :].mean())
    if late * sign < 0.0:
        raise InvalidSettings(
            f"path {number}: ε_q {'grows' if sign > 0 else 'falls'} while a' goes to {late:.3g}; "
            "both must count positive for contraction along the same axis"
        )
    return sign


def _moving(strain: Array, z: Array, a: Array) -> tuple[Array, Array, Array]:
    """The rows at which the strain has changed."""
    keep = np.concatenate([[True], np.diff(strain) != 0.0])
    return strain[keep], z[keep], a[keep]


def _turns(strain: Array) -> list[int]:
    steps = np.sign(np.diff(strain))
    return [0, *(np.flatnonzero(np.diff(steps)) + 1).tolist(), len(strain) - 1]


def _stage(strain: Array, dimension: int, b: float | None) -> StrainStage:
    rate = float(np.sign(strain[1] - strain[0]))
    gradient = proportional_gradient(dimension, b=b or 0.0, axis=_AXIS, rate=rate)
    return StrainStage(gradient=gradient, times=np.abs(strain - strain[0]))


def _scatter(strain: Array, series: Array) -> float:
    line = np.polyval(np.polyfit(strain - strain.mean(), series, 1), strain - strain.mean())
    return float(np.std(series - line))
