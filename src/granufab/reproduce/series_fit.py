"""The accessible domain of recorded series: what is fitted, with which symmetry and rows."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
import xarray as xr

from granufab.errors import MissingData
from granufab.reproduce.recipe import first_stage
from granufab.reproduce.symmetry import fit_symmetry, series_symmetry
from granufab.states import AccessibleFit, fit_accessible_states
from granufab.states.domain import Mode
from granufab.states.fit import Method

__all__ = ["counted_strain", "default_definition", "fit_series", "known_rows"]


def fit_series(
    paths: Sequence[xr.Dataset],
    method: Method = "critical",
    z_definition: str | None = None,
    *,
    dimension: int | None = None,
    mode: Mode | None = None,
    b: float | None = None,
    seeds: Sequence[Hashable] | None = None,
) -> tuple[AccessibleFit, str]:
    """Fit the domain to some series; returns the fit and the definition of z it used.

    What is not given of dimension, mode and b comes from the attributes of the series
    (:mod:`granufab.reproduce.symmetry`) and the sign of a' on the plateau. With the ``seeds`` of
    the paths the intervals hold the scatter between samples too.
    """
    definition = z_definition or default_definition(paths)
    stages = [first_stage(path) for path in paths]
    rows = [known_rows(stage, definition) for stage in stages]
    symmetries = [series_symmetry(path).but(dimension=dimension, mode=mode, b=b) for path in paths]
    options = fit_symmetry(symmetries, stages).options()
    strain, z, a = ([row[name] for row in rows] for name in ("eps_q", definition, "a"))
    return fit_accessible_states(strain, z, a, method=method, seeds=seeds, **options), definition


def counted_strain(path: xr.Dataset) -> xr.Dataset:
    """The series itself, or with its rows (frames) as strain where it holds none."""
    if "eps_q" in path and not bool(path["eps_q"].isnull().all()):
        return path
    return path.assign(eps_q=("record", [float(k) for k in range(path.sizes["record"])]))


def default_definition(paths: Sequence[xr.Dataset]) -> str:
    """z_backbone where every path has it, else z."""
    return "z_backbone" if all("z_backbone" in path for path in paths) else "z"


def known_rows(path: xr.Dataset, definition: str) -> dict:
    """The rows where strain, z and a are known; a is the signed one where the series has it."""
    signed = "a_signed" in path and not bool(path["a_signed"].isnull().all())
    columns = {"eps_q": "eps_q", definition: definition, "a": "a_signed" if signed else "a"}
    for name in columns.values():
        if name not in path:
            held = ", ".join(str(key) for key in path.data_vars)
            raise MissingData(f"the series has no column {name}; it holds {held}")
    table = np.array([path[name].values for name in columns.values()], dtype=float)
    known = table[:, np.isfinite(table).all(axis=0)]
    if not known.size:
        raise MissingData(
            f"the series has no row where {', '.join(columns.values())} are all known"
        )
    return dict(zip(columns, known, strict=True))
