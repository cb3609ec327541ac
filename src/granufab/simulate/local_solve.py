"""Solve a frictional contact problem given as (W, q, mu), whoever made it.

Three stages in turn, each from the best impulses so far, until the residual is met: Gauss–Seidel
sweeps with the exact solution at each contact and momentum, robust and quick to 1e-4; semismooth
Newton for the last digits; alternating directions where neither gets through. A round that fails
is followed by one of four times the length.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from granufab.errors import InvalidProblem, InvalidSettings
from granufab.kernels.local_law import local_frames, sweep_contacts
from granufab.local_problem import LocalProblem, LocalSolution
from granufab.packing import Array
from granufab.simulate.local_newton import newton_steps
from granufab.simulate.local_residual import ScaledProblem, project_on_cone
from granufab.simulate.local_splitting import splitting_steps

__all__ = ["solve_local"]

FIRST_ROUND = {"sweeps": 400, "newton": 60, "splitting": 200}
LONGER = 4
CHECK = 10
MOMENTUM_CAP, GROWTH, CAUTION = 0.9, 1.02, 1.3


def solve_local(
    W: Any,
    q: Any,
    mu: Any,
    *,
    dimension: int,
    start: Any = None,
    tolerance: float = 1e-10,
    max_iterations: int = 20_000,
) -> LocalSolution:
    """Find r with u = W r + q, 0 ≤ u_N ⟂ r_N ≥ 0, |r_T| ≤ µ r_N and friction opposing u_T.

    W may couple normal and tangent (W_NT ≠ 0) and be rank deficient; impulses are then not
    unique, velocities usually are. A problem that is not solved is no error: see ``converged``.

    Args:
        W: symmetric positive semidefinite [1/kg], sparse or dense, block rows a·d … a·d + d − 1
            of contact a with component 0 normal, shape (d·contact_count, d·contact_count).
        q: relative velocities without impulses [m/s], shape (d·contact_count,).
        mu: friction coefficients [-], shape (contact_count,).
        dimension: d, 2 or 3.
        start: impulses to start from [N s], shape of q; default none.
        tolerance: on ``residual`` of :class:`granufab.local_problem.LocalSolution` [-].
        max_iterations: of all stages together.
    Raises:
        InvalidProblem: the arrays contradict each other, W is not symmetric, or a contact
            without normal mobility closes.
        InvalidSettings: tolerance or max_iterations out of range.
    """
    if not 0 < tolerance < 1:
        raise InvalidSettings(f"tolerance is {tolerance!r}, allowed: between 0 and 1")
    if not isinstance(max_iterations, int | np.integer) or max_iterations < 1:
        raise InvalidSettings(f"max_iterations is {max_iterations!r}, must be an integer ≥ 1")
    problem = LocalProblem(W=W, q=q, mu=mu, dimension=dimension)
    scaled = ScaledProblem.of(problem)
    search = _Search(scaled, _start(problem, scaled, start), tolerance, max_iterations)
    with np.errstate(over="ignore", invalid="ignore"):  # an indefinite W lets iterates grow
        search.run()
    impulse = scaled.full(search.best)
    counts = search.counts
    return LocalSolution(
        impulse=impulse,
        velocity=problem.W @ impulse + problem.q,
        residual=search.residual,
        converged=search.residual <= tolerance,
        method=search.method,
        sweeps=counts["sweeps"],
        newton_steps=counts["newton"],
        splitting_steps=counts["splitting"],
    )


def _start(problem: LocalProblem, scaled: ScaledProblem, start: Any) -> Array:
    """The scaled starting impulses, on their cones."""
    if start is None:
        return np.zeros_like(scaled.q)
    try:
        given = np.array(start, dtype=float)
    except (TypeError, ValueError):
        raise InvalidProblem("start does not consist of numbers") from None
    if given.shape != problem.q.shape or not np.isfinite(given).all():
        raise InvalidProblem(
            f"start has shape {given.shape}, expected {problem.q.shape} finite impulses"
        )
    rows = given.reshape(-1, problem.dimension)[scaled.mobile]
    return project_on_cone(rows / scaled.impulse_unit[:, None], scaled.mu)


class _Search:
    """The rounds of stages, and the best impulses that they met."""

    def __init__(
        self, problem: ScaledProblem, start: Array, tolerance: float, max_iterations: int
    ) -> None:
        self.problem = problem
        self.tolerance = tolerance
        self.left = max_iterations
        self.best = start
        self.residual = problem.residual(start)
        self.method = "start" if start.any() else "none needed"
        self.counts = dict.fromkeys(FIRST_ROUND, 0)

    def run(self) -> None:
        """Stages in turn until the tolerance is met or the iterations are used up."""
        stages = {"sweeps": _Sweeps(self.problem).run}
        stages |= {"newton": newton_steps, "splitting": splitting_steps}
        order = ("sweeps", "newton", "splitting", "newton")
        length = 1
        while self.residual > self.tolerance and self.left > 0:
            for name in order:
                limit = min(self.left, FIRST_ROUND[name] * (1 if name == "newton" else length))
                if self.residual <= self.tolerance or limit == 0:
                    return
                found = stages[name](self.problem, self.best, self.tolerance, limit)
                self._take(name, *found)
            length *= LONGER

    def _take(self, name: str, impulse: Array, residual: float, steps: int) -> None:
        self.counts[name] += steps
        self.left -= max(steps, 1)
        if residual < self.residual:
            self.best, self.residual, self.method = impulse, residual, name


class _Sweeps:
    """Gauss–Seidel with momentum, restarted where the step norm grows (see ``kernels.solve``)."""

    def __init__(self, problem: ScaledProblem) -> None:
        W = problem.W
        starts, columns, blocks = W.indptr, W.indices, W.data
        rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        own = np.ascontiguousarray(blocks[rows == columns])
        frames = local_frames(own, problem.q.shape[1])
        self.arrays = (starts, columns, blocks, frames, problem.q, problem.mu)

    def run(
        self, problem: ScaledProblem, impulse: Array, tolerance: float, limit: int
    ) -> tuple[Array, float, int]:
        """Sweep until the residual is met or the limit is reached; see :func:`newton_steps`."""
        now, before = impulse.copy(), impulse.copy()
        best, lowest = impulse, problem.residual(impulse)
        cap, age, last = MOMENTUM_CAP, 0, np.inf
        for sweep in range(1, limit + 1):
            moved = np.sqrt(sweep_contacts(*self.arrays, now))
            if sweep % CHECK == 0 or sweep == limit or moved == 0.0:
                residual = problem.residual(now)
                if residual < lowest:
                    best, lowest = now.copy(), residual
                if lowest <= tolerance or moved == 0.0 or not np.isfinite(residual):
                    return best, lowest, sweep
            if moved > GROWTH * last:
                age, cap = 0, max(0.0, 1 - CAUTION * (1 - cap))
            last = moved
            change = now - before
            before = now.copy()
            now += min(age / (age + 3), cap) * change
            age += 1
        return best, lowest, limit
