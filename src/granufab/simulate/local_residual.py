"""A problem (W, q, mu) made dimensionless, and how far impulses are from solving it.

Impulses of contact a are measured in max|q|/w_a, its velocities in max|q|·(its own scale), with
w_a the mean diagonal of its block of W; so every block of the scaled W has mean diagonal 1. One
factor per contact leaves Coulomb's cone as it is.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from granufab.errors import InvalidProblem
from granufab.local_problem import LocalProblem
from granufab.packing import Array

__all__ = ["ScaledProblem", "local_errors", "natural_map", "project_on_cone"]

LARGEST = 1e100


class ScaledProblem(NamedTuple):
    """The dimensionless problem of the contacts that can be moved.

    Attributes:
        W: scaled matrix in blocks of d × d.
        q: scaled velocities, shape (contact_count, d).
        mu: friction coefficients, shape (contact_count,).
        mobile: which contacts of the given problem these are, shape (all_contacts,).
        impulse_unit: impulse = impulse_unit · scaled impulse [N s], shape (contact_count,).
        weight: velocity/max|q| of a scaled velocity of 1, shape (contact_count,).
    """

    W: scipy.sparse.bsr_array
    q: Array
    mu: Array
    mobile: NDArray[np.bool_]
    impulse_unit: Array
    weight: Array

    @classmethod
    def of(cls, problem: LocalProblem) -> Self:
        """Scale a problem; contacts without normal mobility are left out.

        Raises:
            InvalidProblem: a contact closes and has no normal mobility, or numbers are so large
                or small that other units are needed.
        """
        d = problem.dimension
        _check_range("W", problem.W.data)
        _check_range("q", problem.q)
        _check_range("mu", np.append(problem.mu, 1.0))
        diagonal = problem.W.diagonal().reshape(-1, d)
        q = problem.q.reshape(-1, d)
        mobile = diagonal[:, 0] > 1e-14 * diagonal.max(axis=1)
        mobile &= diagonal[:, 0] > 1e-20 * diagonal.max(initial=0.0)
        stuck = ~mobile & (q[:, 0] < 0)
        if stuck.any():
            where = int(np.flatnonzero(stuck)[0])
            raise InvalidProblem(
                f"contact {where} closes at q_N = {q[where, 0]:.6g}, but its W_NN is "
                f"{diagonal[where, 0]:.3g}: no impulse can stop it; leave out contacts between "
                "bodies that cannot move"
            )
        root = 1 / np.sqrt(diagonal[mobile].mean(axis=1))
        largest = float(np.abs(problem.q).max(initial=0.0)) or 1.0
        rows = np.repeat(mobile, d)
        scale = scipy.sparse.diags_array(np.repeat(root, d))
        W = scale @ problem.W[rows][:, rows] @ scale
        W = scipy.sparse.csr_array((W + W.T) / 2)
        level = float(np.linalg.norm(q[mobile] * root[:, None] / largest)) or 1.0
        return cls(
            W=scipy.sparse.bsr_array(W, blocksize=(d, d)),
            q=q[mobile] * root[:, None] / (largest * level),
            mu=problem.mu[mobile],
            mobile=mobile,
            impulse_unit=root * largest * level,
            weight=level / root,
        )

    def velocity(self, impulse: Array) -> Array:
        """Scaled u = W r + q, shape (contact_count, d)."""
        return (self.W @ impulse.ravel()).reshape(impulse.shape) + self.q

    def residual(self, impulse: Array) -> float:
        """``residual`` of :class:`granufab.local_problem.LocalSolution` [-]."""
        gap = natural_map(impulse, self.velocity(impulse), self.mu)
        return float((np.linalg.norm(gap, axis=1) * self.weight).max(initial=0.0))

    def full(self, impulse: Array) -> Array:
        """Impulses of the given problem [N s], shape (d·all_contacts,)."""
        result = np.zeros((len(self.mobile), impulse.shape[1]))
        result[self.mobile] = impulse * self.impulse_unit[:, None]
        return result.ravel()


def _check_range(name: str, values: Array) -> None:
    largest = float(np.abs(values).max(initial=0.0))
    if largest and not 1 / LARGEST < largest < LARGEST:
        raise InvalidProblem(
            f"the largest entry of {name} is {largest:.3g}, allowed: {1 / LARGEST:.0e} to "
            f"{LARGEST:.0e}; choose other units"
        )


def project_on_cone(vector: Array, mu: Array) -> Array:
    """Nearest points of Coulomb's cones |t| ≤ µ n, shape (contact_count, d)."""
    n, size = vector[:, 0], np.linalg.norm(vector[:, 1:], axis=1)
    polar = mu * size <= -n
    inside = ~polar & (size <= mu * n)
    new = np.where(polar, 0.0, (n + mu * size) / (1 + mu**2))
    share = np.divide(mu * new, size, out=np.zeros_like(size), where=size > 0)
    moved = np.column_stack([new, vector[:, 1:] * share[:, None]])
    return np.where(inside[:, None], vector, moved)


def natural_map(impulse: Array, velocity: Array, mu: Array) -> Array:
    """r − proj_K(r − (u + µ|u_T| n)), shape (contact_count, d); zero exactly at solutions.

    De Saxcé's form of the contact law, with ρ = 1: give scaled impulses and velocities.
    """
    modified = velocity.copy()
    modified[:, 0] += mu * np.linalg.norm(velocity[:, 1:], axis=1)
    return impulse - project_on_cone(impulse - modified, mu)


def local_errors(problem: LocalProblem, impulse: Array) -> dict[str, float]:
    """How far impulses are from solving a problem, in several figures [-].

    Velocities are divided by max|q|, impulses by max|r|, powers by their product.

    Args:
        problem: the problem.
        impulse: r [N s], from any solver, shape (d·contact_count,).
    Returns:
        ``natural_map`` (the ``residual`` of :class:`granufab.local_problem.LocalSolution`),
        ``penetration`` max(−u_N), ``tension`` max(−r_N), ``complementarity`` max|u_N r_N|, ``cone``
        max(|r_T| − µ r_N), ``dissipation`` max|µ r_N |u_T| + r_T·u_T|; 0 where none.
    Raises:
        InvalidProblem: the impulses do not fit the problem.
    """
    impulse = np.asarray(impulse, dtype=float)
    if impulse.shape != problem.q.shape:
        raise InvalidProblem(f"impulse has shape {impulse.shape}, expected {problem.q.shape}")
    if not np.isfinite(impulse).all():
        raise InvalidProblem("impulse has entries that are not finite")
    d, mu = problem.dimension, problem.mu
    r, u = impulse.reshape(-1, d), (problem.W @ impulse + problem.q).reshape(-1, d)
    speed = float(np.abs(problem.q).max(initial=0.0)) or 1.0
    push = float(np.abs(impulse).max(initial=0.0)) or 1.0
    slip, shear = np.linalg.norm(u[:, 1:], axis=1), np.linalg.norm(r[:, 1:], axis=1)
    mobility = problem.W.diagonal().reshape(-1, d).mean(axis=1)
    root = np.sqrt(np.where(mobility > 0, mobility, 1.0))[:, None]
    # with r·√w and u/√w the map has ρ = 1/w; its length /ρ is a velocity
    gap = np.linalg.norm(natural_map(r * root, u / root, mu) * root, axis=1).max(initial=0.0)
    lost = mu * np.maximum(r[:, 0], 0) * slip + (r[:, 1:] * u[:, 1:]).sum(axis=1)
    return {
        "natural_map": float(gap) / speed,
        "penetration": float((-u[:, 0]).max(initial=0.0)) / speed,
        "tension": float((-r[:, 0]).max(initial=0.0)) / push,
        "complementarity": float(np.abs(u[:, 0] * r[:, 0]).max(initial=0.0)) / (speed * push),
        "cone": float((shear - mu * r[:, 0]).max(initial=0.0)) / push,
        "dissipation": float(np.abs(lost).max(initial=0.0)) / (speed * push),
    }
