"""Follow a recipe: run its paths, fit the accessible states, leave figure, JSON and CSV."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granufab.errors import InvalidSettings, NotConverged
from granufab.history import Run
from granufab.io import json_text, write_json, write_series
from granufab.reproduce.case_folder import Progress, RunCase, read_run
from granufab.reproduce.out_folder import prepare_out_folder
from granufab.reproduce.report import fit_all, report
from granufab.reproduce.workers import Job, nearest_sample, run_jobs

__all__ = ["FIGURES", "QUICK_GRAINS", "reproduce"]

FIGURES = ("fig5", "fig6", "fig7", "fig8")
QUICK_GRAINS = 1000
SAMPLE_SHARE = 0.2  # of the progress, where the sample is made first


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
    """Simulate and draw one of the paper's figures [Radjai2012, Figs 5–8].

    Leaves ``figN.pdf figN.png figN.json figN.csv summary.json`` in ``out``, and each path's run
    in ``out/runs/<path>/``.

    Args:
        figure: fig5, fig6, fig7 or fig8.
        out: folder; by default ``./granufab-figN``, which may be replaced.
        quick: 1000 grains a sample, at the same solver tolerance.
        grains: grains a sample, instead of the figure's own or the quick number.
        seed: of the first sample; with several seeds, the root of independent ones.
        seeds: samples of each path; fits and figures use all of them.
        force: allow ``out`` to hold other files.
        workers: processes at a time; by default one per core, at most one per run.
        progress: called with a line of text and the fraction done.
        run_case: what simulates a case; :func:`granufab.simulate.run_case` by default.
        prepare: what makes a sample that paths share; :func:`granufab.prepare` by default.
    Returns:
        The content of ``figN.json``.
    Raises:
        InvalidSettings: unknown figure, bad number, or a folder that must not be written.
        GranufabError: a path failed; the message names it.
    """
    _check(figure, grains, seed, seeds, workers)
    recipe = import_module(f"granufab.reproduce.{figure}").RECIPE
    grain_count = grains if grains is not None else QUICK_GRAINS if quick else recipe.grain_count
    folder = prepare_out_folder(figure, out, force=force)
    began = time.perf_counter()

    jobs = _jobs(recipe, folder, grain_count, _seeds(seed, seeds))
    every = [job for repeats in jobs.values() for job in repeats]
    if recipe.one_sample:
        every = _with_samples(every, prepare, _part(progress, 0.0, SAMPLE_SHARE))
        progress = _part(progress, SAMPLE_SHARE, 1.0)
    run_jobs(every, workers=workers, progress=progress, run_case=run_case)
    runs = {name: [read_run(job.folder) for job in repeats] for name, repeats in jobs.items()}

    outcome = fit_all(recipe, runs, z_definition=every[0].case.record.z_definition)
    result = report(outcome, cases=[job.case for job in every])
    result["settings"] = {"figure": figure, "quick": quick, "seeds": seeds, **result["settings"]}
    result["seed"] = seed
    result["wall_seconds"] = time.perf_counter() - began
    return _leave(figure, folder, outcome, result, runs)


def _check(figure: str, grains: int | None, seed: int, seeds: int, workers: int | None) -> None:
    if figure not in FIGURES:
        raise InvalidSettings(f"figure {figure!r} is unknown; known: {', '.join(FIGURES)}")
    for name, value, least in (
        ("grains", grains, 1),
        ("seed", seed, 0),
        ("seeds", seeds, 1),
        ("workers", workers, 1),
    ):
        if value is not None and value < least:
            raise InvalidSettings(f"{name} must be at least {least}, got {value}")


def _seeds(seed: int, count: int) -> list[int]:
    if count == 1:
        return [seed]
    children = np.random.SeedSequence(seed).spawn(count)
    return [int(child.generate_state(1)[0]) for child in children]


def _jobs(recipe: Any, folder: Path, grain_count: int, seeds: list[int]) -> dict[str, list[Job]]:
    jobs: dict[str, list[Job]] = {}
    for index, seed in enumerate(seeds):
        for path in recipe.paths:
            name = path.name if len(seeds) == 1 else f"{path.name}-s{index + 1}"
            case = path.case(grain_count=grain_count, seed=seed, name=name)
            job = Job(case=case, folder=folder / "runs" / name)
            jobs.setdefault(path.name, []).append(job)
    return jobs


def _with_samples(
    jobs: list[Job], prepare: Callable[..., Any] | None, progress: Progress
) -> list[Job]:
    """The jobs with their starting samples; jobs of the same sample settings share one."""
    if prepare is None:
        from granufab.simulate import prepare as prepare_sample

        prepare = prepare_sample
    wanted = list(dict.fromkeys(job.case.sample for job in jobs))
    made = {}
    for index, sample in enumerate(wanted):
        tell = _part(progress, index / len(wanted), (index + 1) / len(wanted))
        try:
            made[sample] = prepare(sample, progress=tell)
        except NotConverged as error:
            nearest = nearest_sample(sample, error)
            if nearest is None:
                raise
            made[sample] = prepare(nearest, progress=tell)
    return [replace(job, start=made[job.case.sample]) for job in jobs]


def _part(progress: Progress | None, low: float, high: float) -> Progress:
    """Progress over a part of the whole."""

    def tell(text: str, share: float) -> None:
        if progress is not None:
            progress(text, low + (high - low) * min(max(share, 0.0), 1.0))

    return tell


def _leave(
    figure: str,
    folder: Path,
    outcome: Any,
    result: dict[str, Any],
    runs: Mapping[str, list[Run]],
) -> dict[str, Any]:
    from granufab.plots import save

    save(outcome.recipe.draw(outcome), folder / figure)
    write_series(_joined(runs), folder / f"{figure}.csv")
    result = json.loads(json_text(result))
    write_json(result, folder / f"{figure}.json")
    write_json({figure: result}, folder / "summary.json")
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
