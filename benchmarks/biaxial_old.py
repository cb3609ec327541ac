"""The biaxial job of other programs, run by granufab, beside their published figures.

µ = 0.4, diameters ±20 %, compaction at µ = 0, then axial compression at constant lateral stress.
Rates and strains are axial: I = ε̇_1 √(m/σ) and ε_1 from 0 to 0.2; means over ε_1 > 0.14. In
granufab's measures I_q ≈ 2 I and ε_q ≈ 2 ε_1. κ = k_n/p; our tangential spring equals the normal
one, LAMMPS' was half of it.

    python benchmarks/peers.py OUT [--jobs name …]
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np

# name: (grains, κ, axial rate, residual, largest strain per step (ε_q), seed)
JOBS: dict[str, tuple[int, float, float, float, float, int]] = {
    f"N{n}-k{k:g}-I{i:g}-s{seed}": (n, k, i, tolerance, step, seed)
    for n, k, i, tolerance, step in (
        (1000, 1e4, 1e-4, 1e-5, 1e-5),
        (1000, 1e5, 1e-4, 1e-5, 1e-5),
        (1000, math.inf, 1e-4, 1e-4, 1e-5),
        (2000, 1e3, 1e-3, 1e-5, 1e-4),
        (2000, 1e4, 1e-3, 1e-5, 1e-4),
        (2000, 5e4, 1e-3, 1e-5, 1e-4),
    )
    for seed in (1, 2)
}


def run_job(out: Path, name: str) -> dict[str, float]:
    """One biaxial run; its means over ε_1 > 0.14."""
    import granufab.simulate as g

    target = out / f"{name}.json"
    if target.exists():
        return json.loads(target.read_text())
    grains, kappa, axial, tolerance, step, seed = JOBS[name]
    start = g.prepare(g.Sample(grain_count=grains, friction=0.0, seed=seed)).packing
    from granufab.simulate.scales import Scales

    rate = axial / Scales.of(start, 1.0).inertial_time
    began = time.perf_counter()
    result = g.run(
        start,
        [g.Step(loading=g.Biaxial(axial_rate=rate), strain=0.46)],
        material=g.Material(friction=0.4),
        solver=g.Solver(
            tolerance=tolerance, stiffness=kappa, step_strain=step, time_step=10.0, max_sweeps=3000
        ),
        record_settings=g.Record(series_interval=2e-3, frame_interval=2e-3),
    )
    axial_strain = np.array([f.strain[1, 1] for f in result.frames])
    late = (axial_strain > 0.14) & (axial_strain <= 0.2)
    series = result.series
    data = {
        name_: float(series[name_].values[: len(late)][late].mean())
        for name_ in ("z", "z_backbone", "rattler_fraction", "a", "a_signed", "q_over_p", "phi")
    }
    data |= {
        "seconds": time.perf_counter() - began,
        "steps": result.summary["steps"],
        "unconverged": result.summary["nonconverged_steps"] / result.summary["steps"],
        "sweeps": result.summary["sweeps_mean"],
        "overlap": result.summary["overlap_max"],
        "grains": grains,
        "kappa": str(kappa),
        "axial_rate": axial,
        "states": int(late.sum()),
    }
    target.write_text(json.dumps(data))
    return data


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--jobs", nargs="*", default=list(JOBS))
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
        jobs = {pool.submit(run_job, given.out, name): name for name in given.jobs}
        for done in as_completed(jobs):
            m = done.result()
            print(
                time.strftime("%H:%M:%S"),
                jobs[done],
                f"z {m['z']:.3f} ({m['z_backbone']:.3f}) rattlers {m['rattler_fraction']:.3f} "
                f"a {m['a']:.3f} q/p {m['q_over_p']:.3f} sweeps {m['sweeps']:.0f} "
                f"unconverged {m['unconverged']:.4f} {m['seconds']:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
