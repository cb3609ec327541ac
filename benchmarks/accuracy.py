"""What a tight residual costs, and how far it is from the tightest rigid run.

Samples of 1,000 and 5,000 disks, µ = 0.4, are sheared at constant mean stress to ε_q = 0.3 at
two rates, with compliant contacts at residual 1e-5 and with rigid ones as tight as they go; means
over ε_q 0.1–0.3. Runs already done are not repeated.

    python benchmarks/accuracy.py OUT [--grains 1000 5000] [--workers 2]
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from convergence import INF, SAMPLES, job, means, prepare_sample, run_job

RATES = {1e-3: 2e-5, 2e-4: 4e-6}
"""Largest strain per step by inertial number."""


def settings_at(rate: float) -> dict[str, dict[str, float]]:
    """Settings to compare at one rate, the reference first."""
    step = RATES[rate]
    return {
        "rigid": job(3e-5, INF, rate, step),
        "k/p = 3e5": job(1e-5, 3e5, rate, step),
        "k/p = 5e4": job(1e-5, 5e4, rate, step),
    }


def compare(out: Path, grains: int, samples: int, workers: int) -> list[dict[str, Any]]:
    """Run what is missing; one row per rate and setting, with paired differences to rigid."""
    chosen = SAMPLES[:samples]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        list(pool.map(prepare_sample, [out] * samples, chosen, [grains] * samples))
        tasks = {
            (rate, name, k): pool.submit(run_job, out, setting, sample, grains)
            for rate in RATES
            for name, setting in settings_at(rate).items()
            for k, sample in enumerate(chosen)
        }
        found = {key: means(task.result()) for key, task in tasks.items()}
    rows = []
    for rate in RATES:
        for name, setting in settings_at(rate).items():
            several = [found[rate, name, k] for k in range(samples)]
            apart = {
                key: float(
                    np.mean([m[key] - found[rate, "rigid", k][key] for k, m in enumerate(several)])
                )
                for key in ("z_backbone", "a_signed")
            }
            rows.append(
                {
                    "grains": grains, "inertial_number": rate, "law": name,
                    "tolerance": setting["tolerance"], "step": setting["step"],
                    **{k: float(np.mean([m[k] for m in several])) for k in several[0]},
                    "dz": apart["z_backbone"], "da": apart["a_signed"],
                }
            )  # fmt: skip
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    lines = [
        "| disks | I | law | residual | strain/step | z_backbone | Δ | a' | Δ | q/p | sweeps/step "
        "| unconverged | s a run |",
        "|" + "---|" * 13,
    ]
    lines += [
        f"| {r['grains']} | {r['inertial_number']:.0e} | {r['law']} | {r['tolerance']:.0e} | "
        f"{r['step']:.0e} | {r['z_backbone']:.3f} | {r['dz']:+.3f} | {r['a_signed']:.3f} | "
        f"{r['da']:+.3f} | {r['q_over_p']:.3f} | {r['sweeps']:.0f} | "
        f"{100 * r['unconverged']:.2f} % | {r['seconds']:.0f} |"
        for r in rows
    ]
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--grains", type=int, nargs="*", default=[1000, 5000])
    parser.add_argument("--samples", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    rows = [r for n in given.grains for r in compare(given.out, n, given.samples, given.workers)]
    (given.out / "accuracy.json").write_text(json.dumps(rows, indent=1))
    print(table(rows))


if __name__ == "__main__":
    main()
