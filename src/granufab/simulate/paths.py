"""Follow a path of stages, record on the way, and sum up."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings
from granufab.history import Frame, Recorder, Run, StepStatistics, series_dataset
from granufab.packing import Array, Packing
from granufab.simulate.capture import StepTally, capture_frame, merge, series_row
from granufab.simulate.loading import Loading, loading_of_stage
from granufab.simulate.preparation import Prepared, prepare
from granufab.simulate.scales import Scales
from granufab.simulate.settings import Case, Material, Record, Sample, Solver, Stage
from granufab.simulate.stepping import Simulation, Watch
from granufab.simulate.summary import summarise

__all__ = ["Step", "run", "run_case", "shear"]

Progress = Callable[[str, float], None]
REST_ENERGY = 1e-8
SECONDS_BETWEEN_NEWS = 0.3
MANY = 10_000
EARLY, LATE, SLACK = 1 + 1e-9, 1e-12, 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """One stage of a path for :func:`run`.

    Attributes:
        loading: what drives the cell.
        strain: |Δε_q| to walk; None relaxes at constant stress until the grains rest.
    """

    loading: Loading
    strain: float | None


class _Memory:
    """Recorder that keeps everything."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.rows: list[Mapping[str, float]] = []

    def frame(self, frame: Frame) -> None:
        self.frames.append(frame)

    def row(self, row: Mapping[str, float]) -> None:
        self.rows.append(row)


class _Follower:
    """Drives one simulation along its path and feeds the recorders."""

    def __init__(
        self,
        simulation: Simulation,
        recorders: Sequence[Recorder],
        settings: Record,
        name: str,
        progress: Progress | None,
        axes: Loading,
    ) -> None:
        self.simulation, self.recorders, self.settings = simulation, recorders, settings
        self.progress, self.name = progress, name
        self.tally, self.all = StepTally(), []
        self.since_frame: list[StepStatistics] = []
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
        self.restless = False
        self._told = 0.0

    def start(self) -> None:
        """Record the starting state with the forces it came with, at ε_q = 0."""
        self.simulation.stress = self.simulation.stress_of_impulses()
        self.write_row()
        self.write_frame()
        self.next_row = self.settings.series_interval * (1 - 1e-6)
        self.next_frame = self.settings.frame_interval * (1 - 1e-6)

    def stage(self, index: int, step: Step, done: float, total: float) -> None:
        """Walk one stage; ``done`` and ``total`` are strains for the progress."""
        simulation = self.simulation
        simulation.set_loading(step.loading)
        simulation.remove_drift()
        rate = abs(step.loading.nominal_rate)
        self.place["stage"] = index
        self.place["inertial_number"] = rate * simulation.scales.inertial_time
        if step.strain is None or rate == 0:
            self._relax()
            return
        simulation.step_size_limit(step.strain, rate)
        goal = abs(step.strain) * (1 - 1e-9)
        walked = 0.0
        while walked < goal:
            walked += self._advance(MANY, goal - walked)
            self._record(last=walked >= goal)
            self._tell(f"stage {index + 1}: strain", (done + walked) / total)

    def _relax(self, limit: int = 3000) -> None:
        self.simulation.damping = 0.5
        for _ in range(limit):
            self._advance(1, np.inf)
            if self.simulation.kinetic_ratio() < REST_ENERGY:
                break
        else:
            self.restless = True
        self.simulation.damping = 0.0
        self._record(last=True)

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
            self.write_row()
            self.next_row = total + self.settings.series_interval * (1 - 1e-6)
        if total >= self.next_frame or last:
            self.write_frame()
            self.next_frame = total + self.settings.frame_interval * (1 - 1e-6)

    def write_row(self) -> None:
        """Hand a row of the series to the recorders."""
        statistics = self.tally.take(self.simulation.kinetic_ratio())
        self.all.append(statistics)
        self.since_frame.append(statistics)
        row = series_row(self.simulation, self.place, statistics)
        for recorder in self.recorders:
            recorder.row(row)

    def write_frame(self) -> None:
        """Hand a complete frame to the recorders."""
        frame = capture_frame(self.simulation, self.place, merge(self.since_frame))
        self.since_frame = []
        for recorder in self.recorders:
            recorder.frame(frame)

    def _tell(self, text: str, fraction: float) -> None:
        now = time.monotonic()
        if self.progress and now - self._told > SECONDS_BETWEEN_NEWS:
            self._told = now
            self.progress(f"{text} {self.place['eps_q']:.3f}", min(fraction, 1.0))


def _shear_of(strain: Array, direction: Array, extension: Array) -> float:
    """Deviatoric part of a strain along two axes, contraction positive."""
    return float(direction @ strain @ direction - extension @ strain @ extension)


def run(
    packing: Packing,
    path: Sequence[Step],
    *,
    material: Material | None = None,
    solver: Solver | None = None,
    record: Recorder | None = None,
    record_settings: Record | None = None,
    progress: Progress | None = None,
    name: str = "run",
    settings: Mapping[str, Any] | None = None,
) -> Run:
    """Follow a path of stages from a packing, by Contact Dynamics.

    The first record is the starting state with the forces it came with.

    Args:
        packing: starting state with masses and a cell.
        path: stages; the first one that shears fixes the axes of ε_q and a' for the whole
            path, while each stage walks its strain along its own axes.
        material: friction, restitution.
        solver: tolerances and step sizes.
        record: receives frames and series rows as they come (a run-file writer, or your own
            object with ``frame`` and ``row``); the returned run keeps them in memory as well.
        record_settings: how often.
        progress: called with a text and the fraction done.
        name: of the path.
        settings: provenance kept with the result.
    Raises:
        InvalidSettings: the path is empty.
        NotConverged: a step misses the tolerance and the solver is ``strict``.
    """
    if not path:
        raise InvalidSettings("the path has no stages; give at least one [[path]]")
    material, solver = material or Material(), solver or Solver()
    record_settings = record_settings or Record()
    memory = _Memory()
    began = time.perf_counter()
    first = next((s.loading for s in path if s.loading.deviatoric_rate), path[0].loading)
    simulation = Simulation(packing, path[0].loading, material=material, solver=solver)
    recorders = [memory] if record is None else [memory, record]
    follower = _Follower(simulation, recorders, record_settings, name, progress, first)
    total = sum(abs(step.strain or 0.0) for step in path) or 1.0
    interrupted = False
    done = 0.0
    try:
        follower.start()
        for index, step in enumerate(path):
            follower.stage(index, step, done, total)
            done += abs(step.strain or 0.0)
    except KeyboardInterrupt:
        interrupted = True
    seconds = time.perf_counter() - began
    summary = summarise(simulation, follower.all, memory.frames, seconds)
    summary["interrupted"] = interrupted
    if follower.restless:
        summary["warnings"].append(
            f"an isotropic stage did not come to rest: kinetic energy / pV is "
            f"{summary['kinetic_ratio']:.1e}"
        )
    attributes = {
        "criterion": "force",
        "z_definition": record_settings.z_definition,
        "name": name,
        "dimension": simulation.dimension,
        "tolerance": solver.tolerance,
    }
    return Run(
        series_source=partial(series_dataset, memory.rows, attributes),
        frames=memory.frames,
        settings=dict(settings or {}),
        summary=summary,
        name=name,
    )


def _stage_rate(stage: Stage, simulation_time: float) -> float:
    if stage.rate is not None:
        return stage.rate
    assert stage.inertial_number is not None
    return stage.inertial_number / simulation_time


def run_case(
    case: Case,
    *,
    record: Recorder | None = None,
    progress: Progress | None = None,
    start: Prepared | Packing | None = None,
) -> Run:
    """Prepare the sample that a case describes and follow its path.

    Args:
        case: complete settings.
        record: receives frames and rows as they come.
        progress: called with a text and the fraction done.
        start: a sample made before, instead of preparing one.
    Raises:
        NotConverged: the wanted coordination cannot be reached, or a strict solver fails.
    """
    tell = progress or (lambda text, fraction: None)
    began = time.perf_counter()
    prepared = start or prepare(case.sample, progress=lambda t, f: tell(t, 0.5 * f))
    packing = prepared.packing if isinstance(prepared, Prepared) else prepared
    preparation = time.perf_counter() - began
    scales = Scales.of(packing, case.sample.pressure)
    path = []
    for stage in case.path:
        loading = loading_of_stage(
            stage,
            dimension=packing.dimension,
            pressure=case.sample.pressure,
            rate=_stage_rate(stage, scales.inertial_time),
            forward=stage.strain >= 0,
        )
        strain = None if stage.loading == "isotropic" else abs(stage.strain)
        path.append(Step(loading=loading, strain=strain))
    result = run(
        packing,
        path,
        material=case.material,
        solver=case.solver,
        record=record,
        record_settings=case.record,
        progress=lambda t, f: tell(t, 0.5 + 0.5 * f),
        name=case.name,
        settings=case.model_dump(mode="json"),
    )
    summary = {**result.summary, **_sample_summary(prepared, preparation)}
    summary["seed"] = case.sample.seed if isinstance(prepared, Prepared) else None
    return replace(result, summary=summary)


def _sample_summary(prepared: Prepared | Packing, seconds: float) -> dict[str, Any]:
    if isinstance(prepared, Packing):
        return {"preparation_seconds": seconds, "source": prepared.source}
    return {
        "preparation_seconds": seconds,
        "compaction_friction": prepared.friction,
        "wanted_coordination": prepared.wanted,
        "sample": prepared.reached,
        "z_0": prepared.reached["z_backbone"],
        "sample_solver": prepared.summary,
        "compaction_trials": [list(trial) for trial in prepared.trials],
    }


def shear(
    packing: Packing,
    *,
    strain: float = 0.3,
    friction: float = 0.4,
    inertial_number: float = 3e-4,
    loading: str = "constant-mean",
    pressure: float = 1.0,
    solver: Solver | None = None,
    record: Recorder | None = None,
    record_settings: Record | None = None,
    progress: Progress | None = None,
    name: str = "shear",
) -> Run:
    """Shear a packing in one call: at constant mean stress with imposed ε̇_q by default.

    Args:
        packing: a sample at rest.
        strain: ε_q to walk, negative reverses.
        friction: µ between grains.
        inertial_number: I = ε̇_q √(m/p) (2D), ε̇_q d √(ρ/p) (3D).
        loading: constant-mean, biaxial (2D), triaxial (3D), simple-shear, simple-shear-volume.
        pressure: p [N/m^(D−1)].
        solver, record, record_settings, progress, name: as in :func:`run`.
    """
    stage = Stage(loading=loading, strain=strain, inertial_number=inertial_number)  # type: ignore[arg-type]
    case = Case(
        name=name,
        sample=Sample(
            grain_count=packing.grains.count,
            dimension=packing.dimension,  # type: ignore[arg-type]
            pressure=pressure,
        ),
        material=Material(friction=friction),
        solver=solver or Solver(),
        path=(stage,),
        record=record_settings or Record(),
    )
    return run_case(case, record=record, progress=progress, start=packing)
