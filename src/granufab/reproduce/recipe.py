"""A figure of the paper as a frozen recipe, and what running it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from granufab.history import Run
from granufab.packing import Array
from granufab.simulate.settings import Case, Material, Sample, Stage
from granufab.states import AccessibleFit

Loading = Literal["constant-mean", "biaxial", "triaxial", "simple-shear", "simple-shear-volume"]

__all__ = ["Outcome", "PathRecipe", "Recipe", "column", "first_stage", "last_stage", "reached_z"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PathRecipe:
    """One path of a figure.

    Attributes:
        name: name in series, folders and the legend's data.
        label: text of the legend; {z_0} becomes the value that was reached.
        coordination: wanted z_0 of the isotropic sample [-], or None.
        compaction_friction: of the sample where no z_0 is wanted [-].
        friction: µ while the path is followed [-].
        dimension: 2 (disks) or 3 (spheres).
        loading: of every stage, a name of :class:`granufab.simulate.settings.Stage`.
        b: (ε̇_2 − ε̇_3)/(ε̇_1 − ε̇_3) in 3D at constant mean stress; None is axisymmetric.
        strains: deviatoric strain of each stage; negative reverses, or extends in 3D [-].
    """

    name: str
    label: str = ""
    coordination: float | None = None
    compaction_friction: float = 0.0
    friction: float = 0.4
    dimension: Literal[2, 3] = 2
    loading: Loading = "constant-mean"
    b: float | None = None
    strains: tuple[float, ...] = (0.3,)

    def case(self, *, grain_count: int, seed: int, name: str | None = None) -> Case:
        """The case to run, at the default solver settings and the default rate."""
        return Case(
            name=name or self.name,
            sample=Sample(
                grain_count=grain_count,
                dimension=self.dimension,
                coordination=self.coordination,
                friction=self.compaction_friction,
                seed=seed,
            ),
            material=Material(friction=self.friction),
            path=tuple(Stage(loading=self.loading, strain=e, b=self.b) for e in self.strains),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What the paths of a figure gave.

    Attributes:
        recipe: the recipe that was followed.
        runs: repeats of each path, by the path's name.
        fits: accessible domain of all paths together, by method; none where the recipe has none.
        failures: why a method is not among the fits.
        path_fits: critical-state fit of each path, where the recipe wants it.
        z_definition: column of the coordination number.
    """

    recipe: Recipe
    runs: Mapping[str, list[Run]]
    fits: Mapping[str, AccessibleFit]
    failures: Mapping[str, str]
    path_fits: Mapping[str, AccessibleFit]
    z_definition: str

    @property
    def labels(self) -> dict[str, str]:
        """Text of the legend of each path, with the z_0 that was reached."""
        labels = {}
        for path in self.recipe.paths:
            z_0 = np.mean([reached_z(run, self.z_definition) for run in self.runs[path.name]])
            labels[path.name] = path.label.replace("{z_0}", f"{z_0:.2f}")
        return labels

    @property
    def labelled(self) -> dict[str, list[Run]]:
        """The repeats of each path by the text of the legend."""
        return {self.labels[name]: runs for name, runs in self.runs.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A figure: its paths, and how it is drawn.

    Attributes:
        figure: name, for example fig7.
        paths: the paths it shows.
        grain_count: grains per sample at full size.
        draw: makes the figure.
        extra: further entries of the figure's JSON file.
        fit_from: name of the path whose states alone define the domain; None takes all paths.
        fit_each: fit each path by itself too.
        without_fit: why no accessible domain is fitted; empty where one is.
    """

    figure: str
    paths: tuple[PathRecipe, ...]
    draw: Callable[[Outcome], Figure]
    grain_count: int = 5000
    extra: Callable[[Outcome], dict[str, Any]] = field(default=lambda outcome: {})
    fit_from: str | None = None
    fit_each: bool = False
    without_fit: str = ""


def first_stage(series: xr.Dataset) -> xr.Dataset:
    """The records up to the first reversal of the strain (all of them if there is none)."""
    turn = _turn(series)
    return series if turn is None else series.isel(record=slice(0, turn + 1))


def last_stage(series: xr.Dataset) -> xr.Dataset | None:
    """The records from the first reversal of the strain on, or None without one."""
    turn = _turn(series)
    return None if turn is None else series.isel(record=slice(turn, None))


def _turn(series: xr.Dataset) -> int | None:
    step = np.diff(column(series, "eps_q"))
    moving = np.flatnonzero(step)
    if len(moving) == 0:
        return None
    back = np.flatnonzero(np.sign(step) == -np.sign(step[moving[0]]))
    return int(back[0]) if len(back) else None


def column(series: xr.Dataset, name: str) -> Array:
    """One column of a series as numbers."""
    return np.asarray(series[name].values, dtype=float)


def reached_z(run: Run, z_definition: str) -> float:
    """z_0 of the isotropic sample at rest, or of the first record where that is not known."""
    sample = run.summary.get("sample") or {}
    value = sample.get(z_definition)
    return float(column(run.series, z_definition)[0] if value is None else value)
