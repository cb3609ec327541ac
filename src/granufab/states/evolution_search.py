"""Least squares for the parameters of an evolution law, and how far the data determine them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from granufab.errors import InvalidSettings, NotConverged
from granufab.packing import Array
from granufab.states.bootstrap import (
    Bootstrap,
    autocorrelation_time,
    block_length,
    resamples,
    widening,
)
from granufab.states.evolution import EvolutionLaw
from granufab.states.evolution_series import StrainData

__all__ = ["FORMS", "Found", "search", "spread"]

FORMS: dict[str, tuple[str, ...]] = {
    "minimal": ("gain_rate", "loss_rate"),
    "early": ("gain_rate", "loss_rate", "early", "early_strain"),
    "shedding": ("rate", "shedding", "shedding_ratio"),
    "memory": ("rate", "shedding", "shedding_ratio", "memory"),
}
"""Free parameters of each form."""

_STARTS = {
    "gain_rate": (30.0, 300.0),
    "loss_rate": (30.0, 300.0),
    "rate": (30.0, 300.0),
    "early": (5.0, 50.0),
    "early_strain": (0.01, 0.002),
    "shedding": (3000.0, 3000.0),
    "shedding_ratio": (0.3, 0.3),
    "memory": (1.0, 1.0),
}
_BOUNDS = {
    "early_strain": (1e-5, 1.0),
    "shedding_ratio": (1e-3, 1.0),
    "memory": (1e-3, 30.0),
}
_WIDEST = (1e-3, 1e6)
_STEP = 1e-4
_INSENSITIVE = 1e-2

Build = Callable[[Mapping[str, float], int], EvolutionLaw]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """The optimum and what it looks like nearby.

    Attributes:
        values: parameters by name, z_min and z_max last.
        free: names of those searched for.
        residuals: in units of the scatter, z then a' of each path, shape (2n,).
        jacobian: of the residuals by the logarithms of all ``values``, shape (2n, k).
        errors: law less data of z, a and az [-], shape (n,) each.
        counts: states fitted in each path.
        block_length: states per bootstrap block.
        memory: integrated autocorrelation time of the residuals, in states.
    """

    values: dict[str, float]
    free: tuple[str, ...]
    residuals: Array
    jacobian: Array
    errors: dict[str, Array]
    counts: tuple[int, ...]
    block_length: int
    memory: float


def search(data: StrainData, names: Sequence[str], *, fit_limits: bool, build: Build) -> Found:
    """Minimise the residuals over the logarithms of the parameters, from two starts.

    Raises:
        NotConverged: no start leads to a law that can be walked.
    """
    every = (*names, "z_min", "z_max")
    free = every if fit_limits else tuple(names)
    fixed = {} if fit_limits else dict(zip(every[-2:], data.limits.tolist(), strict=True))

    def residuals(logarithms: Array, over: Sequence[str] = free) -> Array:
        values = dict(zip(over, np.exp(logarithms).tolist(), strict=True))
        return _residuals(data, build, fixed | values)

    low, high = np.log([_BOUNDS.get(name, _WIDEST) for name in free]).T
    best = None
    for attempt in range(2):
        start = [_STARTS[name][attempt] for name in names]
        start += data.limits.tolist() if fit_limits else []
        found = least_squares(
            residuals, np.log(start), bounds=(low, high), diff_step=[_STEP] * len(free),
            x_scale=1.0, xtol=1e-5, ftol=1e-6, max_nfev=40,
        )  # fmt: skip
        if np.isfinite(found.cost) and (best is None or found.cost < best.cost):
            best = found
    if best is None:
        raise NotConverged("the evolution law could not be fitted to these paths")
    values = fixed | dict(zip(free, np.exp(best.x).tolist(), strict=True))
    values = {name: values[name] for name in every}
    centre = np.log(list(values.values()))
    steps = [_STEP * unit for unit in np.eye(len(every))]
    jacobian = np.column_stack(
        [
            (residuals(centre + step, every) - residuals(centre - step, every)) / (2 * _STEP)
            for step in steps
        ]
    )
    return _found(data, build, values, free, residuals(centre, every), jacobian)


def _found(
    data: StrainData,
    build: Build,
    values: dict[str, float],
    free: tuple[str, ...],
    residuals: Array,
    jacobian: Array,
) -> Found:
    pairs = [_errors(data, build, values, number) for number in range(len(data.paths))]
    counts = tuple(len(z) for z, _, _ in pairs)
    times = [autocorrelation_time(column) for z, a, _ in pairs for column in (z, a)]
    time, count = max(times), round(float(np.mean(counts)))
    errors = {
        name: np.concatenate([pair[k] for pair in pairs]) for k, name in enumerate(("z", "a", "az"))
    }
    return Found(
        values=values,
        free=free,
        residuals=residuals,
        jacobian=jacobian,
        errors=errors,
        counts=counts,
        block_length=block_length(time, count),
        memory=time,
    )


def _errors(
    data: StrainData, build: Build, values: Mapping[str, float], number: int
) -> tuple[Array, Array, Array]:
    """Law less data of z, a' and a'z, the first state left out."""
    path = data.paths[number]
    z, a = path.walk(build(values, data.dimension))
    pair = z - path.z, a - path.a, a * z - path.a * path.z
    return pair[0][1:], pair[1][1:], pair[2][1:]


def _residuals(data: StrainData, build: Build, values: Mapping[str, float]) -> Array:
    parts = []
    for number, path in enumerate(data.paths):
        try:
            z, a, _ = _errors(data, build, values, number)
        except (InvalidSettings, NotConverged):
            z = a = np.full(len(path.z) - 1, 1e3)
        parts += [z / data.scatter[0], a / data.scatter[1]]
    return np.concatenate(parts)


def spread(data: StrainData, found: Found, settings: Bootstrap) -> Array:
    """Resampled parameters, to first order about the optimum, shape (samples, k).

    The logarithms move by δ = −(JᵀJ)⁻¹Jᵀ(r* + J_L δ_L): r* are the residuals drawn in blocks (z
    and a' of a state together), δ_L the resampled limits where these were not fitted.
    """
    count = len(found.values)
    free = [name in found.free for name in found.values]
    inverse = np.linalg.pinv(found.jacobian[:, free], rcond=1e-8)
    edges = np.concatenate([[0], np.cumsum(np.repeat(found.counts, 2))])
    blocks = [found.residuals[low:high] for low, high in pairwise(edges)]
    length = settings.block_length or found.block_length
    factor = widening(found.memory, length, found.counts, settings.level)
    limits = np.log(np.maximum(data.limit_draws / data.limits, 1e-3))
    drawn = resamples(found.counts, length, settings)
    deviations = np.zeros((settings.samples, count))
    for sample, draw in enumerate(drawn):
        noise = np.concatenate([blocks[2 * k + part][rows] for k, rows in draw for part in (0, 1)])
        deviations[sample, free] = -factor * inverse @ (noise - found.residuals.mean())
        if "z_min" not in found.free:
            shift = limits[sample % len(limits)]
            deviations[sample, -2:] = shift
            deviations[sample, free] -= inverse @ (found.jacobian[:, -2:] @ shift)
    deviations[:, free] -= deviations[:, free].mean(axis=0)
    return _admissible(found, deviations, settings)


def _admissible(found: Found, deviations: Array, settings: Bootstrap) -> Array:
    """Parameters within the range searched; all of it where the data say nothing."""
    random = np.random.default_rng(settings.seed)
    draws = np.empty_like(deviations)
    for column, (name, value) in enumerate(found.values.items()):
        low, high = np.log(_BOUNDS.get(name, _WIDEST))
        if np.linalg.norm(found.jacobian[:, column]) < _INSENSITIVE:
            logarithms = random.uniform(low, high, len(draws))
        else:
            logarithms = np.log(value) + deviations[:, column]
        draws[:, column] = np.exp(np.clip(logarithms, low, high))
    return draws
