"""What a planned run needs: steps, records, memory, disk, time; from its settings alone.

Bytes are measured peaks (docs/reliability.md), rounded up; the time is a rough guess for
quasi-static shear at the default tolerance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from granufab.simulate.settings import Case, Sample, Stage

__all__ = ["Demand", "demand_of", "steps_of_stage"]

FIXED_BYTES = 300e6
"""Libraries and kernels, which may have to be compiled first."""
GRAIN_BYTES = {2: 2700.0, 3: 5500.0}
"""Of sample, engine, frame and checkpoint together, and of the summary, which reads two frames."""
PROGRAM_BYTES, PROGRAM_SAMPLE = {2: 6000.0, 3: 42000.0}, 1500
"""Of the linear programs that bring frictionless samples of so many grains to rest."""
PROGRAM_GROWTH = {2: 0.15, 3: 0.45}
"""Power of the grain count with which they grow: the fill of a sparse factor."""
PROGRAM_GRAINS = {2: 50_000, 3: 8_000}
FRAME_BYTES = {2: 140.0, 3: 270.0}
"""Of a frame in the run file, a grain's share."""
FRAME_FIXED, ROW_BYTES = 2e4, 200.0
CHECKPOINT_BYTES = {2: 500.0, 3: 900.0}
CHECKPOINTS = 3
"""The present one, the one before, and the one that is written."""
STEP_SECONDS = {2: 5e-7, 3: 1.6e-6}
"""Of a step, a grain's share, on one processor."""
PREPARATION_SECONDS, PROGRAM_SECONDS = {2: 2e-3, 3: 2e-3}, {2: 8e-3, 3: 3e-2}
"""Of the sample, a grain's share, and of the linear programs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """What a run needs.

    Attributes:
        steps: of the path; stages that come to rest are left out.
        frames, rows: records at least.
        memory: more than the process has now [bytes].
        disk: of the folder [bytes].
        seconds: about, on one processor [s].
    """

    steps: int
    frames: int
    rows: int
    memory: int
    disk: int
    seconds: float


def demand_of(case: Case, *, prepared: bool = False) -> Demand:
    """What a run of a case needs.

    Args:
        case: with the grain count, diameter and pressure of its sample.
        prepared: the sample is there already.
    """
    sample, record = case.sample, case.record
    count, dimension = sample.grain_count, sample.dimension
    strains = [0.0 if s.loading == "isotropic" else abs(s.strain) for s in case.path]
    frames = 1 + sum(max(1, math.ceil(e / record.frame_interval - 1e-6)) for e in strains)
    rows = 1 + sum(max(1, math.ceil(e / record.series_interval - 1e-6)) for e in strains)
    steps = sum(steps_of_stage(case, stage) for stage in case.path)
    prepared = prepared or sample.file is not None
    kept = CHECKPOINTS * CHECKPOINT_BYTES[dimension] * count
    disk = frames * (FRAME_FIXED + FRAME_BYTES[dimension] * count) + rows * ROW_BYTES + kept
    seconds = steps * count * STEP_SECONDS[dimension]
    programs = not prepared and _takes_programs(sample)
    seconds += 0.0 if prepared else count * PREPARATION_SECONDS[dimension]
    seconds += count * PROGRAM_SECONDS[dimension] if programs else 0.0
    grain = GRAIN_BYTES[dimension] + (_program_bytes(sample) if programs else 0.0)
    return Demand(
        steps=steps,
        frames=frames,
        rows=rows,
        memory=int(FIXED_BYTES + count * grain),
        disk=int(disk),
        seconds=seconds,
    )


def steps_of_stage(case: Case, stage: Stage) -> int:
    """Steps that walk the strain of a stage, with the default time step at its rate."""
    if stage.loading == "isotropic":
        return 0
    solver, sample = case.solver, case.sample
    d, dimension = sample.diameter, sample.dimension
    volume = math.pi * d**dimension / (4 if dimension == 2 else 6)
    time = math.sqrt(sample.density * volume / sample.pressure / d ** (dimension - 2))
    inertial = time if dimension == 2 else d * math.sqrt(sample.density / sample.pressure)
    rate = stage.rate or (stage.inertial_number or 0.0) / inertial
    return math.ceil(abs(stage.strain) / min(solver.time_step * time * rate, solver.step_strain))


def _takes_programs(sample: Sample) -> bool:
    smooth = sample.friction == 0 or sample.coordination is not None
    return smooth and sample.grain_count <= PROGRAM_GRAINS[sample.dimension]


def _program_bytes(sample: Sample) -> float:
    growth = (sample.grain_count / PROGRAM_SAMPLE) ** PROGRAM_GROWTH[sample.dimension]
    return PROGRAM_BYTES[sample.dimension] * max(1.0, growth)
