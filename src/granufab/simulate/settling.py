"""From a compacted sample to rest: settle the motion, then find the forces of the resting network.

With friction: viscous damping, then a tight tolerance, both with slightly compliant contacts,
which converge at rest. Without friction: settle with softer contacts, whose rest is soon found,
then linear programs for the rigid rest (:mod:`granufab.simulate.jamming`), which end with as
many contacts as equations; in samples too large for them rigid sweeps, which end near it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granufab.simulate.settings import Solver
from granufab.simulate.stepping import Simulation

__all__ = ["march", "settle"]

Tell = Callable[[float], None]
STIFFNESS = 1.6e5
SOFTER = (1.6e3, 1.6e4)
SETTLE_STEPS, SOFT_STEPS, REST_STEPS = 600, 4000, 80
SETTLED_ENERGY, RESTING_ENERGY = 1e-8, 1e-10
SOFT_ENERGY = 1e-4
RESTING_OVERLAP = 2e-6
GENTLE = Solver(tolerance=1e-5, stiffness=STIFFNESS, time_step=0.5, max_sweeps=3000)


def march(
    simulation: Simulation,
    limit: int,
    every: int,
    done: Callable[[Simulation], bool],
    tell: Tell,
    after_step: Callable[[Simulation], None] | None = None,
) -> int:
    """Step until ``done``, asked every few steps, or ``limit``; returns the steps made."""
    made = 0
    while made < limit:
        wanted = 1 if after_step is not None else min(every - made % every, limit - made)
        made += len(simulation.advance(wanted))
        if after_step is not None:
            after_step(simulation)
        if made % every == 0:
            tell(made / limit)
            if done(simulation):
                break
    return made


def settle(
    simulation: Simulation, friction: float, tolerance: float | None, tell: Tell
) -> tuple[int, dict[str, Any]]:
    """Bring a compacted sample to rest.

    Args:
        simulation: compacted, under isotropic stress.
        friction: of the compaction [-].
        tolerance: residual of the rest; default 1e-6 (frictionless sweeps 3e-7).
        tell: called with the fraction done.
    Returns:
        Steps made, and how the rest was found (``rest``: programs or sweeps).
    """
    if friction > 0:
        return _settle_damped(simulation, tolerance or 1e-6, tell), {"rest": "sweeps"}
    steps = _settle_soft(simulation, lambda f: tell(0.5 * f))
    from granufab.simulate.jamming import jam  # sparse algebra of SciPy: only where it is used

    simulation.damping = 0.5
    _use(simulation, _rigid(tolerance or 1e-6))
    jammed = jam(simulation, tolerance=tolerance or 1e-6, tell=lambda f: tell(0.5 + 0.5 * f))
    if jammed is None:
        steps += _settle_by_sweeps(simulation, tolerance or 3e-7, lambda f: tell(0.5 + 0.5 * f))
        return steps, {"rest": "sweeps"}
    return steps + jammed.programs, {
        "rest": "programs",
        "programs": jammed.programs,
        "gaps_closed": jammed.closed,
    }


def _settle_damped(simulation: Simulation, tolerance: float, tell: Tell) -> int:
    simulation.damping = 0.5
    _use(simulation, GENTLE)
    steps = march(
        simulation,
        SETTLE_STEPS,
        10,
        lambda s: s.kinetic_ratio() < SETTLED_ENERGY,
        lambda f: tell(0.67 * f),
    )
    _use(simulation, GENTLE.model_copy(update={"tolerance": tolerance}))
    return steps + march(simulation, REST_STEPS, 5, _resting, lambda f: tell(0.67 + 0.33 * f))


def _settle_soft(simulation: Simulation, tell: Tell) -> int:
    """Rest with softer contacts, then with stiffer ones, which start near theirs.

    Stiff frictionless packings creep along soft modes almost without end; a soft one has many
    more contacts than equations and comes to rest.
    """
    steps = 0
    for stage, stiffness in enumerate(SOFTER):
        _use(simulation, GENTLE.model_copy(update={"stiffness": stiffness, "time_step": 0.2}))
        steps += _quench(
            simulation,
            SOFT_STEPS,
            SOFT_ENERGY / stiffness,
            lambda f, stage=stage: tell((stage + f) / len(SOFTER)),
        )
    return steps


def _settle_by_sweeps(simulation: Simulation, tolerance: float, tell: Tell) -> int:
    """Settle stiff contacts, then rigid ones, and remove the overlaps."""
    simulation.damping = 0.0
    _use(simulation, GENTLE.model_copy(update={"time_step": 0.2}))
    steps = _quench(simulation, SETTLE_STEPS, SETTLED_ENERGY, lambda f: tell(0.67 * f))
    simulation.damping = 0.5
    _use(simulation, _rigid(tolerance))
    return steps + march(simulation, REST_STEPS, 5, _resting, lambda f: tell(0.67 + 0.33 * f))


def _quench(simulation: Simulation, limit: int, energy: float, tell: Tell) -> int:
    """Kinetic damping until the maxima of the energy stay below ``energy`` (of pV)."""
    simulation.damping = 0.0
    damping = _KineticDamping()
    return march(simulation, limit, 10, lambda s: damping.peak < energy, tell, damping)


def _rigid(tolerance: float) -> Solver:
    rigid = {"stiffness": float("inf"), "overlap_correction": 0.1, "max_sweeps": 5000}
    return GENTLE.model_copy(update={"tolerance": tolerance, **rigid})


def _use(simulation: Simulation, solver: Solver) -> None:
    simulation.solver = solver
    simulation.set_loading(simulation.loading)


class _KineticDamping:
    """Stops every motion where the kinetic energy has passed a maximum.

    Without friction a packing is barely stiff: viscous damping takes thousands of steps, while
    the energy that a soft mode has turned into motion can be taken out at once.
    """

    def __init__(self) -> None:
        self.energy, self.peak = 0.0, float("inf")

    def __call__(self, simulation: Simulation) -> None:
        energy = simulation.kinetic_ratio()
        if energy >= self.energy:
            self.energy = energy
            return
        self.energy, self.peak = 0.0, self.energy
        simulation.stop()


def _resting(simulation: Simulation) -> bool:
    report = simulation.last_report
    still = simulation.kinetic_ratio() < RESTING_ENERGY and report.converged
    return still and (report.overlap < RESTING_OVERLAP or np.isfinite(simulation.solver.stiffness))
