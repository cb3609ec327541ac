"""Critical states of spheres in triaxial compression, and the prediction of extension from them.

A dense and a loose sample, sheared at constant mean stress by compression and by extension (and,
if asked, at b = 1/2). z_min and z_max are inverted from the critical state of compression alone;
the extension state that they predict is tabled beside the measured one.

    python benchmarks/triaxial.py OUT [--grains 5000] [--friction 0.4] [--strain 0.4]

Each path leaves a run folder in OUT and is not run again if it is there; the result is
OUT/triaxial.json.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

SAMPLES = {"dense": 0.03, "loose": 1.0}  # compaction friction
CRITERIA = ("force", "gap:0.001", "gap:0.005", "gap:0.015")
PATHS = {
    ("dense", "compression"): {},
    ("loose", "compression"): {},
    ("dense", "extension"): {},
    ("loose", "extension"): {},
    ("dense", "b = 0.5"): {"b": 0.5},
}


def run_path(start: str, mode: str, given: argparse.Namespace) -> str:
    """One path into its folder; returns the folder."""
    from granufab.reproduce import run_into_folder
    from granufab.simulate.settings import Case, Material, Record, Sample, Solver, Stage

    name = f"{start}-{mode.replace(' ', '')}"
    folder = Path(given.out) / name
    if not (folder / "summary.json").exists():
        strain = -given.strain if mode == "extension" else given.strain
        case = Case(
            name=name,
            sample=Sample(
                grain_count=given.grains, dimension=3, friction=SAMPLES[start], seed=given.seed
            ),
            material=Material(friction=given.friction),
            solver=Solver(time_step=given.time_step),
            path=(
                Stage(strain=strain, axis=2, inertial_number=given.inertial_number).model_copy(
                    update=PATHS[start, mode]
                ),
            ),
            record=Record(series_interval=2e-3, frame_interval=2e-2),
        )
        run_into_folder(case, folder, force=True)
    return str(folder)


def domain_of(folder: str, mode: str) -> dict[str, Any]:
    """Fit of one path, and what else its plateau holds."""
    from granufab import fit_accessible_states, read

    run = read(Path(folder) / "run.h5")
    series = run.series
    strain, z, a = (series[k].values for k in ("eps_q_total", "z_backbone", "a_signed"))
    kind = {"extension": {"mode": "extension"}, "b = 0.5": {"b": 0.5}}.get(mode, {})
    fit = fit_accessible_states(strain, z, a, dimension=3, **kind)
    late = strain >= strain[-1] * 2 / 3
    means = {
        name: float(series[name].values[late].mean())
        for name in ("z", "rattler_fraction", "q_over_p", "phi")
    }
    solver = {
        name: run.summary[name]
        for name in ("steps", "nonconverged_steps", "residual_max", "overlap_max", "seconds")
    }
    values = {
        name: {key: float(getattr(getattr(fit, name), key)) for key in ("value", "low", "high")}
        for name in ("z_min", "z_max", "z_star", "a_star")
    }
    return {"z_0": float(z[0]), "phi_0": float(series["phi"].values[0]), **values, **means,
            "solver": solver}  # fmt: skip


def by_criterion(folders: dict[tuple[str, str], str]) -> list[dict[str, Any]]:
    """z and |a'| over the recorded states of the plateau, and the prediction, per criterion."""
    from granufab import AccessibleDomain, read
    from granufab.fabric import late_frames, measure

    table = []
    for criterion in CRITERIA:
        states: dict[str, list[tuple[float, float]]] = {"compression": [], "extension": []}
        for (_, mode), folder in folders.items():
            if mode not in states:
                continue
            for frame in late_frames(read(Path(folder) / "run.h5")):
                found = measure(
                    frame.packing, criterion=criterion, direction=frame.direction, reach=0.05
                )
                states[mode].append((float(found["z_backbone"]), abs(float(found["a_signed"]))))  # type: ignore[arg-type]
        z, a = np.mean(states["compression"], axis=0)
        limits = AccessibleDomain.from_critical(z, a, dimension=3)
        turned = AccessibleDomain(
            z_min=limits.z_min, z_max=limits.z_max, dimension=3, mode="extension"
        )
        measured = np.mean(states["extension"], axis=0)
        table.append({
            "criterion": criterion, "z_star": z, "a_star": a,
            "z_min": limits.z_min, "z_max": limits.z_max,
            "predicted": [turned.z_star, turned.a_star], "measured": measured.tolist(),
        })  # fmt: skip
    return table


def predict(compression: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Extension and b = 1/2 states from the limits of compression, with 95 % intervals."""
    from granufab import AccessibleDomain

    def states(z_star: float, a_star: float) -> dict[str, float]:
        found = AccessibleDomain.from_critical(z_star, a_star, dimension=3)
        entry = {}
        for mode, kind in (("extension", {"mode": "extension"}), ("b = 0.5", {"b": 0.5})):
            domain = AccessibleDomain(z_min=found.z_min, z_max=found.z_max, dimension=3, **kind)
            entry |= {f"{mode} z_star": domain.z_star, f"{mode} a_star": domain.a_star}
        return entry

    def normal(name: str) -> np.ndarray:
        generator = np.random.default_rng(0 if name == "z_star" else 1)
        draws = []
        for path in compression:
            half = (path[name]["high"] - path[name]["low"]) / (2 * 1.96)
            draws.append(path[name]["value"] + half * generator.standard_normal(2000))
        return np.mean(draws, axis=0)

    z_star = float(np.mean([path["z_star"]["value"] for path in compression]))
    a_star = float(np.mean([path["a_star"]["value"] for path in compression]))
    draws = [states(z, a) for z, a in zip(normal("z_star"), normal("a_star"), strict=True)]
    result = {}
    for name, value in states(z_star, a_star).items():
        low, high = np.quantile([draw[name] for draw in draws], [0.025, 0.975])
        result[name] = {"value": value, "low": float(low), "high": float(high)}
    return result


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--grains", type=int, default=5000)
    parser.add_argument("--friction", type=float, default=0.4)
    parser.add_argument("--strain", type=float, default=0.4)
    parser.add_argument("--inertial-number", type=float, default=1e-3)
    parser.add_argument("--time-step", type=float, default=0.05)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    keys = list(PATHS)
    with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(run_path, *key, given) for key in keys]
        folders = [job.result() for job in jobs]
    rows = {key: domain_of(folder, key[1]) for key, folder in zip(keys, folders, strict=True)}
    compression = [rows[start, "compression"] for start in SAMPLES]
    table = [{"start": start, "mode": mode, **row} for (start, mode), row in rows.items()]
    settings = {k: v for k, v in vars(given).items() if k not in ("out", "workers")}
    data = {
        "settings": settings,
        "paths": table,
        "predicted": predict(compression),
        "criteria": by_criterion(dict(zip(keys, folders, strict=True))),
    }
    (given.out / "triaxial.json").write_text(json.dumps(data, indent=1))
    print(json.dumps(data, indent=1))


if __name__ == "__main__":
    main()
