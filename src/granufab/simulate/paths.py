"""Follow a path of stages, record on the way, and sum up."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings
from granufab.history import Frame, FrameSource, Recorder, Run, series_dataset
from granufab.kernels.step_arrays import MATRIX
from granufab.packing import Cell, Grains, Packing
from granufab.simulate.follower import Follower, Keeper, Step
from granufab.simulate.loading import loading_of_stage
from granufab.simulate.preparation import Prepared, prepare
from granufab.simulate.scales import Scales
from granufab.simulate.settings import Case, Material, Record, Sample, Solver, Stage
from granufab.simulate.stepping import Simulation
from granufab.simulate.summary import summarise

__all__ = ["Kept", "Step", "run", "run_case", "shear"]

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Kept:
    """Where a path is kept so that it can go on later.

    Attributes:
        keeper: keeps its states.
        recorded: opens what was recorded so far, frames and series.
        state: to go on from, or None at the start of the path.
        sample: what a summary says of the sample, kept with it; filled when the sample is made.
    """

    keeper: Keeper
    recorded: Callable[[], Run]
    state: Mapping[str, np.ndarray] | None
    sample: dict[str, Any]


class _Memory:
    """Recorder that keeps everything."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.rows: list[Mapping[str, float]] = []

    def frame(self, frame: Frame) -> None:
        self.frames.append(frame)

    def row(self, row: Mapping[str, float]) -> None:
        self.rows.append(row)


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
    kept: Kept | None = None,
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
        kept: keeps states to go on from; nothing is then kept in memory, the returned run reads
            what was recorded.
    Raises:
        InvalidSettings: the path is empty.
        NotConverged: a step misses the tolerance and the solver is ``strict``.
    """
    if not path:
        raise InvalidSettings("the path has no stages; give at least one [[path]]")
    material, solver = material or Material(), solver or Solver()
    record_settings = record_settings or Record()
    memory = _Memory()
    simulation = Simulation(packing, path[0].loading, material=material, solver=solver)
    follower = Follower(
        simulation,
        path,
        [one for one in (None if kept else memory, record) if one is not None],
        record_settings,
        name=name,
        tell=progress,
        keeper=None if kept is None else kept.keeper,
    )
    if kept is not None and kept.state is not None:
        follower.resume(kept.state)
    interrupted = False
    try:
        follower.walk()
    except KeyboardInterrupt:
        interrupted = True
        if follower.settled:
            follower.keep()
    attributes = {
        "criterion": "force",
        "z_definition": record_settings.z_definition,
        "name": name,
        "dimension": simulation.dimension,
        "tolerance": solver.tolerance,
    }
    result = kept.recorded() if kept else None
    return Run(
        series_source=partial(series_dataset, memory.rows, attributes)
        if result is None
        else result.series_source,
        frames=memory.frames if result is None else result.frames,
        settings=dict(settings or {}),
        summary=_summary(follower, memory.frames if result is None else result.frames, interrupted),
        name=name,
    )


def _summary(
    follower: Follower, frames: FrameSource | Sequence[Frame], interrupted: bool
) -> dict[str, Any]:
    summary = summarise(
        follower.simulation, follower.whole, frames, follower.inertial_max, follower.spent()
    )
    summary["interrupted"] = interrupted
    if follower.restless:
        summary["warnings"].append(
            f"an isotropic stage did not come to rest: kinetic energy / pV is "
            f"{summary['kinetic_ratio']:.1e}"
        )
    return summary


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
    kept: Kept | None = None,
) -> Run:
    """Prepare the sample that a case describes and follow its path.

    Args:
        case: complete settings.
        record: receives frames and rows as they come.
        progress: called with a text and the fraction done.
        start: a sample made before, instead of preparing one.
        kept: keeps states to go on from, as in :func:`run`; with one, no sample is prepared.
    Raises:
        NotConverged: the wanted coordination cannot be reached, or a strict solver fails.
    """
    tell = progress or (lambda text, fraction: None)
    if kept is not None and kept.state is not None:
        packing = _held_sample(kept.state)
        sample = kept.sample
    else:
        packing, sample = _sample(case, start, lambda t, f: tell(t, 0.5 * f))
        if kept is not None:
            kept.sample.update(sample)
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
        kept=kept,
    )
    return replace(result, summary={**result.summary, **sample})


def _sample(
    case: Case, start: Prepared | Packing | None, tell: Progress
) -> tuple[Packing, dict[str, Any]]:
    """The sample, and what a summary says of it."""
    began = time.perf_counter()
    prepared = start or prepare(case.sample, progress=tell)
    packing = prepared.packing if isinstance(prepared, Prepared) else prepared
    seed = case.sample.seed if isinstance(prepared, Prepared) else None
    return packing, {**_sample_summary(prepared, time.perf_counter() - began), "seed": seed}


def _held_sample(held: Mapping[str, np.ndarray]) -> Packing:
    """The grains and the cell of a kept state.

    Raises:
        CorruptFile: something is missing.
    """
    try:
        return Packing(
            grains=Grains(
                position=held["position"],
                radius=held["radius"],
                mass=held["mass"],
                number=held["number"],
            ),
            cell=Cell(
                matrix=held["tensors"][MATRIX],
                periodic=tuple(bool(p) for p in held["periodic"]),
                origin=held["origin"],
            ),
        )
    except KeyError as error:
        raise CorruptFile(f"kept state: {error} is missing") from None


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
