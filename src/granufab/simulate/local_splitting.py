"""Alternating directions for (W, q, mu): what sweeps and Newton steps leave to a linear solve.

Splitting r = x = z: x obeys the linear law with a spring ρ to z, z is x projected on the cones, and
ξ adds up what they differ by (ADMM, Boyd et al. 2011); the term s = µ|u_T| n of De Saxcé's form of
friction is taken from the present z. Every step is one solve with the factors of W + ρ, so news
crosses a stack of bodies at once, where a sweep hands it on by one contact. ρ doubles or halves
with the ratio of the two defects.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy  # its parts load where they are used

from granufab.packing import Array
from granufab.simulate.local_residual import ScaledProblem, project_on_cone

__all__ = ["splitting_steps"]

FIRST_RHO = 0.3
LARGEST_RHO = 1e3
ADAPT_EVERY = 10
UNBALANCED = 10.0


def splitting_steps(
    problem: ScaledProblem, impulse: Array, tolerance: float, limit: int
) -> tuple[Array, float, int]:
    """Alternate until the residual is met or the limit is reached.

    Args:
        problem: the scaled problem.
        impulse: where to start, shape (contact_count, d).
        tolerance: on the residual [-].
        limit: largest number of steps.
    Returns:
        The best impulses met, their residual [-], steps made.
    """
    rho, solve = FIRST_RHO, _factors(problem, FIRST_RHO)
    z, best, lowest = impulse, impulse, problem.residual(impulse)
    velocity = _modified(problem, z)
    xi = (-velocity - project_on_cone(-velocity, problem.mu)) / rho
    for step in range(limit):
        if lowest <= tolerance:
            return best, lowest, step
        shift = problem.q + velocity - problem.velocity(z)
        x = solve((rho * (z - xi) - shift).ravel()).reshape(z.shape)
        before, z = z, project_on_cone(x + xi, problem.mu)
        xi = xi + x - z
        velocity = _modified(problem, z)
        residual = problem.residual(z)
        if residual < lowest:
            best, lowest = z, residual
        factor = _balance(np.linalg.norm(x - z), rho * np.linalg.norm(z - before))
        factor = min(max(factor, 1 / (LARGEST_RHO * rho)), LARGEST_RHO / rho)
        if step % ADAPT_EVERY == ADAPT_EVERY - 1 and step < limit / 2 and factor != 1.0:
            rho *= factor
            xi, solve = xi / factor, _factors(problem, rho)
    return best, lowest, limit


def _modified(problem: ScaledProblem, impulse: Array) -> Array:
    """u + µ|u_T| n."""
    velocity = problem.velocity(impulse)
    velocity[:, 0] += problem.mu * np.linalg.norm(velocity[:, 1:], axis=1)
    return velocity


def _balance(primal: np.floating, dual: np.floating) -> float:
    """What to multiply ρ by."""
    if primal > UNBALANCED * dual:
        return 2.0
    return 0.5 if dual > UNBALANCED * primal else 1.0


def _factors(problem: ScaledProblem, rho: float) -> Callable[[Array], Array]:
    shifted: Any = scipy.sparse.csc_array(
        problem.W + rho * scipy.sparse.eye_array(problem.W.shape[0])
    )
    return scipy.sparse.linalg.splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve
