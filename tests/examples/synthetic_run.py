"""A stand-in for the simulation: a path that relaxes to a known critical state, with noise."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from granufab.errors import NotConverged
from granufab.history import Frame, Run, StepStatistics, series_dataset
from granufab.packing import Cell, Contacts, Grains, Packing
from granufab.simulate.settings import Case, Sample

Z_STAR, A_STAR = 3.35, 0.24


def synthetic_run(
    case: Case, *, record: Any = None, progress: Any = None, start: Any = None
) -> Run:
    """z and a' relax to (3.35, 0.24), shifted for other frictions; noise as of N grains."""
    rows = _rows(case)
    if record is not None:
        for row in rows:
            record.row(row)
        record.frame(_frame(rows[-1], case.sample.seed))
    if progress is not None:
        progress("shear", 0.5)
    attributes = {"path": case.name, "criterion": case.record.criterion}
    return Run(
        series=series_dataset(rows, attributes),
        frames=[_frame(rows[-1], case.sample.seed)],
        settings=case.model_dump(mode="json"),
        summary=_summary(case, rows),
        name=case.name,
    )


def synthetic_sample(sample: Sample, *, progress: Any = None) -> str:
    """Stands for a sample; the synthetic run does not look at it."""
    return f"sample of {sample.grain_count} grains"


def reluctant_run(case: Case, *, record: Any = None, progress: Any = None) -> Run:
    """Refuses z_0 below 3.5, as the preparation of a sample does, but takes any friction."""
    if case.sample.coordination is not None and case.sample.coordination < 3.5:
        raise NotConverged("sample.coordination = 3.1 (z_backbone) cannot be reached")
    return synthetic_run(case, record=record, progress=progress)


def failing_run(case: Case, *, record: Any = None, progress: Any = None) -> Run:
    """Fails for the loose path only, as a strict solver would."""
    if case.name == "loose":
        raise NotConverged("step 12 ended with residual 0.1")
    return synthetic_run(case, record=record, progress=progress)


def _rows(case: Case) -> list[dict[str, float]]:
    random = np.random.default_rng(
        [case.sample.seed, sum(case.name.encode()), int(1e3 * case.material.friction)]
    )
    noise = 0.35 / math.sqrt(case.sample.grain_count)
    z_star = Z_STAR - 0.25 * (case.material.friction - 0.4)
    a_star = A_STAR + 0.1 * (case.material.friction - 0.4)
    z, a, eps, total = float(case.sample.coordination or 3.5), 0.0, 0.0, 0.0
    wander = np.zeros(2)
    rows = [_row(case, eps, total, z, a)]
    dip = 0.0
    for index, stage in enumerate(case.path):
        sign = math.copysign(1.0, stage.strain)
        if index > 0:
            dip = -0.25
        step = 2 * case.record.series_interval  # half the records write twice as fast
        for _ in range(round(abs(stage.strain) / step)):
            eps, total = eps + sign * step, total + step
            z += (z_star - z) * step / 0.02
            a += (sign * a_star - a) * step / 0.025
            dip *= 1 - step / 0.02
            wander = 0.8 * wander + noise * random.standard_normal(2)
            rows.append(_row(case, eps, total, z + dip + wander[0], a + wander[1]))
    return rows


def _row(case: Case, eps: float, total: float, z: float, a: float) -> dict[str, float]:
    return {
        "eps_q": eps,
        "eps_q_total": total,
        "z": 0.9 * z,
        "z_backbone": z,
        "z_mechanical": z,
        "rattler_fraction": 0.1,
        "a": abs(a),
        "a_signed": a,
        "theta_c": 90.0,
        "q_over_p": 1.2 * a,
        "phi": 0.82,
        "p": 1.0,
        "residual": 9e-5,
        "sweeps": 80.0,
        "overlap": 1e-3,
        "inertial_number": 1e-3,
    }


def _summary(case: Case, rows: list[dict[str, float]]) -> dict[str, Any]:
    return {
        "steps": 10 * len(rows),
        "nonconverged_steps": 2,
        "sweeps_mean": 80.0,
        "residual_max": 9e-5,
        "overlap_max": 1e-3,
        "violation_max": 1e-4,
        "pressure_error_max": 1e-3,
        "contact_updates": 1000,
        "seconds": 1.0,
        "tolerance": case.solver.tolerance,
        "stiffness": case.solver.stiffness,
        "inertial_number_max": 1e-3,
        "z_0": rows[0]["z_backbone"],
        "friction": case.material.friction,
        "compaction_friction": 0.1,
        "grain_count": case.sample.grain_count,
        "seed": case.sample.seed,
        "warnings": [],
        "interrupted": False,
    }


def _frame(row: dict[str, float], seed: int) -> Frame:
    packing = honeycomb(seed=seed)
    return Frame(
        packing=packing,
        eps_q=row["eps_q"],
        eps_q_total=row["eps_q_total"],
        strain=np.zeros((2, 2)),
        stage=0,
        stress=np.eye(2),
        inertial_number=1e-3,
        direction=np.array([0.0, 1.0]),
        statistics=StepStatistics(steps=1),
    )


def honeycomb(columns: int = 8, rows: int = 8, seed: int = 1) -> Packing:
    """A triangular lattice of unit disks that touch, in a periodic tilted cell."""
    u, v = np.array([1.0, 0.0]), np.array([0.5, math.sqrt(0.75)])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    number = (i % columns) * rows + (j % rows)
    pairs, branches = [], []
    for di, dj in ((1, 0), (0, 1), (-1, 1)):
        other = ((i + di) % columns) * rows + ((j + dj) % rows)
        pairs.append(np.stack([number, other], axis=1))
        branches.append(np.tile(di * u + dj * v, (len(i), 1)))
    branch = np.concatenate(branches)
    random = np.random.default_rng(seed)
    strength = random.exponential(size=(len(branch), 1))
    return Packing(
        grains=Grains(position=i[:, None] * u + j[:, None] * v, radius=np.full(len(i), 0.5)),
        contacts=Contacts(
            pair=np.concatenate(pairs),
            normal=branch,
            branch=branch,
            gap=np.zeros(len(branch)),
            force=strength * branch,
        ),
        cell=Cell(matrix=np.column_stack([columns * u, rows * v])),
    )


def endless_run(case: Case, *, record: Any = None, progress: Any = None) -> Run:
    """Never ends by itself, as a long simulation."""
    while True:
        time.sleep(0.05)
        if progress is not None:
            progress("shear", 0.5)
