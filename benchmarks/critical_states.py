"""The critical state for several frictions under three contact criteria.

One dense sample per seed is sheared at constant mean stress to ε_q = 0.4 for every µ; z, a and
az are means over ε_q 0.2–0.4 of the recorded states, with the standard error over seeds.

    python benchmarks/critical_states.py OUT [--grains 2000] [--seeds 2]
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

FRICTIONS = (0.1, 0.3, 0.5)
CRITERIA = ("force", "gap:0.005", "gap:0.015")


def run_job(mu: float, seed: int, grains: int) -> dict[str, dict[str, float]]:
    """Critical means of one run under every criterion and both main definitions of z."""
    import granufab.simulate as g
    from granufab.fabric import measure_run

    sample = g.prepare(g.Sample(grain_count=grains, friction=0.065, seed=seed))
    result = g.shear(
        sample.packing,
        strain=0.4,
        friction=mu,
        inertial_number=1e-3,
        record_settings=g.Record(series_interval=2e-3, frame_interval=5e-3, reach=0.05),
    )
    found: dict[str, dict[str, float]] = {}
    for criterion in CRITERIA:
        data = measure_run(result, criterion=criterion)
        late = data["eps_q"].values > 0.2
        values = {
            name: float(data[name].values[late].mean())
            for name in ("z", "z_backbone", "rattler_fraction", "a_signed", "q_over_p", "phi")
        }
        values["az"] = float((data["a_signed"] * data["z_backbone"]).values[late].mean())
        found[criterion] = values
    found["solver"] = {
        k: float(result.summary[k])
        for k in ("tolerance", "stiffness", "nonconverged_steps", "steps", "overlap_max")
    }
    return found


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--grains", type=int, default=2000)
    parser.add_argument("--seeds", type=int, default=2)
    given = parser.parse_args()
    jobs = [(mu, seed) for mu in FRICTIONS for seed in range(1, given.seeds + 1)]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        runs = list(pool.map(run_job, *zip(*jobs, strict=True), [given.grains] * len(jobs)))
    rows = []
    for mu in FRICTIONS:
        mine = [run for (m, _), run in zip(jobs, runs, strict=True) if m == mu]
        for criterion in CRITERIA:
            row: dict[str, object] = {"mu": mu, "criterion": criterion, "seeds": len(mine)}
            for name in mine[0][criterion]:
                values = np.array([run[criterion][name] for run in mine])
                error = values.std(ddof=1) / np.sqrt(len(values)) if len(values) > 1 else None
                row[name] = {"value": float(values.mean()), "error": error and float(error)}
            rows.append(row)
            print(time.strftime("%H:%M:%S"), json.dumps(row), flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    data = {"grains": given.grains, "rows": rows, "solver": [run["solver"] for run in runs]}
    (given.out / "critical-states.json").write_text(json.dumps(data, indent=1))


if __name__ == "__main__":
    main()
