"""The job that every program does: one biaxial compression of one frictionless dense sample.

Disks with r uniform in [0.8, 1.2] and mass r², compacted under σ = 1 without friction; then µ = 0.4
and compression along y at a constant rate of logarithmic strain, σ held along x.
Rates and strains are axial: I = ε̇_1 √(<m>/σ), ε_1 from 0. In granufab's measures I_q ≈ 2 I and
ε_q ≈ 2 ε_1 (exactly so where the volume does not change).
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MEAN_FROM = 0.7
"""Means are taken over the last 30 % of the strain: ε_1 > 0.14 of 0.2."""

MEASURES = ("z", "z_backbone", "rattler_fraction", "a", "a_signed", "q_over_p", "phi", "eps_q")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What is run, whichever program runs it.

    Attributes:
        grains: number of disks.
        rate: axial inertial number I = ε̇_1 √(<m>/σ) [-].
        strain: last ε_1 (logarithmic) [-].
        friction: µ while it is sheared.
        seed: of the sample.
        states: states measured on the way.
    """

    grains: int = 1000
    rate: float = 1e-4
    strain: float = 0.2
    friction: float = 0.4
    seed: int = 1
    states: int = 200

    @property
    def name(self) -> str:
        """Part of a row's file name."""
        return f"N{self.grains}-I{self.rate:g}-e{self.strain:g}-mu{self.friction:g}-s{self.seed}"


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """The common sample: grains without overlap at rest, in a rectangular periodic cell.

    Attributes:
        position: inside the cell, shape (grain_count, 2).
        radius: shape (grain_count,).
        sides: of the cell, shape (2,).
    """

    position: NDArray[np.float64]
    radius: NDArray[np.float64]
    sides: NDArray[np.float64]

    @property
    def mass(self) -> NDArray[np.float64]:
        """m = r²: the density is 1/π."""
        return self.radius**2

    def axial_rate(self, job: Job) -> float:
        """ε̇_1 [1/s]."""
        return job.rate / math.sqrt(float(self.mass.mean()))


def start_of(job: Job, folder: Path) -> Start:
    """The sample of a job, made once by granufab and kept as arrays."""
    path = folder / f"start-N{job.grains}-s{job.seed}.npz"
    if not path.exists():
        import granufab.simulate as g

        sample = g.Sample(
            grain_count=job.grains, diameter=2.0, density=1 / math.pi, friction=0.0, seed=job.seed
        )
        packing = g.prepare(sample).packing
        assert packing.cell is not None
        matrix = packing.cell.matrix
        assert np.allclose(matrix, np.diag(np.diag(matrix)))
        fraction = np.linalg.solve(matrix, packing.grains.position.T).T
        position = (fraction % 1.0) @ matrix.T
        np.savez(
            path, position=position, radius=packing.grains.radius, sides=np.diag(matrix)
        )  # fmt: skip
    with np.load(path) as data:
        return Start(data["position"], data["radius"], data["sides"])


def late_means(rows: list[dict[str, float]], job: Job) -> dict[str, float]:
    """Means of :data:`MEASURES` (but the last ε_q itself) over the late part of the strain.

    Args:
        rows: one per measured state, with ``strain`` ε_1 and the measures.
        job: tells the last strain.
    Raises:
        ValueError: no state lies there.
    """
    late = [row for row in rows if row["strain"] > MEAN_FROM * job.strain * (1 + 1e-5)]
    if not late:
        raise ValueError(f"no state beyond strain {MEAN_FROM * job.strain:g}")
    means = {k: float(np.mean([row[k] for row in late])) for k in MEASURES if k != "eps_q"}
    return means | {"eps_q_end": rows[-1]["eps_q"], "states": len(late)}


def run_once(
    path: Path, make: Callable[[], dict[str, Any]], *, again: bool = False
) -> dict[str, Any]:
    """The row kept in ``path``, or a new one, with the load of the machine around it.

    Args:
        path: the row's file.
        make: runs the program.
        again: time a row that is there once more; the run with the fewest CPU seconds is kept,
            beside the list of all of them.
    """
    old = json.loads(path.read_text()) if path.exists() else None
    if old is not None and not again:
        return old
    load_before = os.getloadavg()[0]
    row = {"date": time.strftime("%Y-%m-%d %H:%M"), "load_before": load_before, **make()}
    row["load_after"] = os.getloadavg()[0]
    timings = [row["cpu_seconds"]]
    if old is not None:
        timings = [*old["timings"], row["cpu_seconds"]]
        row = min(old, row, key=lambda one: one["cpu_seconds"])
    row["timings"] = timings
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(row, indent=1))
    unfinished.replace(path)
    return row


def job_columns(job: Job) -> dict[str, Any]:
    """The job as plain data for a row."""
    return asdict(job)
