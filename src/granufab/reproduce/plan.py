"""What has to be run for some figures: each distinct simulation once, shared where it can be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granufab.reproduce.recipe import Recipe
from granufab.reproduce.workers import Job
from granufab.simulate.settings import Case

__all__ = ["Plan", "independent_seeds", "make_plan"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Jobs, and which of them each path of each figure is made of.

    Attributes:
        jobs: every distinct simulation, once.
        figures: the repeats of each path by the names of figure and path.
    """

    jobs: Sequence[Job]
    figures: Mapping[str, Mapping[str, list[Job]]]


def make_plan(
    recipes: Mapping[str, Recipe],
    folder: Path,
    grain_counts: Mapping[str, int],
    seeds: list[int],
) -> Plan:
    """Plan the runs of some figures.

    Cases that are equal save for their names are one run, in the folder named after the last
    figure that shows it (after the path alone where there is only one figure). A sample from
    which several runs start is made once.

    Args:
        recipes: by the figure's name.
        folder: the runs go to its folder ``runs``.
        grain_counts: grains per sample of each figure.
        seeds: one for each repeat of every path.
    """
    cases: dict[str, dict[str, list[Case]]] = {}
    names: dict[Case, str] = {}
    for figure, recipe in recipes.items():
        for index, seed in enumerate(seeds):
            for path in recipe.paths:
                name = path.name if len(recipes) == 1 else f"{figure}-{path.name}"
                name = name if len(seeds) == 1 else f"{name}-s{index + 1}"
                case = path.case(grain_count=grain_counts[figure], seed=seed, name=" ")
                names[case] = name
                cases.setdefault(figure, {}).setdefault(path.name, []).append(case)
    uses = Counter(case.sample for case in names)
    jobs = {
        case: Job(
            case=case.model_copy(update={"name": name}),
            folder=folder / "runs" / name,
            shared=uses[case.sample] > 1,
        )
        for case, name in names.items()
    }
    figures = {
        figure: {name: [jobs[case] for case in repeats] for name, repeats in paths.items()}
        for figure, paths in cases.items()
    }
    return Plan(jobs=list(jobs.values()), figures=figures)


def independent_seeds(seed: int, count: int) -> list[int]:
    """``seed`` itself, or the seeds of ``count`` independent repeats that grow from it."""
    if count == 1:
        return [seed]
    children = np.random.SeedSequence(seed).spawn(count)
    return [int(child.generate_state(1)[0]) for child in children]
