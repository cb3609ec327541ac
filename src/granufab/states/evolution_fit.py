"""Fit an evolution law to recorded paths, with intervals; keep the fit as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.states.bootstrap import Bootstrap, Estimate
from granufab.states.critical import interval
from granufab.states.evolution import EvolutionLaw, Form, StrainStage
from granufab.states.evolution_path import predict_evolution
from granufab.states.evolution_search import FORMS, search, spread
from granufab.states.evolution_series import load_strain_paths

__all__ = ["EvolutionFit", "fit_evolution"]

LimitsFrom = Literal["critical", "fitted"]
_LAW = ("z_min", "z_max", "gain_rate", "loss_rate", "dimension", "early", "early_strain",
        "shedding", "shedding_ratio", "memory")  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvolutionFit:
    """What :func:`fit_evolution` found.

    Attributes:
        law: with the fitted values.
        parameters: value and interval of each fitted parameter, and of z_min and z_max; "rate"
            stands for gain_rate = loss_rate. An interval over many decades says that the path
            does not determine the parameter.
        form: which parameters were free.
        limits: "critical" (z_min, z_max from the late-strain plateau) or "fitted" (with the rest).
        rms: root mean square of the residuals of z, a and az on the fitted paths [-].
        state_count: states fitted (the first of each path is given, not fitted).
        aic: Akaike's criterion χ² + 2k for independent normal residuals of the plateau's scatter;
            only differences between forms on the same paths mean something, and the memory of
            the residuals inflates them.
        bic: χ² + k ln n, n counting z and a'.
        block_length: states per bootstrap block.
        level: probability of the intervals.
        draws: resampled parameters, columns as in ``parameters``, shape (samples, k).
    """

    law: EvolutionLaw
    parameters: Mapping[str, Estimate]
    form: Form
    limits: LimitsFrom
    rms: Mapping[str, float]
    state_count: int
    aic: float
    bic: float
    block_length: int
    level: float
    draws: Array

    def laws(self, count: int) -> list[EvolutionLaw]:
        """Laws of the first ``count`` resampled parameter sets that are admissible."""
        found = []
        for row in self.draws:
            if len(found) == count:
                break
            try:
                values = dict(zip(self.parameters, row.tolist(), strict=True))
                found.append(_law(values, self.law.dimension))
            except InvalidSettings:
                continue
        return found

    def predict(
        self,
        fabric: ArrayLike,
        stages: Sequence[StrainStage],
        *,
        surplus: float | None = None,
        direction: ArrayLike | None = None,
        samples: int = 60,
    ) -> xr.Dataset:
        """:func:`predict_evolution` with a band in z and a'.

        The band joins the spread of the laws that resampled data give with the rms residual of
        the fit as normal scatter, so it should hold single recorded states, where the law holds.

        Args:
            fabric: G at the start [-], shape (D, D).
            stages: the history.
            surplus: see :func:`predict_evolution`.
            direction: see :func:`predict_evolution`.
            samples: resampled laws walked; 0 leaves the band to the scatter.
        Returns:
            The prediction with z_low, z_high, a_low, a_high beside it.
        """
        options: dict[str, Any] = {"surplus": surplus, "direction": direction}
        result = predict_evolution(self.law, fabric, stages, **options)
        walks = [
            predict_evolution(law, fabric, stages, **options, tolerance=1e-6)
            for law in self.laws(samples)
        ]
        half = math.sqrt(2.0) * _normal_quantile(self.level)
        for name, short in (("z", "z"), ("a_signed", "a")):
            value = result[name].values
            variance = np.full(len(value), self.rms[short] ** 2)
            if walks:
                others = np.array([walk[name].values for walk in walks])
                variance = variance + np.mean((others - value) ** 2, axis=0)
            for end, sign in (("low", -1.0), ("high", 1.0)):
                text = f"{self.level:.0%} band of {name}, {end} end"
                edge = value + sign * half * np.sqrt(variance)
                result[f"{short}_{end}"] = ("record", edge, {"units": "-", "long_name": text})
        return result

    def to_dict(self) -> dict[str, Any]:
        """Plain data, for JSON; :meth:`from_dict` gives the fit back."""
        return {
            "kind": "evolution",
            "form": self.form,
            "limits": self.limits,
            "law": {name: getattr(self.law, name) for name in _LAW},
            "parameters": {
                name: {"value": e.value, "low": e.low, "high": e.high}
                for name, e in self.parameters.items()
            },
            "rms": dict(self.rms),
            "state_count": self.state_count,
            "aic": self.aic,
            "bic": self.bic,
            "block_length": self.block_length,
            "level": self.level,
            "draws": self.draws.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Any, *, where: str = "fit") -> Self:
        """Read what :meth:`to_dict` wrote.

        Args:
            data: as read from JSON; further keys are passed over.
            where: for messages.
        Raises:
            InvalidSettings: it is not an evolution fit, or an entry is missing or malformed.
        """
        if not isinstance(data, Mapping) or data.get("kind") != "evolution":
            raise InvalidSettings(
                f"{where}: is not the fit of an evolution law; "
                "write one with granufab fit SERIES --evolution FIT.json"
            )
        try:
            parameters = {
                str(name): Estimate(*(float(entry[end]) for end in ("value", "low", "high")))
                for name, entry in data["parameters"].items()
            }
            draws = np.array(data["draws"], dtype=np.float64).reshape(-1, len(parameters))
            return cls(
                law=EvolutionLaw(**data["law"]),
                parameters=parameters,
                rms={name: float(data["rms"][name]) for name in ("z", "a", "az")},
                draws=draws,
                **{name: data[name] for name in ("form", "limits", "state_count", "aic", "bic",
                                                 "block_length", "level")},
            )  # fmt: skip
        except InvalidSettings as error:
            raise InvalidSettings(f"{where}: {error}") from None
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InvalidSettings(f"{where}: entry missing or malformed ({error!r})") from None


def fit_evolution(
    eps_q: Any,
    z: Any,
    a: Any,
    *,
    form: Form = "memory",
    dimension: int = 2,
    b: float | None = None,
    limits: LimitsFrom = "critical",
    bootstrap: Bootstrap | None = None,
) -> EvolutionFit:
    """Fit the law's parameters to straight paths, reversals included.

    Least squares of z and a', each in units of its scatter on the plateau, from the first state
    of each path on. Intervals: residuals resampled in moving blocks, carried to the logarithms
    of the parameters to first order, together with the interval of z_min and z_max.

    Args:
        eps_q: running strain [-], > 0 contracts the axis of a'; a path may turn back. In 3D
            without ``b``, ε_q < 0 from the start is extension. One series or a sequence.
        z: coordination number [-], shaped like ``eps_q``.
        a: signed anisotropy a' [-], shaped like ``eps_q``.
        form: "minimal" (A_g, A_l), "early" (and κ, s_0), "shedding" (A = A_g = A_l, B, ω) or
            "memory" (and c).
        dimension: 2 or 3.
        b: (d_2 − d_3)/(d_1 − d_3) of the strain rate (3D); None is axisymmetric.
        limits: "critical" takes z_min and z_max from the plateau that ends each path's first
            stage; "fitted" fits them with the rest, which does better on the path fitted and
            worse on others.
        bootstrap: samples, level, seed and block length of the intervals.
    Raises:
        InvalidSettings: an unknown option, or series that do not fit together.
        MissingData: too few states on a plateau.
    """
    settings = bootstrap or Bootstrap(samples=200)
    if form not in FORMS:
        raise InvalidSettings(f"form is {form!r}, must be one of {', '.join(FORMS)}")
    if limits not in ("critical", "fitted"):
        raise InvalidSettings(f"limits is {limits!r}, must be 'critical' or 'fitted'")
    data = load_strain_paths(eps_q, z, a, dimension=dimension, b=b, settings=settings)
    found = search(data, FORMS[form], fit_limits=limits == "fitted", build=_law)
    draws = spread(data, found, settings)
    values = found.values
    errors = found.errors
    k = len(values)
    count = len(errors["z"])
    misfit = float(found.residuals @ found.residuals)
    return EvolutionFit(
        law=_law(values, dimension),
        parameters={
            name: interval(values[name], draws[:, column], settings.level)
            for column, name in enumerate(values)
        },
        form=form,
        limits=limits,
        rms={name: float(np.sqrt(np.mean(error**2))) for name, error in errors.items()},
        state_count=count,
        aic=misfit + 2.0 * k,
        bic=misfit + k * math.log(2 * count),
        block_length=found.block_length,
        level=settings.level,
        draws=draws,
    )


def _law(values: Mapping[str, float], dimension: int) -> EvolutionLaw:
    """The law of named parameters, in which "rate" is both rates."""
    named = dict(values)
    if "rate" in named:
        named["gain_rate"] = named["loss_rate"] = named.pop("rate")
    return EvolutionLaw(**named, dimension=dimension)


def _normal_quantile(level: float) -> float:
    """x with P(|N(0, 1)| < √2 x) = level."""
    from scipy.special import erfinv

    return float(erfinv(level))
