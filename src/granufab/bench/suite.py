"""The benchmark that ``granufab bench`` runs: ratios, and the numbers they come from."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from granufab.bench.convergence import compare_solvers, profile_steps
from granufab.bench.engine import Case
from granufab.bench.kernel_speed import (
    UPDATES,
    has_threads,
    isotropic_case,
    kernel_speed,
    thread_speed,
)
from granufab.bench.machine import describe_machine, describe_versions
from granufab.bench.problems import FRICTION, SHEARED_STRAIN, biaxial_loading, sheared_state
from granufab.bench.reference import reference
from granufab.simulate import Solver

__all__ = ["HEADLINES", "QUICK", "TINY", "USUAL", "Extent", "run_suite"]

TIGHT = 1e-5
Progress = Callable[[str, float], None]

HEADLINES = {
    "kernel_2d_ratio": "scalar kernel / C++ reference, disks",
    "kernel_3d_ratio": "scalar kernel / C++ reference, spheres",
    "fast_2d_ratio": "fast kernel / C++ reference, disks",
    "fast_3d_ratio": "fast kernel / C++ reference, spheres",
    "sweeps_ratio_1e-5": "sweeps to residual 1e-5, plain / accelerated",
    "time_ratio_1e-5": "seconds to residual 1e-5, plain / accelerated",
    "threads_ratio_25k": "one thread / two threads, smaller problem",
    "threads_ratio_400k": "one thread / two threads, larger problem",
    "outside_sweeps_fraction": "share of a step outside the sweeps",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """How much is measured.

    Attributes:
        disks, spheres: grains of the kernels' problems.
        many_disks: grains of the larger problem of the threads.
        repetitions, updates: rounds of a timing, and contact updates in each.
        solver_grains: disks of the states on which the solvers are compared, one by one.
        solver_steps: consecutive steps there.
        profile_grains, profile_steps: of the profile of a step.
        source: disks of the sheared sample that is tiled, at most.
        strain, further: ε_q of that sample, and after tiling.
    """

    disks: int = 13_000
    spheres: int = 10_000
    many_disks: int = 200_000
    repetitions: int = 15
    updates: int = UPDATES
    solver_grains: tuple[int, ...] = (5000,)
    solver_steps: int = 20
    profile_grains: int = 13_000
    profile_steps: int = 50
    source: int = 400
    strain: float = SHEARED_STRAIN
    further: float = 0.002


QUICK = Extent()
USUAL = Extent(
    repetitions=41,
    solver_grains=(5000, 13_000),
    solver_steps=100,
    profile_steps=200,
    source=800,
    further=0.01,
)
TINY = Extent(
    disks=240, spheres=160, many_disks=500, repetitions=2, updates=2000, solver_grains=(80,),
    solver_steps=2, profile_grains=80, profile_steps=2, source=40, strain=2e-3, further=0.0,
)  # fmt: skip


def run_suite(extent: Extent, *, progress: Progress | None = None) -> dict[str, Any]:
    """Measure everything that ``extent`` asks for.

    Args:
        extent: how much.
        progress: called with a text and the fraction done.
    Returns:
        The headline ratios (:data:`HEADLINES`; None where the engine has no such kernel or the
        machine no compiler), then what they come from, the machine and the versions.
    """
    tell = progress or (lambda text, fraction: None)
    began = time.perf_counter()
    tell("compiling the C++ reference", 0.0)
    yardstick = reference()
    tell("kernels, disks", 0.05)
    disks = isotropic_case(extent.disks, 2)
    rows = [_kernel_row(disks, extent)]
    tell("kernels, spheres", 0.15)
    rows.append(_kernel_row(isotropic_case(extent.spheres, 3), extent))
    tell("threads", 0.25)
    threads = _threads(disks, extent)
    solvers = _solvers(extent, lambda fraction: tell("solvers", 0.3 + 0.5 * fraction))
    tell("profile of a step", 0.8)
    step = _profile(extent)
    return {
        **_headlines(rows, solvers, threads, step),
        "kernels": rows,
        "threads": threads,
        "solvers": solvers,
        "step": step,
        "machine": describe_machine(),
        "versions": describe_versions(yardstick),
        "seconds": time.perf_counter() - began,
    }


def _kernel_row(case: Case, extent: Extent) -> dict[str, Any]:
    return kernel_speed(case, reference(), repetitions=extent.repetitions, updates=extent.updates)


def _threads(disks: Case, extent: Extent) -> list[dict[str, Any]]:
    """One thread beside two, on the smaller and the larger problem; empty without threads."""
    if not has_threads(disks):
        return []
    cases = (disks, isotropic_case(extent.many_disks, 2))
    options = {"repetitions": extent.repetitions, "updates": 2 * extent.updates}
    return [thread_speed(case, **options) for case in cases]


def _solvers(extent: Extent, tell: Callable[[float], None]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for grains in extent.solver_grains:
        done = len(rows)
        tell(done / len(extent.solver_grains))
        state = sheared_state(
            grains, source=extent.source, strain=extent.strain, further=extent.further
        )
        row = compare_solvers(
            state,
            biaxial_loading(state),
            friction=FRICTION,
            tolerance=TIGHT,
            steps=extent.solver_steps,
            tell=lambda part, done=done: tell((done + part) / len(extent.solver_grains)),
        )
        rows.append({"loading": "biaxial", **row})
    return rows


def _profile(extent: Extent) -> dict[str, Any]:
    state = sheared_state(
        extent.profile_grains,
        source=extent.source,
        strain=extent.strain,
        further=extent.further,
    )
    return profile_steps(
        state,
        biaxial_loading(state),
        friction=FRICTION,
        tolerance=Solver().tolerance,
        steps=extent.profile_steps,
    )


def _headlines(
    kernels: list[dict[str, Any]],
    solvers: list[dict[str, Any]],
    threads: list[dict[str, Any]],
    step: dict[str, Any],
) -> dict[str, float | None]:
    """The worst of several sizes stands for the solvers."""
    found: dict[str, float | None] = dict.fromkeys(HEADLINES)
    for row in kernels:
        for name, key in (("kernel", "scalar_ratio"), ("fast", "fast_ratio")):
            found[f"{name}_{row['dimension']}d_ratio"] = _median(row[key])
    for name in ("sweeps_ratio", "time_ratio"):
        known = [row[name] for row in solvers if row[name] is not None]
        found[f"{name}_1e-5"] = min(known) if known else None
    for name, row in zip(("25k", "400k"), threads, strict=False):
        found[f"threads_ratio_{name}"] = _median(row["ratio"])
    found["outside_sweeps_fraction"] = step["outside_sweeps_fraction"]
    return found


def _median(ratio: Any) -> float | None:
    return None if ratio is None else ratio.median
