"""A stand-in for the simulation: a path that relaxes to a known critical state, with noise."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import NotConverged
from granufab.history import Frame, Run, StepStatistics, series_dataset
from granufab.packing import Cell, Contacts, Grains, Packing
from granufab.reproduce import reproduce
from granufab.simulate.settings import Case, Sample

Z_STAR, A_STAR = 3.35, 0.24


def synthetic_run(
    case: Case, *, record: Any = None, progress: Any = None, start: Any = None
) -> Run:
    """z and a' relax to (3.35, 0.24), shifted for other frictions; noise as of N grains."""
    rows = _rows(case)
    frames = _frames(case, rows)
    if record is not None:
        for row in rows:
            record.row(row)
        for frame in frames:
            record.frame(frame)
    if progress is not None:
        progress("shear", 0.5)
    attributes = {"path": case.name, "criterion": case.record.criterion}
    return Run(
        series_source=series_dataset(rows, attributes),
        frames=frames,
        settings=case.model_dump(mode="json"),
        summary=_summary(case, rows),
        name=case.name,
    )


def reproduce_synthetic(figure: str, out: Path, **options: Any) -> dict[str, Any]:
    """A figure from synthetic runs, in this process."""
    options = {"run_case": synthetic_run, "prepare": synthetic_sample, "workers": 1} | options
    return reproduce(figure, out=out, **options)


def synthetic_sample(sample: Sample, *, progress: Any = None) -> str:
    """Stands for a sample; the synthetic run does not look at it."""
    return f"sample of {sample.grain_count} grains"


def run_of_a_sample(
    case: Case, *, record: Any = None, progress: Any = None, start: Any = None
) -> Run:
    """Runs only from a sample that was made before."""
    if start != f"sample of {case.sample.grain_count} grains":
        raise NotConverged(f"started from {start!r}")
    return synthetic_run(case, record=record, progress=progress)


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
        [
            case.sample.seed,
            int(100 * (case.sample.coordination or 0)),
            int(1e3 * case.material.friction),
        ]
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


def _frames(case: Case, rows: list[dict[str, float]]) -> list[Frame]:
    """The lattice before and after; in simple shear also on the way, moving affinely."""
    dimension, seed = case.sample.dimension, case.sample.seed
    shear = case.path[0].loading == "simple-shear"
    direction = np.array([-1.0, 1.0]) / math.sqrt(2) if shear else np.eye(dimension)[1]
    chosen = rows[::10] if shear else [rows[0], rows[-1]]
    frames = []
    for row in chosen:
        gradient = np.eye(dimension)
        gradient[0, 1] = row["eps_q"] if shear else 0.0
        sheared = row["eps_q"] != 0.0 and not shear
        frames.append(
            Frame(
                packing=lattice(dimension, seed=seed, sheared=sheared, gradient=gradient),
                eps_q=row["eps_q"],
                eps_q_total=row["eps_q_total"],
                strain=np.zeros((dimension, dimension)),
                stage=0,
                stress=np.eye(dimension),
                inertial_number=1e-3,
                direction=direction,
                statistics=StepStatistics(steps=1),
            )
        )
    return frames


VECTORS = {
    2: np.array([[1.0, 0.0], [0.5, math.sqrt(0.75)]]),
    3: np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [1.0, 0.0, 1.0]]) / math.sqrt(2),
}
STEPS = {
    2: ((1, 0), (0, 1), (-1, 1)),
    3: ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 0), (1, 0, -1), (0, 1, -1)),
}


def lattice(
    dimension: int, *, seed: int = 1, sheared: bool = False, gradient: Any = None
) -> Packing:
    """A triangular or face-centred cubic lattice of touching unit grains, in a periodic cell.

    ``sheared``: contacts across the direction of contraction y carry no force, so in 2D z goes
    from 6 to 4 and a from 0 to 1, in 3D z from 12 to 8 and a from 0 to 5/8.
    """
    side, vectors = {2: 8, 3: 4}[dimension], VECTORS[dimension]
    gradient = np.eye(dimension) if gradient is None else gradient
    place = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), axis=-1)
    place = place.reshape(-1, dimension)
    shape = (side,) * dimension
    number = np.arange(len(place))
    pairs, branches = [], []
    for step in STEPS[dimension]:
        other = np.ravel_multi_index(tuple(((place + step) % side).T), shape)
        pairs.append(np.stack([number, other], axis=1))
        branches.append(np.tile(np.array(step) @ vectors, (len(place), 1)))
    normal = np.concatenate(branches)
    strength = np.random.default_rng(seed).exponential(size=(len(normal), 1))
    if sheared:
        strength = np.where(np.abs(normal[:, 1:2]) < 1e-9, 0.0, strength)
    moved = normal @ gradient.T
    unit = moved / np.linalg.norm(moved, axis=1)[:, None]
    return Packing(
        grains=Grains(position=place @ vectors @ gradient.T, radius=np.full(len(place), 0.5)),
        contacts=Contacts(
            pair=np.concatenate(pairs),
            normal=unit,
            branch=moved,
            gap=np.linalg.norm(moved, axis=1) - 1.0,
            force=strength * unit,
        ),
        cell=Cell(matrix=gradient @ (side * vectors.T)),
    )


def endless_run(case: Case, *, record: Any = None, progress: Any = None) -> Run:
    """Never ends by itself, as a long simulation."""
    while True:
        time.sleep(0.05)
        if progress is not None:
            progress("shear", 0.5)
