"""Small simulated runs for pages that need one: ``run.h5`` of sheared disks or spheres."""

from __future__ import annotations

from pathlib import Path

import granufab as gf
from granufab.io import RunFileWriter
from granufab.packing import Packing
from granufab.simulate.settings import Case, Record, Sample, Solver, Stage

CASES = {
    2: Case(
        name="disks",
        sample=Sample(grain_count=100),
        solver=Solver(tolerance=1e-3),
        path=(Stage(strain=0.1, inertial_number=3e-3),),
        record=Record(series_interval=2e-3),
    ),
    3: Case(
        name="spheres",
        sample=Sample(grain_count=120, dimension=3, friction=0.3),
        solver=Solver(tolerance=1e-3),
        path=(Stage(strain=0.05, inertial_number=1e-2, b=0.4),),
        record=Record(series_interval=2e-3),
    ),
}


def sheared(folder: Path, dimension: int = 2) -> list[Packing]:
    """Write ``run.h5`` into a folder and return its states."""
    case = CASES[dimension]
    with RunFileWriter(folder / "run.h5", settings=case.model_dump(mode="json")) as writer:
        run = gf.run_case(case, record=writer)
        writer.close(dict(run.summary))
    return [frame.packing for frame in gf.read(folder / "run.h5").frames]
