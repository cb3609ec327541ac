"""Whole runs as plain data: what they are, their series, and the domain fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast, get_args

import numpy as np

from granufab.errors import GranufabError, InvalidSettings
from granufab.fabric.coordination import check_definition
from granufab.fabric.run_definitions import run_definitions, run_friction
from granufab.io.summary import plain
from granufab.reproduce.report import fit_entry
from granufab.reproduce.series_fit import counted_strain, default_definition, fit_series
from granufab.reproduce.symmetry import described_series
from granufab.states import (
    AccessibleDomain,
    AccessibleFit,
    critical_circle,
    limit_circles,
    tangent_line,
)
from granufab.states.fit import Method
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["domain_data", "fit_data", "overview", "series_data"]

LINE = 121
"""Points of the limit lines between z_min and z_max."""


def overview(viewed: ViewedRun) -> dict[str, Any]:
    """What a run is, and where each of its frames lies on the path.

    Returns:
        name, path (the name of the path in the run), revision, generation, finished, problem,
        dimension, criterion, z_definition and minimum_contacts (the run's own), friction,
        source (lines on what was read of foreign data), frames: number, eps_q, eps_q_total and
        stage as lists; strain_known.
    """
    run = viewed.run
    places = viewed.places()
    found: dict[str, Any] = {
        "name": viewed.name,
        "path": run.name,
        "revision": viewed.revision,
        "generation": viewed.generation,
        "finished": viewed.finished,
        "problem": viewed.problem,
        "dimension": run.dimension if places else None,
        "friction": run_friction(run),
        "source": _source_lines(run.frames),
        "frame_count": len(places),
        "frames": {
            name: [getattr(place, name) for place in places]
            for name in ("number", "eps_q", "eps_q_total", "stage")
        },
        "strain_known": bool(np.isfinite([place.eps_q for place in places]).any()),
    }
    if places:
        rule, definition, minimum = run_definitions(run)
        found |= {
            "criterion": rule.text, "z_definition": definition, "minimum_contacts": minimum
        }  # fmt: skip
    return plain(found)


def _source_lines(frames: Any) -> list[str]:
    summary = getattr(frames, "summary", None)
    return [] if summary is None else list(summary.lines())


def series_data(viewed: ViewedRun) -> dict[str, Any]:
    """The series of a run: recorded, or measured from its frames where there is none.

    Returns:
        ``columns``: name → values over the records, null where unknown; ``units``: [unit, long
        name] of each; criterion and z_definition of the series; or ``missing``: why there is none.
    """
    try:
        series = viewed.complete().series
    except GranufabError as error:
        return {"missing": str(error), "columns": {}, "units": {}}
    names = [str(name) for name in series.data_vars]
    return plain(
        {
            "missing": None if series.sizes.get("record", 0) else "no row is recorded yet",
            "columns": {name: series[name].to_numpy() for name in names},
            "units": {
                name: [series[name].attrs.get("units", "-"), series[name].attrs["long_name"]]
                for name in names
            },
            "criterion": series.attrs.get("criterion"),
            "z_definition": series.attrs.get("z_definition"),
        }
    )


def fit_data(
    runs: Sequence[ViewedRun], method: str = "critical", z_definition: str | None = None
) -> dict[str, Any]:
    """The accessible domain fitted to one run or to several, as ``granufab fit`` gives it.

    Args:
        runs: of one dimension and symmetry.
        method: critical, envelope or lines.
        z_definition: default as for ``granufab fit``.
    Returns:
        ``fit``: the entries of ``granufab fit --json``, with ``z_definition``; ``domain``
        (:func:`domain_data`); or ``missing``: why there is none.
    Raises:
        InvalidSettings: an unknown method or definition.
    """
    if method not in get_args(Method):
        raise InvalidSettings(f"method is {method!r}, allowed: {', '.join(get_args(Method))}")
    definition = None if z_definition is None else check_definition(z_definition)
    try:
        paths = [counted_strain(described_series(viewed.complete())) for viewed in runs]
        empty = [
            run.name for run, path in zip(runs, paths, strict=True) if not path.sizes["record"]
        ]
        if empty:
            return {"missing": f"{empty[0]}: no row is recorded yet", "fit": None, "domain": None}
        found, used = fit_series(
            paths, cast(Method, method), definition or default_definition(paths)
        )
    except GranufabError as error:
        return {"missing": str(error), "fit": None, "domain": None}
    entry = fit_entry(found) | {
        "outside_significant": found.outside_significant,
        "z_definition": used,
        "level": found.level,
        "plateau": found.plateau,
    }
    return plain({"missing": None, "fit": entry, "domain": domain_data(found)})


def domain_data(limits: AccessibleFit | AccessibleDomain) -> dict[str, Any]:
    """Lines and points of a domain, on (z, a), on (z, az) and on the Mohr plane.

    Args:
        limits: a domain, or a fit of one, whose intervals of z_min and z_max become bands.
    Returns:
        z_min, z_max, z_star, a_star, dimension, mode, b, slopes [s_loss, s_gain]; ``sides``: for
        a' ≥ 0 and a' ≤ 0 sign, slopes, z_star, a_star, z, loss and gain (a on the two limits) and
        a_max; ``mohr``: limits (G of the two isotropic states), critical (centre, radius),
        tangent (slope, point); ``intervals``: z_min, z_max as [low, high], of a fit.
    """
    fit = limits if isinstance(limits, AccessibleFit) else None
    domain = limits.domain if isinstance(limits, AccessibleFit) else limits
    circle, (slope, point) = critical_circle(domain), tangent_line(domain)
    return {
        **{name: getattr(domain, name) for name in ("z_min", "z_max", "z_star", "a_star")},
        **{name: getattr(domain, name) for name in ("dimension", "mode", "b", "slopes")},
        "sides": [_side(domain, sign) for sign in (1, -1)],
        "mohr": {
            "limits": [one.centre for one in limit_circles(domain)],
            "critical": [circle.centre, circle.radius],
            "tangent": {"slope": slope, "point": point},
        },
        "intervals": None
        if fit is None
        else {
            name: [getattr(fit, name).low, getattr(fit, name).high] for name in ("z_min", "z_max")
        },
    }


def _side(domain: AccessibleDomain, sign: int) -> dict[str, Any]:
    """The limits for one sign of a'; in 3D axisymmetric states a' < 0 meets those of extension."""
    turned = sign < 0 and domain.dimension == 3 and domain.b is None
    own = replace(domain, mode="extension") if turned else domain
    z = np.linspace(own.z_min, own.z_max, LINE)
    return {
        "sign": sign,
        "slopes": own.slopes,
        "z_star": own.z_star,
        "a_star": sign * own.a_star,
        "z": z,
        "loss": sign * own.loss_saturation(z),
        "gain": sign * own.gain_saturation(z),
        "a_max": sign * own.a_max(z),
    }
