"""Sweeps and seconds to a residual, plain beside accelerated, and where a step's time goes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from granufab.bench.engine import Marching, StepCost
from granufab.bench.side_by_side import ratio_of
from granufab.packing import Packing
from granufab.simulate import Loading

__all__ = ["PLAIN_CAP", "compare_solvers", "profile_steps"]

PLAIN_CAP = 20_000
"""Sweeps after which a plain step stops; it then counts with these."""

Tell = Callable[[float], None]


def compare_solvers(
    packing: Packing,
    loading: Loading,
    *,
    friction: float,
    tolerance: float,
    steps: int,
    cap: int = PLAIN_CAP,
    tell: Tell | None = None,
) -> dict[str, Any]:
    """Consecutive steps of one state, plain and accelerated in turn, at the same stiffness.

    Each run goes on from its own solutions, as a user's would. The ratios are those of the
    totals; a step stopped by the cap counts with what it took.

    Args:
        packing: starting state with its forces.
        loading: what drives the cell.
        friction: µ between grains.
        tolerance: residual of each step.
        steps: how many.
        cap: sweeps after which a step stops.
        tell: called with the fraction done.
    """
    plain, fast = (
        Marching(packing, loading, friction=friction, tolerance=tolerance, accelerated=on, cap=cap)
        for on in (False, True)
    )
    costs: list[tuple[StepCost, StepCost]] = []
    for k in range(steps):
        costs.append((plain.step(), fast.step()))
        if tell is not None:
            tell((k + 1) / steps)
    slow, quick = [pair[0] for pair in costs], [pair[1] for pair in costs]
    return {
        "grains": packing.grains.count,
        "contacts": quick[-1].contacts,
        "tolerance": tolerance,
        "stiffness": fast.stiffness,
        "steps": steps,
        "cap": cap,
        "plain": _totals(slow),
        "accelerated": _totals(quick),
        "sweeps_ratio": _quotient([c.sweeps for c in slow], [c.sweeps for c in quick]),
        "time_ratio": _quotient([c.seconds for c in slow], [c.seconds for c in quick]),
        "sweeps_ratio_by_step": ratio_of([c.sweeps for c in slow], [c.sweeps for c in quick]),
        "time_ratio_by_step": ratio_of([c.seconds for c in slow], [c.seconds for c in quick]),
    }


def _quotient(above: Sequence[float], below: Sequence[float]) -> float | None:
    return sum(above) / sum(below) if sum(below) > 0 else None


def _totals(costs: list[StepCost]) -> dict[str, Any]:
    sweeps = [cost.sweeps for cost in costs]
    return {
        "sweeps_mean": float(np.mean(sweeps)),
        "sweeps_max": max(sweeps),
        "seconds": sum(cost.seconds for cost in costs),
        "residual_max": max(cost.residual for cost in costs),
        "stopped": sum(not cost.reached for cost in costs),
    }


def profile_steps(
    packing: Packing, loading: Loading, *, friction: float, tolerance: float, steps: int
) -> dict[str, Any]:
    """Where the time of accelerated steps goes.

    ``sweeps`` holds all iterations: sweeps, momentum and the residuals that decide when to stop;
    ``outside_sweeps_fraction`` is the share of everything else.
    """
    marching = Marching(packing, loading, friction=friction, tolerance=tolerance)
    marching.step()
    before = marching.seconds_by_stage()
    costs = [marching.step() for _ in range(steps)]
    seconds = {k: v - before[k] for k, v in marching.seconds_by_stage().items()}
    total = sum(cost.step_seconds for cost in costs)
    updates = sum(cost.sweeps * cost.contacts for cost in costs)
    return {
        "grains": packing.grains.count,
        "contacts": costs[-1].contacts,
        "tolerance": tolerance,
        "steps": steps,
        "sweeps_mean": float(np.mean([cost.sweeps for cost in costs])),
        "ms_per_step": 1e3 * total / steps,
        "ms_by_stage": {name: 1e3 * value / steps for name, value in seconds.items()},
        "ns_per_update": 1e9 * seconds["sweeps"] / updates if updates else None,
        "outside_sweeps_fraction": 1 - seconds["sweeps"] / total,
    }
