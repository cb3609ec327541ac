"""From runs to numbers: fits of the accessible domain and the content of figN.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import GranufabError
from granufab.history import Run
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe, column, first_stage, reached_z
from granufab.reproduce.symmetry import fit_symmetry, run_symmetry
from granufab.reproduce.workers import Job
from granufab.simulate.settings import Case
from granufab.states import AccessibleFit, CriticalState, Estimate, critical_state
from granufab.states import fit_accessible_states as fit_states
from granufab.version import VERSION

__all__ = ["METHODS", "estimate", "fit_all", "fit_entry", "fit_runs", "report"]

Z_TOLERANCE = 0.05
"""A start further than this from the wanted z_0 is said to be the nearest reachable."""

METHODS = ("critical", "envelope", "lines")
"""The fits that every figure reports; the first is the default."""


def fit_all(recipe: Recipe, runs: Mapping[str, list[Run]], z_definition: str) -> Outcome:
    """Fit the domain to all paths together (or to ``recipe.fit_from``) and to each path where
    the recipe wants it.

    Only the strain before a reversal is used. A method that the data do not allow is left out,
    save the default one.

    Raises:
        GranufabError: the critical-state fit is impossible; the message says why.
    """
    chosen = [recipe.fit_from] if recipe.fit_from else list(runs)
    fits: dict[str, AccessibleFit] = {}
    failures: dict[str, str] = {}
    for method in () if recipe.without_fit else METHODS:
        try:
            fits[method] = fit_runs({k: runs[k] for k in chosen}, z_definition, method)
        except GranufabError as error:
            if method == METHODS[0]:
                raise
            failures[method] = str(error)
    alone = runs if recipe.fit_each else {}
    path_fits = {name: fit_runs({name: runs[name]}, z_definition) for name in alone}
    return Outcome(
        recipe=recipe,
        runs=runs,
        fits=fits,
        failures=failures,
        path_fits=path_fits,
        z_definition=z_definition,
    )


def fit_runs(
    runs: Mapping[str, Sequence[Run]], z_definition: str, method: Any = METHODS[0]
) -> AccessibleFit:
    """Fit the accessible domain to the first stage of several paths and their repeats.

    Dimension, mode and b are those of the runs (:mod:`granufab.reproduce.symmetry`).
    """
    every = [run for repeats in runs.values() for run in repeats]
    series = [first_stage(run.series) for run in every]
    symmetry = fit_symmetry([run_symmetry(run.settings) for run in every], series)
    return fit_states(
        [column(item, "eps_q") for item in series],
        [column(item, z_definition) for item in series],
        [column(item, "a_signed") for item in series],
        method=method,
        seeds=_seeds(runs),
        **symmetry.options(),
    )


def _seeds(runs: Mapping[str, Sequence[Run]]) -> list[int] | None:
    labels = [index for repeats in runs.values() for index in range(len(repeats))]
    return labels if len(set(labels)) > 1 else None


def report(outcome: Outcome, jobs: Mapping[str, Sequence[Job]], folder: Path) -> dict[str, Any]:
    """The content of ``figN.json``, save seed and wall time.

    Args:
        outcome: runs and fits.
        jobs: what was run for each path.
        folder: of the figure; the folders of the runs are told from there.
    """
    cases = [job.case for repeats in jobs.values() for job in repeats]
    record = cases[0].record
    paths = []
    for path in outcome.recipe.paths:
        folders = [job.folder.relative_to(folder).as_posix() for job in jobs[path.name]]
        paths.append(_path_entry(outcome, path) | {"runs": folders})
    return {
        "granufab": VERSION,
        "settings": _settings(cases),
        "seed": None,
        "criterion": record.criterion,
        "z_definition": record.z_definition,
        "paths": paths,
        **_fit_entries(outcome),
        "solver": _solver([run for repeats in outcome.runs.values() for run in repeats]),
        **outcome.recipe.extra(outcome),
    }


def _fit_entries(outcome: Outcome) -> dict[str, Any]:
    if outcome.recipe.without_fit:
        return {"fit": None, "fit_reason": outcome.recipe.without_fit}
    fits: dict[str, Any] = {
        method: fit_entry(outcome.fits[method])
        if method in outcome.fits
        else {"z_min": None, "z_max": None, "error": outcome.failures[method]}
        for method in METHODS
    }
    default = fits.pop(METHODS[0])
    if outcome.recipe.fit_from:
        default["from"] = outcome.recipe.fit_from
    return {"fit": {"default": default, **fits}}


def estimate(value: Estimate | None) -> dict[str, float] | None:
    """An estimate as plain data."""
    return None if value is None else {"value": value.value, "low": value.low, "high": value.high}


def fit_entry(fit: AccessibleFit) -> dict[str, Any]:
    """A fit as plain data."""
    return {
        "method": fit.method,
        "dimension": fit.dimension,
        "mode": fit.mode if fit.dimension == 3 and fit.b is None else None,
        "b": fit.b,
        "z_min": estimate(fit.z_min),
        "z_max": estimate(fit.z_max),
        "z_star": estimate(fit.z_star),
        "a_star": estimate(fit.a_star),
        "outside_fraction": fit.outside_fraction,
        "outside_significant": fit.outside_significant,
        "outside_worst": fit.outside_worst,
        "between_seeds": None
        if fit.between_seeds is None
        else {name: estimate(value) for name, value in fit.between_seeds.items()},
    }


def critical_means(runs: Sequence[Run], z_definition: str, others: Sequence[str]) -> CriticalState:
    """Means over the late-strain plateau of one path's first stage."""
    series = [first_stage(run.series) for run in runs]
    return critical_state(
        [column(item, "eps_q") for item in series],
        [column(item, z_definition) for item in series],
        [column(item, "a_signed") for item in series],
        others={name: [column(item, name) for item in series] for name in others},
        seeds=list(range(len(series))) if len(series) > 1 else None,
    )


def _path_entry(outcome: Outcome, path: PathRecipe) -> dict[str, Any]:
    runs = outcome.runs[path.name]
    known = [name for name in ("q_over_p", "phi", "rattler_fraction") if _complete(runs, name)]
    state = critical_means(runs, outcome.z_definition, known)
    reached = [reached_z(run, outcome.z_definition) for run in runs]
    summaries = [run.summary for run in runs]
    return {
        "name": path.name,
        "z_0": float(np.mean(reached)),
        "z_star": estimate(state.z_star),
        "a_star": estimate(state.a_star),
        "z_0_wanted": path.coordination,
        "z_0_each": reached,
        "dimension": path.dimension,
        "loading": path.loading,
        "b": path.b,
        "friction": path.friction,
        "compaction_friction": [item.get("compaction_friction") for item in summaries],
        "phi_0": float(np.mean([column(run.series, "phi")[0] for run in runs])),
        **{f"{name}_star": estimate(state.others[name]) for name in known},
        "drift": dict(state.drift),
        "strain_averaged": [list(window) for window in state.plateau],
        "grain_count": summaries[0].get("grain_count"),
        "seeds": [item.get("seed") for item in summaries],
        "warnings": _warnings(path, reached, summaries),
    }


def _warnings(path: PathRecipe, reached: Sequence[float], summaries: Sequence[Any]) -> list[str]:
    texts = {text for item in summaries for text in item.get("warnings", [])}
    wanted = path.coordination
    if wanted is not None:
        missed = [value for value in reached if abs(value - wanted) > Z_TOLERANCE]
        texts |= {f"wanted z_0 = {wanted:g}, the nearest reachable is {v:.2f}" for v in missed}
    return sorted(texts)


def _complete(runs: Sequence[Run], name: str) -> bool:
    return all(name in run.series and np.isfinite(run.series[name]).all() for run in runs)


def _settings(cases: Sequence[Case]) -> dict[str, Any]:
    return {
        "grain_count": cases[0].sample.grain_count,
        "cases": {case.name: case.model_dump(mode="json") for case in cases},
    }


def _solver(runs: Sequence[Run]) -> dict[str, Any]:
    """Totals over the paths, worst values, and means weighted by steps."""
    table = [run.summary for run in runs]
    steps = sum(item["steps"] for item in table)
    entry: dict[str, Any] = {
        "tolerance": table[0].get("tolerance"),
        "stiffness": table[0].get("stiffness"),
        "steps": steps,
        "sweeps_mean": sum(i["sweeps_mean"] * i["steps"] for i in table) / max(steps, 1),
    }
    for name in ("nonconverged_steps", "contact_updates", "seconds"):
        entry[name] = sum(item[name] for item in table)
    for name in ("residual_max", "overlap_max", "violation_max", "pressure_error_max"):
        values = [item[name] for item in table if item.get(name) is not None]
        entry[name] = max(values) if values else None
    rates = [item["inertial_number_max"] for item in table if "inertial_number_max" in item]
    entry["inertial_number"] = max(rates) if rates else None
    return entry
