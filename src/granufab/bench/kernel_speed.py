"""Cost of a contact update: our kernels beside the C++ reference, and one thread beside two."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from granufab.bench.engine import Case, Kernel, copy_of, problem_of, streams_of, sweep_seconds
from granufab.bench.problems import FRICTION, isotropic_state
from granufab.bench.reference import Reference
from granufab.bench.side_by_side import Timing, ratio_of, take_turns
from granufab.simulate import Isotropic

__all__ = [
    "UPDATES",
    "best_kernel",
    "has_threads",
    "isotropic_case",
    "kernel_speed",
    "thread_speed",
    "update_costs",
]

UPDATES = 2_500_000
"""Contact updates of one timing: some tens of milliseconds."""


def isotropic_case(grain_count: int, dimension: int, source: int | None = None) -> Case:
    """The contact problem of a tiled, shaken isotropic state."""
    packing = isotropic_state(grain_count, dimension, source=source)
    return problem_of(packing, Isotropic(dimension=dimension), friction=FRICTION)


def kernel_speed(
    case: Case, reference: Reference | None, *, repetitions: int, updates: int = UPDATES
) -> dict[str, Any]:
    """ns per contact update of the scalar kernel, the fast kernel and the reference, in turn.

    Args:
        case: the problem; each contender sweeps a copy of its own.
        reference: the compiled C++ sweep, or None.
        repetitions: rounds.
        updates: contact updates in one timing.
    """
    sweeps = max(1, updates // case.contact_count)

    def ours(kernel: Kernel) -> Timing:
        return partial(sweep_seconds, copy_of(case), sweeps, kernel=kernel)

    def theirs() -> float | None:
        if reference is None or yardstick is None:
            return None
        return reference.sweep(yardstick, sweeps)

    yardstick = None if reference is None else streams_of(case)
    scalar, fast, plain = take_turns([ours("scalar"), ours("fast"), theirs], repetitions)
    return {
        "dimension": case.dimension,
        "grains": case.grain_count,
        "contacts": case.contact_count,
        "repetitions": repetitions,
        "sweeps": sweeps,
        "scalar_ns": _nanoseconds(scalar, sweeps * case.contact_count),
        "fast_ns": _nanoseconds(fast, sweeps * case.contact_count),
        "reference_ns": _nanoseconds(plain, sweeps * case.contact_count),
        "scalar_ratio": ratio_of(scalar, plain),
        "fast_ratio": ratio_of(fast, plain),
        "fast_gain": ratio_of(scalar, fast),
    }


def _nanoseconds(seconds: list[float | None], updates: int) -> float | None:
    return _median([None if value is None else 1e9 * value / updates for value in seconds])


def _median(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def best_kernel(case: Case) -> Kernel:
    """The fast kernel where the engine has it."""
    return "scalar" if sweep_seconds(copy_of(case), 1, kernel="fast") is None else "fast"


def has_threads(case: Case) -> bool:
    """Whether the engine can share a sweep between two threads."""
    return sweep_seconds(copy_of(case), 1, kernel=best_kernel(case), threads=2) is not None


def thread_speed(case: Case, *, repetitions: int, updates: int = UPDATES) -> dict[str, Any]:
    """ns per contact update of one and of two threads, in turn, with the best kernel."""
    kernel = best_kernel(case)
    sweeps = max(1, updates // case.contact_count)
    timings = [
        partial(sweep_seconds, copy_of(case), sweeps, kernel=kernel, threads=threads)
        for threads in (1, 2)
    ]
    one, two = take_turns(timings, repetitions)
    return {
        "grains": case.grain_count,
        "contacts": case.contact_count,
        "kernel": kernel,
        "repetitions": repetitions,
        "one_ns": _nanoseconds(one, sweeps * case.contact_count),
        "two_ns": _nanoseconds(two, sweeps * case.contact_count),
        "ratio": ratio_of(one, two),
    }


def update_costs(
    cases: Sequence[Case], *, repetitions: int, updates: int = UPDATES
) -> list[dict[str, Any]]:
    """ns per contact update of the best kernel on one thread, all cases in turn.

    ``relative`` is a case's cost over the first one's, pair by pair.
    """
    kernel = best_kernel(cases[0])
    sweeps = [max(1, updates // case.contact_count) for case in cases]
    columns = take_turns(
        [
            partial(sweep_seconds, copy_of(case), count, kernel=kernel)
            for case, count in zip(cases, sweeps, strict=True)
        ],
        repetitions,
    )
    costs = [
        [None if t is None else 1e9 * t / (count * case.contact_count) for t in column]
        for column, count, case in zip(columns, sweeps, cases, strict=True)
    ]
    return [
        {
            "dimension": case.dimension,
            "grains": case.grain_count,
            "contacts": case.contact_count,
            "kernel": kernel,
            "ns": _median(cost),
            "relative": ratio_of(cost, costs[0]),
        }
        for case, cost in zip(cases, costs, strict=True)
    ]
