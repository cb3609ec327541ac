"""What a tight residual costs, and how far it is from the tightest rigid run.

Samples of 1,000 and 5,000 disks, µ = 0.4, are sheared at constant mean stress to ε_q = 0.3 at
two rates, with compliant contacts at residual 1e-5 and with rigid ones as tight as they go; means
over ε_q 0.1–0.3. Runs already done are not repeated.

    python benchmarks/accuracy.py OUT [--grains 1000 5000] [--workers 2] [--finished]
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from convergence import INF, SAMPLES, job, means, prepare_sample, run_job, stored

RATES = {1e-3: 2e-5, 2e-4: 4e-6}
"""Largest strain per step by inertial number."""
STRETCHED = 5000, 2e-4
"""From this size on, at this rate, the rigid run takes longer steps to a looser residual."""


def settings_at(rate: float, grains: int) -> dict[str, dict[str, float]]:
    """Settings to compare at one rate, the reference first."""
    step = RATES[rate]
    stretched = grains >= STRETCHED[0] and rate <= STRETCHED[1]
    return {
        "rigid": job(1e-4, INF, rate, 2.5 * step) if stretched else job(3e-5, INF, rate, step),
        "k/p = 3e5": job(1e-5, 3e5, rate, step),
        "k/p = 5e4": job(1e-5, 5e4, rate, step),
    }


def compare(
    out: Path, grains: int, samples: int, workers: int, *, finished: bool
) -> list[dict[str, Any]]:
    """One row per rate and setting, with paired differences to rigid.

    Args:
        out: folder of the jobs.
        grains, samples: sizes and how many samples.
        workers: processes.
        finished: run nothing, take the pairs that are there.
    """
    chosen = SAMPLES[:samples]
    tasks = {
        (rate, name, k): (setting, sample)
        for rate in RATES
        for name, setting in settings_at(rate, grains).items()
        for k, sample in enumerate(chosen)
    }
    if finished:
        done = {key: stored(out, *task, grains) for key, task in tasks.items()}
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            list(pool.map(prepare_sample, [out] * samples, chosen, [grains] * samples))
            waiting = {key: pool.submit(run_job, out, *t, grains) for key, t in tasks.items()}
            done = {key: task.result() for key, task in waiting.items()}
    found = {key: means(data) for key, data in done.items() if data is not None}
    return [
        row
        for rate in RATES
        for name, setting in settings_at(rate, grains).items()
        if (row := _row(found, rate, name, samples, grains, setting)) is not None
    ]


def _row(
    found: dict[Any, dict[str, float]],
    rate: float,
    name: str,
    samples: int,
    grains: int,
    setting: dict[str, float],
) -> dict[str, Any] | None:
    """Means over the samples that have both this setting and the reference."""
    paired = [
        (found[rate, name, k], found[rate, "rigid", k])
        for k in range(samples)
        if (rate, name, k) in found and (rate, "rigid", k) in found
    ]
    if not paired:
        return None
    return {
        "grains": grains, "samples": len(paired), "inertial_number": rate, "law": name,
        "tolerance": setting["tolerance"], "step": setting["step"],
        **{key: float(np.mean([own[key] for own, _ in paired])) for key in paired[0][0]},
        "dz": [own["z_backbone"] - rigid["z_backbone"] for own, rigid in paired],
        "da": [own["a_signed"] - rigid["a_signed"] for own, rigid in paired],
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    lines = [
        "| disks | samples | I | law | residual | strain/step | z_backbone | Δ | a' | Δ | q/p "
        "| sweeps/step | unconverged |",
        "|" + "---|" * 13,
    ]
    lines += [
        f"| {r['grains']} | {r['samples']} | {r['inertial_number']:.0e} | {r['law']} | "
        f"{r['tolerance']:.0e} | {r['step']:.0e} | {r['z_backbone']:.3f} | "
        f"{_each(r['dz'])} | {r['a_signed']:.3f} | {_each(r['da'])} | "
        f"{r['q_over_p']:.3f} | {r['sweeps']:.0f} | {100 * r['unconverged']:.2f} % |"
        for r in rows
    ]
    return "\n".join(lines)


def _each(differences: list[float]) -> str:
    return ", ".join(f"{value:+.3f}" for value in differences)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--grains", type=int, nargs="*", default=[1000, 5000])
    parser.add_argument("--samples", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--finished", action="store_true", help="only table what is done")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    options = (given.samples, given.workers)
    rows = [
        row
        for n in given.grains
        for row in compare(given.out, n, *options, finished=given.finished)
    ]
    (given.out / "accuracy.json").write_text(json.dumps(rows, indent=1))
    print(table(rows))


if __name__ == "__main__":
    main()
