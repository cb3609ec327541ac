"""Solve the problems of a folder from (W, q, mu) alone and print a table in Markdown.

python benchmarks/fclib_problems.py FOLDER [--solutions OUT]

FOLDER holds FCLIB files (.hdf5, .h5) or the .npz layout of ``granufab.io.read_fclib``. With
``--solutions`` each answer is written to OUT/NAME.npz (key r), for a checker of your own.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from granufab.io import read_fclib
from granufab.simulate import local_errors, solve_local

SUFFIXES = (".npz", ".hdf5", ".h5")
HEAD = (
    "| problem | contacts | d | sweeps + Newton + splitting | by | s | worst figure |\n"
    "|---|---|---|---|---|---|---|"
)


def row(path: Path, solutions: Path | None) -> str:
    """Solve one problem; its line of the table."""
    problem = read_fclib(path)
    began = time.perf_counter()
    found = solve_local(problem.W, problem.q, problem.mu, dimension=problem.dimension)
    seconds = time.perf_counter() - began
    worst = max(local_errors(problem, found.impulse).values())
    if solutions is not None:
        solutions.mkdir(parents=True, exist_ok=True)
        np.savez(solutions / f"{path.stem}.npz", r=found.impulse)
    counts = f"{found.sweeps} + {found.newton_steps} + {found.splitting_steps}"
    method = found.method if found.converged else "not converged"
    return (
        f"| {path.stem} | {problem.contact_count} | {problem.dimension} | {counts} | {method} | "
        f"{seconds:.3f} | {worst:.1e} |"
    )


def main() -> None:
    """Print the table of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--solutions", type=Path)
    options = parser.parse_args()
    tiny = {"W": np.eye(2), "q": np.array([-1.0, 0.5]), "mu": np.array([0.3])}
    solve_local(**tiny, dimension=2)  # compile the kernels before the clock runs
    print(HEAD)
    for path in sorted(options.folder.iterdir()):
        if path.suffix in SUFFIXES:
            print(row(path, options.solutions), flush=True)


if __name__ == "__main__":
    main()
