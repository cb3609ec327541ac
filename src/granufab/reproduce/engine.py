"""Follow recipes: run their paths, fit the accessible states, leave figures, JSON and CSV."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import xarray as xr

from granufab.errors import GranufabError, InvalidSettings
from granufab.history import Run
from granufab.io import json_text, write_json, write_series
from granufab.reproduce.case_folder import Progress, RunCase, read_run
from granufab.reproduce.out_folder import prepare_out_folder
from granufab.reproduce.plan import independent_seeds, make_plan
from granufab.reproduce.recipe import Recipe
from granufab.reproduce.report import fit_all, report
from granufab.reproduce.workers import Job, run_jobs

__all__ = ["FIGURES", "QUICK_GRAINS", "reproduce"]

FIGURES = tuple(f"fig{number}" for number in range(1, 9))
"""Names that :func:`reproduce` knows, ``all`` apart."""
QUICK_GRAINS = 1000


def reproduce(
    figure: str,
    *,
    out: Path | str | None = None,
    quick: bool = False,
    grains: int | None = None,
    seed: int = 1,
    seeds: int = 1,
    force: bool = False,
    workers: int | None = None,
    progress: Progress | None = None,
    run_case: RunCase | None = None,
    prepare: Callable[..., Any] | None = None,
) -> dict[str, Any]:
    """Simulate and draw one of the paper's figures, or all of them [Radjai2012, Figs 1–8].

    Leaves ``figN.pdf figN.png figN.json figN.csv summary.json`` in ``out``, and each run in a
    folder of ``out/runs``. A simulation that several figures show is run once.

    Args:
        figure: fig1 … fig8, or all.
        out: folder; by default ``./granufab-figN`` (``./granufab-all``), which may be replaced.
        quick: 1000 grains a sample, at the same rate and solver tolerance.
        grains: grains a sample, instead of the figure's own or the quick number.
        seed: of the first sample; with several seeds, the root of independent ones.
        seeds: samples of each path; fits and figures use all of them.
        force: allow ``out`` to hold other files.
        workers: processes at a time; by default one per core, at most one per run.
        progress: called with a line of text and the fraction done.
        run_case: what simulates a case; :func:`granufab.simulate.run_case` by default.
        prepare: what makes a sample that runs share; :func:`granufab.prepare` by default.
    Returns:
        The content of ``figN.json``; of all, by the name of the figure.
    Raises:
        InvalidSettings: unknown figure, bad number, or a folder that must not be written.
        GranufabError: a path failed; the message names it. Where one figure of all cannot be
            made from its runs, the others are left first.
    """
    _check(figure, grains, seed, seeds, workers)
    recipes: dict[str, Recipe] = {
        name: import_module(f"granufab.reproduce.{name}").RECIPE
        for name in (FIGURES if figure == "all" else (figure,))
    }
    quick_or_own = {n: QUICK_GRAINS if quick else r.grain_count for n, r in recipes.items()}
    grain_counts = {name: grains or count for name, count in quick_or_own.items()}
    folder = prepare_out_folder(figure, tuple(recipes), out, force=force)
    began = time.perf_counter()

    plan = make_plan(recipes, folder, grain_counts, independent_seeds(seed, seeds))
    run_jobs(plan.jobs, workers=workers, progress=progress, run_case=run_case, prepare=prepare)
    results: dict[str, Any] = {}
    failures: list[GranufabError] = []
    for name, recipe in recipes.items():
        asked = {"figure": name, "quick": quick, "seeds": seeds}
        try:
            results[name] = _leave(recipe, folder, plan.figures[name], asked, seed, began)
        except GranufabError as error:
            if figure != "all":
                raise
            failures.append(type(error)(f"{name}: {error}"))
            results[name] = {"error": str(error)}
    write_json(results, folder / "summary.json")
    if failures:
        raise failures[0]
    return results if figure == "all" else results[figure]


def _check(figure: str, grains: int | None, seed: int, seeds: int, workers: int | None) -> None:
    if figure not in (*FIGURES, "all"):
        raise InvalidSettings(f"figure {figure!r} is unknown; known: {', '.join(FIGURES)}, all")
    for name, value, least in (
        ("grains", grains, 1),
        ("seed", seed, 0),
        ("seeds", seeds, 1),
        ("workers", workers, 1),
    ):
        if value is not None and value < least:
            raise InvalidSettings(f"{name} must be at least {least}, got {value}")


def _leave(
    recipe: Recipe,
    folder: Path,
    jobs: Mapping[str, list[Job]],
    asked: Mapping[str, Any],
    seed: int,
    began: float,
) -> dict[str, Any]:
    """Fit, draw and write one figure; returns the content of its JSON file."""
    from granufab.plots import save

    runs = {name: [read_run(job.folder) for job in repeats] for name, repeats in jobs.items()}
    definition = next(iter(jobs.values()))[0].case.record.z_definition
    outcome = fit_all(recipe, runs, z_definition=definition)
    save(recipe.draw(outcome), folder / recipe.figure)
    write_series(_joined(runs), folder / f"{recipe.figure}.csv")
    result = report(outcome, jobs, folder)
    result["settings"] = {**asked, **result["settings"]}
    result["seed"] = seed
    result["wall_seconds"] = time.perf_counter() - began
    result = json.loads(json_text(result))
    write_json(result, folder / f"{recipe.figure}.json")
    return result


def _joined(runs: Mapping[str, list[Run]]) -> xr.Dataset:
    """All series, one after another; the coordinate ``path`` names each record's path."""
    parts: list[xr.Dataset] = []
    for name, repeats in runs.items():
        for index, run in enumerate(repeats):
            label = name if len(repeats) == 1 else f"{name}-s{index + 1}"
            records = ("record", [label] * run.series.sizes["record"])
            parts.append(run.series.drop_vars("path", errors="ignore").assign_coords(path=records))
    return xr.concat(parts, dim="record", combine_attrs="drop", join="exact")
