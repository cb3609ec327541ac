"""Walks a running system along its path, records on the way, and stops where it can go on.

Between two calls of the engine the follower and the system together are a complete state: it can
be kept (:meth:`Follower.held`), and another follower of the same path goes on from it with the same
bits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from granufab.history import Recorder, StepStatistics
from granufab.packing import Array
from granufab.simulate.capture import StepTally, capture_frame, merge, series_row
from granufab.simulate.loading import Loading
from granufab.simulate.settings import Record
from granufab.simulate.snapshot import restore, snapshot
from granufab.simulate.stepping import Simulation, Watch

__all__ = ["Follower", "Keeper", "Step"]

REST_ENERGY, REST_STEPS, DAMPING = 1e-8, 3000, 0.5
SECONDS_BETWEEN_NEWS = 0.3
MANY = 10_000
EARLY, LATE, SLACK = 1 + 1e-9, 1e-12, 1e-13
_PLACE = ("eps_q", "eps_q_total", "stage", "inertial_number")
_OWN = (
    "next_row",
    "next_frame",
    "restless",
    "entered",
    "walked",
    "made",
    "seconds",
    "inertial_max",
)
_STATISTICS = tuple(field.name for field in fields(StepStatistics))

Tell = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One stage of a path for :func:`granufab.run`.

    Attributes:
        loading: what drives the cell.
        strain: |Δε_q| to walk; None relaxes at constant stress until the grains rest.
    """

    loading: Loading
    strain: float | None

    @property
    def rests(self) -> bool:
        """Whether the grains come to rest instead of being sheared."""
        return self.strain is None or self.loading.nominal_rate == 0


class Keeper(Protocol):
    """Keeps states from which a path can go on."""

    def due(self, strain: float) -> bool:
        """Whether a state is wanted now, ``strain`` = ∫|dε_q| into the path; may end it.

        Raises:
            KeyboardInterrupt: the path shall end here.
        """
        ...

    def keep(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Keep a state; what was recorded before it belongs to it."""
        ...


class Follower:
    """Drives one simulation along its path and feeds the recorders.

    Args:
        simulation: at the start of the path.
        path: its stages.
        recorders: receive frames and rows as they come.
        settings: how often.
        name: of the path.
        tell: called with a text and the fraction done, a few times a second.
        keeper: asked after every record and every call of the engine.
    """

    def __init__(
        self,
        simulation: Simulation,
        path: Sequence[Step],
        recorders: Sequence[Recorder],
        settings: Record,
        *,
        name: str,
        tell: Tell | None = None,
        keeper: Keeper | None = None,
    ) -> None:
        axes = next((s.loading for s in path if s.loading.deviatoric_rate), path[0].loading)
        self.simulation, self.path, self.recorders = simulation, path, recorders
        self.settings, self.tell, self.keeper, self.name = settings, tell, keeper, name
        self.tally = StepTally()
        self.whole = self.since_frame = StepStatistics()
        self.place: dict[str, Any] = {
            "name": name,
            "eps_q": 0.0,
            "eps_q_total": 0.0,
            "stage": 0,
            "inertial_number": 0.0,
            "direction": axes.direction,
            "extension": axes.extension,
            "minor": None if axes.axisymmetric else axes.extension,
            "z_definition": settings.z_definition,
            "reach": min(settings.reach, simulation.solver.skin),
        }
        self.next_row = self.next_frame = 0.0
        self.restless = self.entered = self.settled = False
        self.walked, self.made, self.seconds, self.inertial_max = 0.0, 0, 0.0, 0.0
        self._told, self._began = 0.0, time.perf_counter()

    def walk(self) -> None:
        """Follow the path from where it stands to its end.

        Raises:
            KeyboardInterrupt: asked to stop; the state can be kept if ``settled``.
        """
        if not self.recorded:
            self._start()
        while self.place["stage"] < len(self.path):
            step = self.path[self.place["stage"]]
            if not self.entered:
                self._enter(step)
            if step.rests:
                self._relax()
            else:
                self._shear(abs(step.strain or 0.0))
            self.settled = False
            self.place["stage"] += 1
            self.entered, self.walked, self.made = False, 0.0, 0
        self.place["stage"] = len(self.path) - 1

    @property
    def recorded(self) -> bool:
        """Whether the start is on record."""
        return self.next_row > 0

    def _start(self) -> None:
        """Record the starting state with the forces it came with, at ε_q = 0."""
        self.simulation.stress = self.simulation.stress_of_impulses()
        self._write_row()
        self._write_frame()
        self.next_row = self.settings.series_interval * (1 - 1e-6)
        self.next_frame = self.settings.frame_interval * (1 - 1e-6)
        self._settle("start", first=True)

    def _enter(self, step: Step) -> None:
        """Begin a stage."""
        self._load(step)
        self.simulation.remove_drift()
        self.simulation.damping = DAMPING if step.rests else 0.0
        self.entered = True

    def _load(self, step: Step) -> None:
        simulation, rate = self.simulation, abs(step.loading.nominal_rate)
        simulation.set_loading(step.loading)
        self.place["inertial_number"] = rate * simulation.scales.inertial_time
        if not step.rests:
            simulation.step_size_limit(step.strain or 0.0, rate)

    def _shear(self, strain: float) -> None:
        goal = strain * (1 - 1e-9)
        while self.walked < goal:
            self.settled = False
            self.walked += self._advance(MANY, goal - self.walked)
            self._record(last=self.walked >= goal)
            self._settle(f"stage {self.place['stage'] + 1}: strain")

    def _relax(self) -> None:
        """Steps with damping until the grains rest."""
        resting = False
        while not resting and self.made < REST_STEPS:
            self.settled = False
            self._advance(1, np.inf)
            self.made += 1
            resting = self.simulation.kinetic_ratio() < REST_ENERGY
            if resting or self.made == REST_STEPS:
                self.restless |= not resting
                self.simulation.damping = 0.0
                self._record(last=True)
                self.made = REST_STEPS
            self._settle(f"stage {self.place['stage'] + 1}: to rest, strain")

    def _advance(self, steps: int, goal: float) -> float:
        """Steps up to the next record, or until ``goal`` is walked.

        Returns:
            The strain walked in the sense of the stage's own loading.
        """
        simulation, place = self.simulation, self.place
        own, before = simulation.loading, simulation.strain
        sense = 1.0 if own.deviatoric_rate >= 0 else -1.0
        weight = np.outer(own.direction, own.direction) - np.outer(own.extension, own.extension)
        due = (min(self.next_row, self.next_frame) - LATE) / EARLY - place["eps_q_total"]
        watch = Watch(sense * weight, goal - SLACK, due - SLACK)
        reports = simulation.advance(steps, watch)
        changes = np.diff(reports.strain, axis=0, prepend=before[None])
        walked = 0.0
        for change in changes:
            place["eps_q"] += _shear_of(change, place["direction"], place["extension"])
            shear = _shear_of(change, own.direction, own.extension)
            place["eps_q_total"] += abs(shear)
            walked += sense * shear
        self.tally.add(reports)
        return walked

    def _record(self, *, last: bool) -> None:
        total = self.place["eps_q_total"] * EARLY + LATE
        if total >= self.next_row or last:
            self._write_row()
            self.next_row = total + self.settings.series_interval * (1 - 1e-6)
        if total >= self.next_frame or last:
            self._write_frame()
            self.next_frame = total + self.settings.frame_interval * (1 - 1e-6)

    def _write_row(self) -> None:
        """Hand a row of the series to the recorders."""
        statistics = self.tally.take(self.simulation.kinetic_ratio())
        self.whole = merge([self.whole, statistics])
        self.since_frame = merge([self.since_frame, statistics])
        row = series_row(self.simulation, self.place, statistics)
        for recorder in self.recorders:
            recorder.row(row)

    def _write_frame(self) -> None:
        """Hand a complete frame to the recorders."""
        frame = capture_frame(self.simulation, self.place, self.since_frame)
        self.since_frame = StepStatistics()
        self.inertial_max = max(self.inertial_max, frame.inertial_number)
        for recorder in self.recorders:
            recorder.frame(frame)

    def _settle(self, text: str, *, first: bool = False) -> None:
        """Between two calls of the engine: keep the state if wanted, tell, and stop if asked."""
        self.settled = True
        if self.keeper and (self.keeper.due(self.place["eps_q_total"]) or first):
            self.keep()
        now = time.monotonic()
        if self.tell and now - self._told > SECONDS_BETWEEN_NEWS:
            self._told = now
            self.tell(f"{text} {self.place['eps_q']:.3f}", min(self._fraction(), 1.0))

    def _fraction(self) -> float:
        strains = [abs(step.strain or 0.0) for step in self.path]
        done = sum(strains[: self.place["stage"]]) + self.walked
        return done / (sum(strains) or 1.0)

    def spent(self) -> float:
        """Wall time of the path so far, of earlier followers too [s]."""
        now = time.perf_counter()
        self.seconds, self._began = self.seconds + now - self._began, now
        return self.seconds

    def keep(self) -> None:
        """Hand the present state to the keeper."""
        if self.keeper:
            self.keeper.keep(self.held())

    def held(self) -> dict[str, np.ndarray]:
        """The state of the follower and its system."""
        self.spent()
        numbers = [float(self.place[name]) for name in _PLACE]
        numbers += [float(getattr(self, name)) for name in _OWN]
        statistics = [[float(getattr(s, n)) for n in _STATISTICS] for s in self._statistics()]
        return {
            **snapshot(self.simulation),
            "radius": self.simulation.radius.copy(),
            "mass": self.simulation.mass.copy(),
            "number": np.array(self.simulation.number),
            "periodic": self.simulation.periodic.copy(),
            "follower": np.array(numbers),
            "statistics": np.array(statistics),
        }

    def _statistics(self) -> tuple[StepStatistics, ...]:
        return self.whole, self.since_frame, self.tally.now()

    def resume(self, held: Mapping[str, np.ndarray]) -> None:
        """Take over the state of an earlier follower of the same path.

        Raises:
            CorruptFile: it is of another sample.
        """
        numbers = held["follower"]
        for name, value in zip(_PLACE, numbers, strict=False):
            self.place[name] = type(self.place[name])(value)
        for name, value in zip(_OWN, numbers[len(_PLACE) :], strict=True):
            setattr(self, name, type(getattr(self, name))(value))
        if self.entered:
            self._load(self.path[self.place["stage"]])
        restore(self.simulation, held)
        whole, since_frame, tally = (_statistics_of(row) for row in held["statistics"])
        self.whole, self.since_frame = whole, since_frame
        self.tally.begin(tally)
        self.settled = True


def _statistics_of(row: Array) -> StepStatistics:
    named: dict[str, Any] = dict(zip(_STATISTICS, map(float, row), strict=True))
    counts = {name: int(named[name]) for name in ("steps", "nonconverged", "contact_updates")}
    return StepStatistics(**{**named, **counts})


def _shear_of(strain: Array, direction: Array, extension: Array) -> float:
    """Deviatoric part of a strain along two axes, contraction positive."""
    return float(direction @ strain @ direction - extension @ strain @ extension)
