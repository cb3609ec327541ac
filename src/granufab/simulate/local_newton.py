"""Semismooth Newton on Alart and Curnier's equations, for the last digits of (W, q, mu).

With y = r − u (scaled so that ρ = 1), F_N = r_N − max(0, y_N) and F_T = r_T − proj(y_T) on the
disk of radius µ max(0, y_N); F = 0 exactly at solutions. A step solves J Δr = −F with
J = 1 − D + D (W + ε), D the blocks of the derivative by y. ε makes steps unique and short where
the impulses are not unique. It follows the residual: of the order of what is still wrong, it
carries rigid packings through, where a fixed small one fails; as it fades the last steps are
Newton's own, and the answer has no part of it, for F has none.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy  # its parts load where they are used

from granufab.packing import Array
from granufab.simulate.local_residual import ScaledProblem

__all__ = ["newton_steps"]

SMALLEST, LARGEST = 1e-9, 1e-3
SHORTEST = 1e-3
PATIENCE = 20
LOST = 1e-8
"""Share of the right side by which a solution with pivots on the diagonal may miss it."""
SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.01,
    "options": {"SymmetricMode": True},
}


class _Law(NamedTuple):
    """F and what its derivative needs."""

    defect: Array
    derivative: Array
    size: float


def newton_steps(
    problem: ScaledProblem, impulse: Array, tolerance: float, limit: int
) -> tuple[Array, float, int]:
    """Newton steps until the residual is met, none brings progress or the limit is reached.

    Args:
        problem: the scaled problem.
        impulse: where to start, shape (contact_count, d).
        tolerance: on the residual [-].
        limit: largest number of steps.
    Returns:
        The best impulses met, their residual [-], steps made.
    """
    law = _law(problem, impulse)
    best, lowest, since = impulse, problem.residual(impulse), 0
    for step in range(limit):
        epsilon = min(max(lowest, SMALLEST), LARGEST)
        change = _direction(problem, law, epsilon)
        if lowest <= tolerance or since == PATIENCE or change is None:
            return best, lowest, step
        impulse, law = _search(problem, impulse, law, change)
        residual = problem.residual(impulse)
        since += 1
        if residual < lowest:
            best, lowest, since = impulse, residual, 0
    return best, lowest, limit


def _search(problem: ScaledProblem, impulse: Array, law: _Law, change: Array) -> tuple[Array, _Law]:
    """Halve the step until ‖F‖ falls; the whole step where it never does."""
    share = 1.0
    while share >= SHORTEST:
        trial = impulse + share * change
        found = _law(problem, trial)
        if found.size < (1 - 1e-4 * share) * law.size:
            return trial, found
        share *= 0.5
    return impulse + change, _law(problem, impulse + change)


def _direction(problem: ScaledProblem, law: _Law, epsilon: float) -> Array | None:
    """−J⁻¹F, or None where J has no factors."""
    count, d = law.defect.shape
    one = scipy.sparse.eye_array(count * d, format="csr")
    order = (law.derivative, np.arange(count), np.arange(count + 1))
    D = scipy.sparse.bsr_array(order, shape=one.shape)
    J = scipy.sparse.csc_array(one - D + D @ (problem.W + epsilon * one))
    change = _solved(J, -law.defect.ravel())
    return None if change is None else change.reshape(count, d)


def _solved(J: scipy.sparse.csc_array, right: Array) -> Array | None:
    """Solution of J x = right, or None where J has no factors.

    The pattern of J is nearly symmetric: an order for symmetric patterns and pivots on the
    diagonal make a third of the factors' numbers in 3D. Where such pivots lose too much, the
    general order and partial pivoting follow.
    """
    for options in (SYMMETRIC, {}):
        try:
            found = scipy.sparse.linalg.splu(J, **options).solve(right)
        except RuntimeError:
            continue
        error = np.abs(J @ found - right).max() if np.isfinite(found).all() else np.inf
        if error <= LOST * np.abs(right).max() or (not options and np.isfinite(error)):
            return found
    return None


def _law(problem: ScaledProblem, impulse: Array) -> _Law:
    y = impulse - problem.velocity(impulse)
    mu, count, tangents = problem.mu, len(y), y.shape[1] - 1
    radius = mu * np.maximum(y[:, 0], 0.0)
    size = np.linalg.norm(y[:, 1:], axis=1)
    pushed, slides = y[:, 0] > 0, size > radius
    share = np.where(slides, radius / np.where(slides, size, 1.0), 1.0)
    target = np.column_stack([np.maximum(y[:, 0], 0.0), y[:, 1:] * share[:, None]])
    direction = y[:, 1:] / np.where(size > 0, size, 1.0)[:, None]
    along = np.einsum("ci,cj->cij", direction, direction)
    plane = np.eye(tangents) - np.where(slides, 1.0, 0.0)[:, None, None] * along
    derivative = np.zeros((count, tangents + 1, tangents + 1))
    derivative[:, 0, 0] = pushed
    derivative[:, 1:, 1:] = np.where(pushed, share, 0.0)[:, None, None] * plane
    derivative[:, 1:, 0] = np.where(pushed & slides, mu, 0.0)[:, None] * direction
    defect = impulse - target
    return _Law(defect, derivative, float(np.linalg.norm(defect)))
