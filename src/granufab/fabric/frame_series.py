"""The series of a run whose source has frames alone: one row for each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from granufab.fabric.measure_run import measure_run
from granufab.history import SERIES_UNITS, Run, series_dataset

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["frame_series", "with_series"]


def frame_series(run: Run) -> xr.Dataset:
    """Rows as a running simulation records them, measured from the frames.

    Args:
        run: reads every frame once; its own criterion and definition of z are used.
    Returns:
        Variables :data:`~granufab.history.SERIES_UNITS` over ``record``, NaN where unknown.
    Raises:
        MissingData: a frame holds nothing to measure.
    """
    table = measure_run(run)
    rows: list[Mapping[str, float]] = []
    for index in range(table.sizes["frame"]):
        known = {name: float(table[name][index]) for name in SERIES_UNITS if name in table}
        rows.append(dict.fromkeys(SERIES_UNITS, float("nan")) | known)
    names = ("path", "criterion", "z_definition", "dimension")
    return series_dataset(rows, {name: table.attrs[name] for name in names})


def with_series(run: Run) -> Run:
    """The run itself if it has a series, else with the one that its frames give."""
    return (
        run if run.series.sizes.get("record", 0) else replace(run, series_source=frame_series(run))
    )
