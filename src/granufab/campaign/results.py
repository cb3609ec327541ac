"""Gather a campaign: one dataset over its cases, fits with intervals, parameters beside."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granufab.campaign.folder import CampaignFolder, is_finished
from granufab.campaign.identity import digest_of
from granufab.campaign.settings import RESULTS
from granufab.errors import GranufabError, MissingData
from granufab.history import Run
from granufab.reproduce.case_folder import read_run
from granufab.reproduce.recipe import reached_z
from granufab.reproduce.report import critical_means
from granufab.reproduce.series_fit import fit_series
from granufab.reproduce.symmetry import described_series
from granufab.states import Estimate

__all__ = ["INTERVALS", "gather"]

FITTED = ("z_star", "a_star", "z_min", "z_max")
AVERAGED = {"q_over_p_star": "q_over_p", "phi_star": "phi"}
INTERVALS = (*FITTED, *AVERAGED)
"""Results that have an interval of each case and one over the seeds of the same parameters."""

UNKNOWN = Estimate(np.nan, np.nan, np.nan)
Estimates = dict[str, Estimate]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    id: str
    seed: int
    parameters: Mapping[str, Any]
    run: Run | None
    note: str = ""


def gather(folder: Path | str) -> xr.Dataset:
    r"""What the finished cases of a campaign gave, as one dataset.

    Every case is fitted as ``granufab fit`` does (method critical, moving-block bootstrap, 95 %):
    ``z_star``, ``a_star``, ``z_min``, ``z_max``, ``q_over_p_star``, ``phi_star`` with ``…_low`` and
    ``…_high``. The same names with ``_seeds`` (``z_star_seeds``, ``z_star_seeds_low``, …) belong
    to all seeds of the same parameters together; their intervals are of a bootstrap over seeds
    and blocks.

    Args:
        folder: of the campaign.
    Returns:
        Variables over ``case``; coordinates: the parameters, ``seed``, ``point`` (number of the
        parameter set) and ``note`` (why something is nan).
    Raises:
        MissingData: the folder holds no campaign, or no case is done.
    Source: [Radjai2012], eqs. 19–22; Künsch, Ann. Stat. 17, 1217 (1989).
    """
    place = CampaignFolder(Path(folder))
    notes = place.read_notes()
    cases = [
        _open(place, identifier, entry)
        for identifier, entry in notes["cases"].items()
        if is_finished(place.case(identifier), digest_of(identifier))
    ]
    if not cases:
        raise MissingData(f"{folder}: no case is done yet; run the sweep first")
    points = _points(cases)
    table, words = _results(cases, points)
    return _dataset(cases, points, table, words, notes)


def _open(place: CampaignFolder, identifier: str, entry: Mapping[str, Any]) -> _Case:
    run, note = None, ""
    try:
        run = read_run(place.case(identifier))
    except GranufabError as error:
        note = str(error)
    return _Case(
        id=identifier, seed=entry["seed"], parameters=entry["parameters"], run=run, note=note
    )


def _points(cases: Sequence[_Case]) -> list[int]:
    """Number of each case's parameter set, counted as they come."""
    numbers: dict[str, int] = {}
    keys = [json.dumps(case.parameters, sort_keys=True) for case in cases]
    return [numbers.setdefault(key, len(numbers)) for key in keys]


def _results(cases: Sequence[_Case], points: Sequence[int]) -> tuple[dict[str, Any], list[str]]:
    columns: dict[str, list[float]] = {}
    words = []
    pooled: dict[int, Estimates] = {}
    own = [_fit([case]) for case in cases]
    for number in set(points):
        group = [k for k, point in enumerate(points) if point == number]
        several = len(group) > 1
        pooled[number] = _fit([cases[k] for k in group])[0] if several else own[group[0]][0]
    for case, point, (found, note) in zip(cases, points, own, strict=True):
        words.append(case.note or note)
        row = _flat(found) | _flat(pooled[point], "_seeds") | _plain(case.run)
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    return columns, words


def _flat(found: Estimates, ending: str = "") -> dict[str, float]:
    row: dict[str, float] = {}
    for name in INTERVALS:
        one = found.get(name, UNKNOWN)
        parts = {"": one.value, "_low": one.low, "_high": one.high}
        row |= {f"{name}{ending}{part}": value for part, value in parts.items()}
    return row


def _fit(cases: Sequence[_Case]) -> tuple[Estimates, str]:
    """Estimates of cases together, and why some are missing."""
    runs = [case.run for case in cases if case.run is not None]
    seeds = [case.seed for case in cases if case.run is not None]
    if not runs:
        return {}, "no run can be read"
    found: Estimates = {}
    notes = []
    definition = _definition(runs[0])
    several = seeds if len(seeds) > 1 else None
    try:
        fit, _ = fit_series([described_series(run) for run in runs], "critical", definition,
                            seeds=several)  # fmt: skip
        found |= {name: getattr(fit, name) for name in FITTED}
    except GranufabError as error:
        notes.append(f"not fitted: {error}")
    try:
        state = critical_means(runs, definition, list(AVERAGED.values()))
        found |= {name: state.others[column] for name, column in AVERAGED.items()}
    except GranufabError as error:
        notes.append(f"not averaged: {error}")
    return found, "; ".join(dict.fromkeys(notes))


def _definition(run: Run) -> str:
    return str((run.settings.get("record") or {}).get("z_definition", "z_backbone"))


def _plain(run: Run | None) -> dict[str, float]:
    summary: Mapping[str, Any] = {} if run is None else run.summary
    steps = summary.get("steps") or np.nan
    values = {
        "z_0": np.nan if run is None else reached_z(run, _definition(run)),
        "nonconverged_share": summary.get("nonconverged_steps", np.nan) / steps,
        **{
            name: summary.get(name, np.nan)
            for name in ("residual_max", "overlap_max", "inertial_number_max")
        },
    }
    return {name: np.nan if value is None else float(value) for name, value in values.items()}


def _dataset(
    cases: Sequence[_Case],
    points: Sequence[int],
    table: Mapping[str, Sequence[float]],
    words: Sequence[str],
    notes: Mapping[str, Any],
) -> xr.Dataset:
    keys: Mapping[str, str] = notes["parameters"]
    coordinates: dict[str, Any] = {
        "case": np.array([case.id for case in cases]),
        "seed": ("case", _values([case.seed for case in cases])),
        "point": ("case", np.array(points, dtype=np.int32)),
        "note": ("case", np.array(words)),
    }
    for name, key in keys.items():
        values = _values([case.parameters[name] for case in cases])
        coordinates[name] = ("case", values, {"long_name": key})
    variables = {name: ("case", np.array(values), _about(name)) for name, values in table.items()}
    definitions = {_definition(case.run) for case in cases if case.run is not None}
    attributes = {
        "name": notes["name"],
        "parameters": ", ".join(keys),
        "z_definition": ", ".join(sorted(definitions)),
        "criterion": "force",
        "fit": "critical",
        "interval": "95 %",
    }
    return xr.Dataset(variables, coords=coordinates, attrs=attributes)


def _about(name: str) -> dict[str, str]:
    """Unit and meaning of a variable."""
    base = next(known for known in sorted(RESULTS, key=len, reverse=True) if name.startswith(known))
    parts = {"seeds": "over all seeds", "low": "lower end", "high": "upper end"}
    more = [parts[part] for part in name.removeprefix(base).split("_") if part]
    return {"units": "-", "long_name": ", ".join([RESULTS[base], *more])}


def _values(values: Sequence[Any]) -> Any:
    """An array that NetCDF 3 holds: of text where the kinds differ or a number is too long."""
    if len({isinstance(value, str) for value in values}) > 1:
        return np.array([str(value) for value in values])
    if all(isinstance(v, int) for v in values) and any(abs(v) >= 2**31 for v in values):
        return np.array([str(value) for value in values])
    return np.array(values)
