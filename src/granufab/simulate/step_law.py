"""The numbers of a step, from the settings of a running system."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granufab.kernels.step_arrays import StepLaw
from granufab.simulate.contact_solver import patience_of
from granufab.simulate.step_memory import ProblemLaw

if TYPE_CHECKING:
    from granufab.simulate.stepping import Simulation

__all__ = ["OVERLAP_LIMIT", "problem_law", "skin_of", "solve_settings", "step_law"]

MOMENTUM_CAP = 0.9
ACTIVE_MARGIN = 2e-3
CLOSED_GAP = 1e-10
MISSED_TOLERANCE = 1e-6
OVERLAP_LIMIT = 0.5


def skin_of(s: Simulation) -> float:
    """Largest gap of the neighbour list [m]."""
    return s.solver.skin * s.scales.diameter


def step_law(s: Simulation) -> StepLaw:
    """Numbers of a step besides the contact problem's."""
    diameter = s.scales.diameter
    return StepLaw(
        step=s.step_size,
        overlap_correction=s.solver.overlap_correction,
        restitution=float(s.material.restitution),
        damping=float(s.damping),
        dilation=bool(s.loading.dilation),
        cell_inertia=s.cell_inertia,
        skin=skin_of(s),
        margin=ACTIVE_MARGIN * diameter,
        touching=CLOSED_GAP * diameter,
        missed=MISSED_TOLERANCE * diameter,
        reach=2 * float(s.radius.max()) + skin_of(s),
        rate_cap=np.inf if s.rate_cap is None else float(s.rate_cap),
        overlap_limit=OVERLAP_LIMIT * diameter,
        strict=bool(s.solver.strict),
    )


def problem_law(s: Simulation) -> ProblemLaw:
    """What the contacts of a step share."""
    stiffness = s.solver.stiffness * s.scales.force / s.scales.diameter
    soft = np.isfinite(stiffness) and s.material.restitution == 0
    return ProblemLaw(
        softness=1 / (stiffness * s.step_size**2) if soft else 0.0,
        spin_factor=s.spin_factor,
        coupled=s.coupled,
        dilation_weight=s.dilation_weight,
        weight=s.weight,
    )


def solve_settings(s: Simulation) -> tuple[float, int, float, float, float]:
    """Settings of the solve, see :func:`granufab.kernels.solve.solve`."""
    cap = MOMENTUM_CAP if s.solver.momentum else 0.0
    floor = s.scales.force * s.step_size
    patience = patience_of(problem_law(s).softness, cap)
    return (s.solver.tolerance, s.solver.max_sweeps, cap, floor, patience)
