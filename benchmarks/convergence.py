"""Convergence study: what residual, stiffness, inertial number and step size the physics needs.

Four samples (two dense, two loose) are sheared at constant mean stress, µ = 0.4, to ε_q = 0.3
with every setting of a group; means over ε_q 0.1–0.3 are compared with the tightest trustworthy
run of the group, sample by sample. Jobs already done are not run again.

    python benchmarks/convergence.py OUT [group …] [--grains 2000] [--workers 2]
    python benchmarks/convergence.py OUT --report
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

INF = math.inf
SAMPLES = (("dense", 3.7, 1), ("loose", 3.15, 1), ("dense", 3.7, 2), ("loose", 3.15, 2))
COLUMNS = ("eps_q", "z", "z_backbone", "rattler_fraction", "a_signed", "q_over_p", "phi", "overlap")


def job(tolerance: float, stiffness: float, inertial: float, step: float) -> dict[str, float]:
    """One setting: residual, k/p, I, largest strain per step."""
    return {"tolerance": tolerance, "stiffness": stiffness, "inertial": inertial, "step": step}


GROUPS: dict[str, list[dict[str, float]]] = {
    # residual at I = 1e-3, for four stiffnesses
    "soft": [job(r, 1.6e4, 1e-3, 5e-5) for r in (1e-3, 1e-4, 1e-5)],
    "medium": [job(r, 5e4, 1e-3, 5e-5) for r in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)],
    "stiff": [job(r, 1.6e5, 1e-3, 5e-5) for r in (1e-2, 1e-3, 1e-4, 1e-5)],
    "rigid": [job(r, INF, 1e-3, 5e-5) for r in (1e-2, 1e-3, 1e-4, 1e-5)],
    # residual at I = 1e-4
    "slow": [job(r, 5e4, 1e-4, 5e-6) for r in (1e-2, 1e-3, 1e-4, 1e-5)],
    "slow-rigid": [job(r, INF, 1e-4, 2e-5) for r in (1e-2, 1e-3, 1e-4)],
    # inertial number and strain per step at fixed residual
    "rate": [
        job(1e-4, 1.6e5, 1e-2, 1e-4),
        job(1e-4, 1.6e5, 3e-3, 1e-4),
        job(1e-4, 1.6e5, 1e-3, 5e-5),
        job(1e-4, 1.6e5, 3e-4, 1.5e-5),
    ],
    "rate-slow": [job(1e-4, 1.6e5, 1e-4, 5e-6), job(1e-4, 1.6e5, 3e-5, 5e-6)],
    "step": [job(1e-4, 1.6e5, 1e-3, s) for s in (4e-4, 2e-4, 1e-4, 5e-5, 2e-5)],
}


def _name(setting: dict[str, float], sample: tuple[str, float, int], grains: int) -> str:
    kind, _, seed = sample
    return (
        f"{kind}{seed}-N{grains}-r{setting['tolerance']:.0e}-k{setting['stiffness']:.1e}"
        f"-I{setting['inertial']:.0e}-s{setting['step']:.0e}"
    )


def prepare_sample(out: Path, sample: tuple[str, float, int], grains: int) -> Path:
    """Make a starting sample once; it is kept as a run file with one frame."""
    import granufab.simulate as g
    from granufab.history import Frame
    from granufab.io import RunFileWriter

    kind, z, seed = sample
    path = out / f"{kind}{seed}-N{grains}.h5"
    if path.exists():
        return path
    settings = g.Sample(grain_count=grains, coordination=z, seed=seed, coordination_tolerance=0.05)
    made = g.prepare(settings)
    with RunFileWriter(path, settings={"name": kind}, force=True) as writer:
        writer.frame(
            Frame(
                packing=made.packing,
                eps_q=0.0,
                eps_q_total=0.0,
                strain=np.zeros((2, 2)),
                stage=0,
                stress=np.eye(2),
                inertial_number=0.0,
                direction=np.array([0.0, 1.0]),
            )
        )
        writer.close({"friction": made.friction, "reached": made.reached})
    return path


def stored(out: Path, setting: dict[str, float], sample: tuple[str, float, int], grains: int):
    """What a job left, or None."""
    target = out / (_name(setting, sample, grains) + ".json")
    return json.loads(target.read_text()) if target.exists() else None


def run_job(out: Path, setting: dict[str, float], sample: tuple[str, float, int], grains: int):
    """Shear one sample with one setting and keep its series and summary."""
    import granufab.simulate as g
    from granufab.io import read

    target = out / (_name(setting, sample, grains) + ".json")
    done = stored(out, setting, sample, grains)
    if done is not None:
        return done
    start = read(prepare_sample(out, sample, grains)).frames[0].packing
    result = g.shear(
        start,
        strain=0.3,
        friction=0.4,
        inertial_number=setting["inertial"],
        solver=g.Solver(
            tolerance=setting["tolerance"],
            stiffness=setting["stiffness"],
            step_strain=setting["step"],
            time_step=10.0,
            max_sweeps=2000,
        ),
        record_settings=g.Record(series_interval=2e-3, frame_interval=1.0),
    )
    data: dict[str, Any] = {
        "setting": {k: str(v) if math.isinf(v) else v for k, v in setting.items()},
        "sample": list(sample),
        "grains": grains,
        "series": {name: result.series[name].values.tolist() for name in COLUMNS},
        "summary": {k: v for k, v in result.summary.items() if not isinstance(v, dict | list)},
    }
    target.write_text(json.dumps(data))
    return data


def means(data: dict[str, Any]) -> dict[str, float]:
    """Means over ε_q 0.1–0.3 and how the run was solved."""
    series = {k: np.array(v, dtype=float) for k, v in data["series"].items()}
    late = series["eps_q"] >= 0.1
    summary = data["summary"]
    return {
        **{name: float(series[name][late].mean()) for name in COLUMNS[1:-1]},
        "overlap": float(series["overlap"][1:].max()),
        "unconverged": summary["nonconverged_steps"] / summary["steps"],
        "sweeps": summary["sweeps_mean"],
        "steps": summary["steps"],
        "seconds": summary["seconds"],
        "contact_updates": summary["contact_updates"],
    }


def run_groups(out: Path, groups: list[str], grains: int, workers: int, samples: int) -> None:
    """Run every missing job of the groups, cheapest tolerance first."""
    chosen = SAMPLES[:samples] if samples < 4 else SAMPLES
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        list(pool.map(prepare_sample, [out] * len(chosen), chosen, [grains] * len(chosen)))
        jobs = {
            pool.submit(run_job, out, setting, sample, grains): _name(setting, sample, grains)
            for group in groups
            for setting in GROUPS[group]
            for sample in chosen
        }
        for done in as_completed(jobs):
            m = means(done.result())
            print(
                time.strftime("%H:%M:%S"),
                jobs[done],
                f"zb {m['z_backbone']:.3f} z {m['z']:.3f} a {m['a_signed']:.3f} "
                f"q/p {m['q_over_p']:.4f} ov {m['overlap']:.1e} unconv {m['unconverged']:.4f} "
                f"sweeps {m['sweeps']:.0f} s {m['seconds']:.0f}",
                flush=True,
            )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("groups", nargs="*", default=list(GROUPS))
    parser.add_argument("--grains", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--samples", type=int, default=4)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    run_groups(given.out, given.groups, given.grains, given.workers, given.samples)


if __name__ == "__main__":
    main()
