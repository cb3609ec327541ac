"""The balance of contacts along a run: every interval, its rates and their errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.balance import (
    balance_attributes,
    balance_coordinates,
    balance_item,
    count_balance,
)
from granufab.fabric.contact_identity import (
    ContactRule,
    IdentifiedContacts,
    SeenContacts,
    follow_seen,
    see_contacts,
)
from granufab.fabric.coordination import ZDefinition, check_definition
from granufab.fabric.criterion import Criterion
from granufab.fabric.direction_bins import DirectionBins
from granufab.fabric.frame_map import FrameMap, one_by_one
from granufab.fabric.lattice import lattice_change
from granufab.fabric.run_definitions import recorded_reach, run_definitions
from granufab.history import Frame, Run
from granufab.packing import Array, IntArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FollowedRun", "balance_intervals", "balance_run", "count_error", "follow_run"]

LEAST_STRAIN = 1e-6
"""Intervals below this strain have no rates."""

_PLACE = {
    "eps_q_before": "deviatoric strain at the start, running",
    "eps_q": "deviatoric strain at the end, running",
    "eps_q_total_before": "accumulated deviatoric strain at the start",
    "eps_q_total": "accumulated deviatoric strain at the end",
    "strain": "sampling strain, change of ∫|dε_q| over the interval",
    "stage": "stage of the path",
    "frame_before": "number of the first frame",
    "frame_after": "number of the second frame",
}
_ERRORS = (
    "within an interval gains, losses and crossings of an edge are taken as Poisson events; a "
    "count of 0 has the error of one event"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FollowedRun:
    """The contacts of every frame of a run, identified, and where each frame lies on the path.

    Attributes:
        contacts: of each frame.
        eps_q: running strain of each frame [-].
        eps_q_total: accumulated strain of each frame [-].
        stage: of each frame.
        direction: first contraction axis of the run, unit vector.
        rule: which contacts count.
        name: of the run.
    """

    contacts: Sequence[IdentifiedContacts]
    eps_q: Sequence[float]
    eps_q_total: Sequence[float]
    stage: Sequence[int]
    direction: Array
    rule: ContactRule
    name: str

    def intervals(self, every: int) -> list[tuple[int, int]]:
        """First and last frame of each interval of ``every`` frames, within stages.

        A stage begins at the last frame of the stage before, which a run records at its end.

        Raises:
            InvalidSettings: ``every`` is below 1.
            MissingData: no stage is long enough.
        """
        return _intervals(self.stage, every, self.name)


def balance_run(
    run: Run,
    *,
    every: int = 1,
    criterion: str | Criterion | None = None,
    z_definition: ZDefinition = "z",
    bins: int = 18,
    direction: Array | None = None,
    keep: float | None = None,
    minimum: int = 2,
    each: FrameMap = one_by_one,
) -> xr.Dataset:
    """The balance of every interval of a run, with rates per grain and unit strain.

    An interval lies within one stage; the first of a stage starts at the last frame of the stage
    before. What is left of a stage after its last whole interval is not used. With ``keep`` the
    contacts are followed through every frame, whatever ``every`` is.

    Args:
        run: recorded frames.
        every: frames per interval: the sampling strain in units of the recording interval.
        criterion: default the run's own, else ``force``.
        z_definition: as for :func:`~granufab.fabric.balance`.
        bins: as for :func:`~granufab.fabric.balance`.
        direction: where θ starts, shape (D,); default the run's first contraction axis.
        keep: as for :func:`~granufab.fabric.balance`, from frame to frame.
        minimum: fewest contacts that hold a grain.
        each: finds the contacts of every frame, one by one or in several processes
            (:func:`granufab.campaign.frame_workers`); contacts of no more than an interval's ends
            and of the frames that it works on are held.
    Returns:
        Variables of :func:`~granufab.fabric.balance` over ``interval``; eps_q_before, eps_q,
        eps_q_total_before, eps_q_total, strain, stage, frame_before, frame_after of each;
        gain_rate, loss_rate over ``bin`` [1/rad in 2D, 1/sr in 3D], current_rate and
        current_rate_affine over ``edge`` [-], per grain and unit of ∫|dε_q|, with standard
        errors; NaN where there is no strain.
    Raises:
        MissingData: no stage has ``every`` + 1 frames, or a frame lacks what is needed.
        InvalidSettings: ``every`` is below 1, or as for :func:`~granufab.fabric.balance`.
    """
    _check_interval(every)
    rule = _rule(run, criterion, z_definition, keep, minimum)
    first = run.frames[0]
    axis = first.direction if direction is None else direction
    chosen = DirectionBins.of(axis, bins, first.packing.dimension)
    grain_count = first.packing.grains.count
    del first
    places: list[_Place] = []
    stream = follow_seen(_seen(run, rule, places, each), rule)
    rows = [count_balance(*ends, chosen) for ends in _ends(stream, places, every)]
    intervals = _intervals([place.stage for place in places], every, run.name)
    counts = _Counts(rows, intervals, places, grain_count)
    return _dataset(counts, chosen, rule, run.name, every)


def follow_run(
    run: Run,
    *,
    criterion: str | Criterion | None = None,
    z_definition: ZDefinition = "z",
    keep: float | None = None,
    minimum: int = 2,
) -> FollowedRun:
    """Read every frame of a run once; :func:`balance_intervals` counts at any sampling strain.

    Args:
        run: recorded frames.
        criterion: default the run's own, else ``force``.
        z_definition: as for :func:`~granufab.fabric.balance`.
        keep: as for :func:`~granufab.fabric.balance`, from frame to frame.
        minimum: fewest contacts that hold a grain.
    Raises:
        MissingData: the run has no frames, or a frame lacks what the criterion needs.
        InvalidSettings: an unknown criterion or definition, or a bad ``keep``.
    """
    rule = _rule(run, criterion, z_definition, keep, minimum)
    places: list[_Place] = []
    contacts = list(follow_seen(_seen(run, rule, places, one_by_one), rule))
    eps_q, eps_q_total, stage = zip(*places, strict=True)
    return FollowedRun(
        contacts=contacts,
        eps_q=eps_q,
        eps_q_total=eps_q_total,
        stage=stage,
        direction=run.frames[0].direction,
        rule=rule,
        name=run.name,
    )


def balance_intervals(
    followed: FollowedRun, *, every: int = 1, bins: int = 18, direction: Array | None = None
) -> xr.Dataset:
    """The balance of every interval of a followed run, as :func:`balance_run` gives it.

    Raises:
        MissingData: no stage has ``every`` + 1 frames.
        InvalidSettings: ``every`` is below 1, or bad bins or direction.
    """
    first = followed.contacts[0]
    chosen = DirectionBins.of(
        followed.direction if direction is None else direction, bins, first.normal.shape[1]
    )
    intervals = followed.intervals(every)
    rows = [
        count_balance(followed.contacts[low], followed.contacts[high], chosen)
        for low, high in intervals
    ]
    places = list(map(_Place, followed.eps_q, followed.eps_q_total, followed.stage))
    counts = _Counts(rows, intervals, places, first.grain_count)
    return _dataset(counts, chosen, followed.rule, followed.name, every)


class _Place(NamedTuple):
    """Where a frame lies on the path."""

    eps_q: float
    eps_q_total: float
    stage: int


class _Counts(NamedTuple):
    """What was counted: a row for every interval, and the place of every frame."""

    rows: Sequence[Mapping[str, Any]]
    intervals: Sequence[tuple[int, int]]
    places: Sequence[_Place]
    grain_count: int


def _rule(
    run: Run,
    criterion: str | Criterion | None,
    z_definition: ZDefinition,
    keep: float | None,
    minimum: int,
) -> ContactRule:
    return ContactRule(
        criterion=run_definitions(run, criterion)[0],
        keep=keep,
        z_definition=check_definition(z_definition),
        minimum=minimum,
        reach=recorded_reach(run),
    )


def _see(frame: Frame, *, rule: ContactRule) -> tuple[_Place, SeenContacts]:
    """All that the balance needs of one frame."""
    place = _Place(frame.eps_q, frame.eps_q_total, frame.stage)
    return place, see_contacts(frame.packing, lattice_change(frame), rule)


def _seen(
    run: Run, rule: ContactRule, places: list[_Place], each: FrameMap
) -> Iterator[SeenContacts]:
    """Contacts of every frame; its place is added to ``places``."""
    for place, seen in each(partial(_see, rule=rule), run.frames):
        places.append(place)
        yield seen


def _ends(
    stream: Iterable[IdentifiedContacts], places: Sequence[_Place], every: int
) -> Iterator[tuple[IdentifiedContacts, IdentifiedContacts]]:
    """Contacts at both ends of the intervals that :func:`_intervals` lists, as they come."""
    begun, start = 0, None
    before: IdentifiedContacts | None = None
    for index, contacts in enumerate(stream):
        if start is None:
            start = contacts
        elif places[index].stage != places[index - 1].stage:
            begun, start = index - 1, before
        if start is not None and index - begun == every:
            yield start, contacts
            begun, start = index, contacts
        before = contacts


def _check_interval(every: int) -> None:
    if every < 1:
        raise InvalidSettings(f"an interval must be at least 1 frame, got {every}")


def _intervals(stage: Sequence[int], every: int, name: str) -> list[tuple[int, int]]:
    """First and last frame of each interval, within stages."""
    _check_interval(every)
    stages = np.asarray(stage)
    starts = [0, *(np.flatnonzero(np.diff(stages))).tolist(), len(stages) - 1]
    found = [
        (first, first + every)
        for low, high in pairwise(starts)
        for first in range(low, high - every + 1, every)
    ]
    if not found:
        longest = max(high - low for low, high in pairwise(starts))
        raise MissingData(
            f"run {name!r} has no interval of {every} frames within a stage; its longest "
            f"stage has {longest}"
        )
    return found


def _dataset(
    counts: _Counts, bins: DirectionBins, rule: ContactRule, name: str, every: int
) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    rows = counts.rows
    data = {key: balance_item(key, [row[key] for row in rows], over="interval") for key in rows[0]}
    data |= _places(counts)
    dataset = xr.Dataset(data, coords=balance_coordinates(bins))
    dataset = dataset.assign(_rates(dataset, counts.grain_count, bins))
    attributes = balance_attributes(rule, bins, counts.grain_count)
    return dataset.assign_attrs(attributes, path=name, interval_frames=every, error_bars=_ERRORS)


def _places(counts: _Counts) -> dict[str, tuple]:
    low, high = np.array(counts.intervals).T
    eps_q, total, stage = (np.array(column) for column in zip(*counts.places, strict=True))
    columns = {
        "eps_q_before": eps_q[low],
        "eps_q": eps_q[high],
        "eps_q_total_before": total[low],
        "eps_q_total": total[high],
        "strain": total[high] - total[low],
        "stage": stage[high],
        "frame_before": low,
        "frame_after": high,
    }
    return {
        name: ("interval", value, {"units": "-", "long_name": _PLACE[name]})
        for name, value in columns.items()
    }


def _rates(dataset: xr.Dataset, grain_count: int, bins: DirectionBins) -> dict[str, tuple]:
    """Counts per grain, unit strain and, for gain and loss, unit of direction."""
    strain = dataset["strain"].to_numpy()
    per = np.where(strain > LEAST_STRAIN, strain, math.nan)[:, None] * grain_count
    unit = "1/rad" if bins.dimension == 2 else "1/sr"
    rates: dict[str, tuple] = {}
    for name in ("gain", "loss"):
        count = dataset[name].to_numpy()
        where, size = ("interval", "bin"), per * bins.measure
        text = {"units": unit, "long_name": f"contacts {name} per grain and unit strain"}
        rates[f"{name}_rate"] = (where, count / size, text)
        rates[f"{name}_rate_error"] = (where, count_error(count) / size, _error_of(text))
    where = ("interval", "edge")
    text = {"units": "-", "long_name": "current J per grain and unit strain, growing θ positive"}
    rates["current_rate"] = (where, dataset["current"].to_numpy() / per, text)
    error = count_error(dataset["crossings"].to_numpy()) / per
    rates["current_rate_error"] = (where, error, _error_of(text))
    affine = {"units": "-", "long_name": "J of the mean flow per grain and unit strain"}
    rates["current_rate_affine"] = (where, dataset["current_affine"].to_numpy() / per, affine)
    return rates


def count_error(count: Array | IntArray) -> Array:
    """Standard error of Poisson counts; that of one event where there is none."""
    return np.sqrt(np.maximum(count, 1.0))


def _error_of(text: Mapping[str, str]) -> dict[str, str]:
    return {"units": text["units"], "long_name": "standard error of " + text["long_name"]}
