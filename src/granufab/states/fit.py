"""Fit the accessible domain to paths of states."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.states.bootstrap import Bootstrap, Estimate
from granufab.states.critical import between_seeds, check_seeds, interval
from granufab.states.domain import AccessibleDomain, Mode, saturation_slopes
from granufab.states.limits import (
    Limits,
    Slopes,
    check_limits,
    critical_limits,
    envelope_limits,
    line_limits,
    path_extremes,
)
from granufab.states.series import Plateau, StatePath, load_paths

__all__ = ["AccessibleFit", "Method", "fit_accessible_states"]

Method = Literal["critical", "envelope", "lines"]
_METHODS = {"critical": critical_limits, "envelope": envelope_limits, "lines": line_limits}
_NAMES = ("z_min", "z_max", "z_star", "a_star")


@dataclass(frozen=True, slots=True, kw_only=True)
class AccessibleFit:
    """What :func:`fit_accessible_states` found.

    Attributes:
        z_min: coordination number of the loosest isotropic state [-].
        z_max: coordination number of the densest isotropic state [-].
        z_star: critical coordination number [-].
        a_star: size of the critical anisotropy [-].
        outside_fraction: part of all given states that lies outside the fitted domain. Noise
            alone puts most states of a plateau outside: the critical state is a corner.
        outside_significant: part that lies outside by more than twice the plateau's scatter.
        outside_worst: largest excess, in contacts per grain (:meth:`AccessibleDomain.excess`).
        method: "critical", "envelope" or "lines".
        plateau: first and last strain of each path's plateau [-].
        block_length: states per bootstrap block.
        level: probability of the intervals.
        between_seeds: mean ± t s/√n over the seeds of each value; None without several seeds.
        dimension: 2 or 3.
        mode: "compression" or "extension" (3D).
        b: (G_2 − G_3)/(G_1 − G_3), or None.
    """

    z_min: Estimate
    z_max: Estimate
    z_star: Estimate
    a_star: Estimate
    outside_fraction: float
    outside_significant: float
    outside_worst: float
    method: Method
    plateau: tuple[tuple[float, float], ...]
    block_length: int
    level: float
    between_seeds: Mapping[str, Estimate] | None
    dimension: int
    mode: Mode
    b: float | None

    @property
    def domain(self) -> AccessibleDomain:
        """The domain with the fitted z_min and z_max."""
        return AccessibleDomain(
            z_min=self.z_min.value,
            z_max=self.z_max.value,
            dimension=self.dimension,
            mode=self.mode,
            b=self.b,
        )


def fit_accessible_states(
    eps_q: Any,
    z: Any,
    a: Any,
    *,
    dimension: int = 2,
    mode: Mode = "compression",
    b: float | None = None,
    method: Method = "critical",
    plateau: Plateau = None,
    seeds: Sequence[Hashable] | None = None,
    bootstrap: Bootstrap | None = None,
) -> AccessibleFit:
    """Fit z_min and z_max of the accessible domain, with moving-block-bootstrap intervals.

    ``critical`` (the default) inverts the plateau means z*, a* by eqs. 20–22; ``envelope`` takes
    the largest G_1 and smallest G_D after each path has entered the domain; ``lines`` fits
    straight limits of the theory's slopes in (z, a·z) to the saturated part. Cut paths at a
    reversal for the last two.

    Args:
        eps_q: strain along the path [-], shape (state_count,), not turning back; or a sequence
            of such series (several paths, seeds or both, of any lengths).
        z: coordination number [-], shaped like ``eps_q``.
        a: signed anisotropy a' [-], shaped like ``eps_q``; the plateau's sign counts as forward.
        dimension: 2 or 3.
        mode: axisymmetric loading in 3D.
        b: (G_2 − G_3)/(G_1 − G_3) in 3D; overrides ``mode``.
        method: "critical", "envelope" or "lines".
        plateau: None for the last third of each path's strain, a strain to start from, or
            (first, last).
        seeds: sample seed of each path; with two or more, seeds are resampled too.
        bootstrap: samples, level, seed and block length of the intervals.
    Raises:
        InvalidSettings: an unknown option, or series that do not fit together.
        MissingData: too few states on a plateau, or states that span no domain.
    Source: [Radjai2012], eqs. 19–22 and Figs. 7, 8.
    """
    settings = bootstrap or Bootstrap()
    slopes = saturation_slopes(dimension, mode, b)
    if method not in _METHODS:
        raise InvalidSettings(f"method is {method!r}, must be one of {', '.join(_METHODS)}")
    paths = load_paths(eps_q, z, a, plateau)
    check_seeds(seeds, len(paths))
    forward_only = dimension == 3 and mode == "compression" and b is None
    paths = [_forward(path, k, forward_only) for k, path in enumerate(paths)]
    limits = _METHODS[method](paths, slopes, settings, seeds)
    check_limits(limits.value, method)
    return AccessibleFit(
        **_estimates(limits, slopes, settings.level),
        **_outside(paths, slopes, limits.value),
        method=method,
        plateau=tuple(path.window for path in paths),
        block_length=limits.block_length,
        level=settings.level,
        between_seeds=_between_seeds(paths, slopes, method, settings, seeds),
        dimension=dimension,
        mode=mode,
        b=b,
    )


def _forward(path: StatePath, number: int, forward_only: bool) -> StatePath:
    """The path with a counted positive in the sense of its plateau."""
    mean = float(path.a[path.plateau].mean())
    if mean >= 0.0:
        return path
    if forward_only:
        raise InvalidSettings(
            f"path {number} has a' = {mean:.3g} on its plateau: fabric of extension; "
            "use mode='extension'"
        )
    return replace(path, a=-path.a)


def _with_critical(limits: Array, slopes: Slopes) -> Array:
    """Columns (z_min, z_max) → (z_min, z_max, z*, a*) by eqs. 20–22."""
    loss, gain = slopes
    z_star = (loss * limits[:, 0] + gain * limits[:, 1]) / (loss + gain)
    return np.column_stack([limits, z_star, loss * (1.0 - limits[:, 0] / z_star)])


def _estimates(limits: Limits, slopes: Slopes, level: float) -> dict[str, Estimate]:
    value = _with_critical(limits.value[None], slopes)[0]
    draws = _with_critical(limits.draws, slopes)
    return {name: interval(value[k], draws[:, k], level) for k, name in enumerate(_NAMES)}


def _between_seeds(
    paths: Sequence[StatePath],
    slopes: Slopes,
    method: Method,
    settings: Bootstrap,
    seeds: Sequence[Hashable] | None,
) -> dict[str, Estimate] | None:
    """Fit each seed's paths alone; only the values are used, so few samples are drawn."""
    few = replace(settings, samples=20)

    def alone(rows: list[int]) -> Array:
        part = _METHODS[method]([paths[k] for k in rows], slopes, few, None)
        return _with_critical(part.value[None], slopes)[0]

    return between_seeds(seeds, alone, _NAMES, settings.level)


def _outside(paths: Sequence[StatePath], slopes: Slopes, limits: Array) -> dict[str, Any]:
    """How many states lie outside, how many beyond the plateau's scatter, and how far."""
    extremes = [path_extremes(path.z, path.a, slopes) for path in paths]
    plateaus = [rows[path.plateau] for rows, path in zip(extremes, paths, strict=True)]
    scatter = np.sqrt(np.mean([rows.var(axis=0) for rows in plateaus], axis=0))
    rows = np.concatenate(extremes)
    beyond = np.column_stack([limits[0] - rows[:, 0], rows[:, 1] - limits[1]])
    rounding = 1e-12 * limits[1]
    return {
        "outside_fraction": float((beyond > rounding).any(axis=1).mean()),
        "outside_significant": float((beyond > 2.0 * scatter + rounding).any(axis=1).mean()),
        "outside_worst": max(float(beyond.max()), 0.0),
    }
