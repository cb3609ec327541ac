"""A frictional contact problem in local form, (W, q, mu), and its solution.

The unknowns live at the contacts alone: u = W r + q, with Signorini's condition and Coulomb's
cone at each. ``simulate`` solves and makes such problems, ``io`` reads and writes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidProblem
from granufab.packing import Array

__all__ = ["LocalProblem", "LocalSolution", "LocalState"]

ASYMMETRY = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalProblem:
    """Find r with u = W r + q, 0 ≤ u_N ⟂ r_N ≥ 0, |r_T| ≤ µ r_N, friction opposing u_T.

    Contact a has the block of rows a·d … a·d + d − 1, component 0 normal. What is not a problem
    is refused with :class:`granufab.errors.InvalidProblem`.

    Attributes:
        W: Delassus matrix, symmetric positive semidefinite [1/kg]; given sparse or dense, kept as
            a CSR array of shape (d·contact_count, d·contact_count).
        q: relative velocities without impulses, bounce and gaps included [m/s],
            shape (d·contact_count,).
        mu: friction coefficients [-], shape (contact_count,).
        dimension: d, 2 or 3.
        title, description: in words, for files.
    """

    W: scipy.sparse.csr_array
    q: Array
    mu: Array
    dimension: int
    title: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise InvalidProblem(f"dimension is {self.dimension!r}, allowed: 2 or 3")
        mu = _frozen(self.mu, "mu")
        size = self.dimension * len(mu)
        q = _frozen(self.q, "q")
        if len(q) != size:
            raise InvalidProblem(
                f"q has {len(q)} entries, expected {size}: {self.dimension} for each of the "
                f"{len(mu)} values of mu"
            )
        if (mu < 0).any():
            where = int(np.argmin(mu))
            raise InvalidProblem(f"mu of contact {where} is {mu[where]:.6g}, must be >= 0")
        put = object.__setattr__
        put(self, "dimension", int(self.dimension))
        put(self, "mu", mu)
        put(self, "q", q)
        put(self, "W", _matrix(self.W, size))

    @property
    def contact_count(self) -> int:
        """Number of contacts."""
        return len(self.mu)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalState:
    """Impulses and velocities at the contacts, as a file stores them.

    Attributes:
        impulse: r [N s], shape (d·contact_count,).
        velocity: u [m/s], shape (d·contact_count,).
    """

    impulse: Array
    velocity: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "impulse", _frozen(self.impulse, "impulse"))
        object.__setattr__(self, "velocity", _frozen(self.velocity, "velocity"))
        if len(self.impulse) != len(self.velocity):
            raise InvalidProblem(
                f"impulse has {len(self.impulse)} entries, velocity {len(self.velocity)}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalSolution(LocalState):
    """What :func:`granufab.simulate.solve_local` found, and how.

    Attributes:
        residual: max over contacts of |r − proj_K(r − ρ(u + µ|u_T| n))|/ρ / max|q| [-], with
            1/ρ the mean diagonal of the contact's block of W.
        converged: whether the residual met the tolerance.
        method: stage that found the impulses: "none needed", "start", "sweeps", "newton" or
            "splitting".
        sweeps, newton_steps, splitting_steps: iterations made in each stage.
    """

    residual: float
    converged: bool
    method: str
    sweeps: int
    newton_steps: int
    splitting_steps: int

    @property
    def iterations(self) -> int:
        """Iterations of all stages together."""
        return self.sweeps + self.newton_steps + self.splitting_steps


def _frozen(value: Any, name: str) -> Array:
    try:
        array = np.array(value, dtype=np.float64, order="C", copy=True)
    except (TypeError, ValueError):
        raise InvalidProblem(f"{name} is not an array of numbers") from None
    if array.ndim != 1:
        raise InvalidProblem(f"{name} has shape {array.shape}, expected one axis")
    if not np.isfinite(array).all():
        where = int(np.flatnonzero(~np.isfinite(array))[0])
        raise InvalidProblem(f"{name}[{where}] is {array[where]}, must be finite")
    array.flags.writeable = False
    return array


def _matrix(value: Any, size: int) -> scipy.sparse.csr_array:
    """W as canonical read-only CSR."""
    try:
        W: Any = scipy.sparse.csr_array(value, dtype=np.float64, copy=True)
    except (TypeError, ValueError):
        raise InvalidProblem("W is not a matrix of numbers, sparse or dense") from None
    if W.shape != (size, size):
        raise InvalidProblem(f"W has shape {W.shape}, expected {(size, size)} as q has {size}")
    W.sum_duplicates()
    if not np.isfinite(W.data).all():
        raise InvalidProblem("W has entries that are not finite")
    largest = float(np.abs(W.data).max(initial=0.0))
    difference = W - W.T
    if np.abs(difference.data).max(initial=0.0) > ASYMMETRY * largest:
        k = int(np.argmax(np.abs(difference.data)))
        row = int(np.searchsorted(difference.indptr, k, side="right")) - 1
        column = int(difference.indices[k])
        raise InvalidProblem(
            f"W is not symmetric: entries ({row}, {column}) and ({column}, {row}) differ by "
            f"{abs(difference.data[k]):.3g}; a file that holds one triangle must be completed"
        )
    diagonal = W.diagonal()
    if (diagonal < -ASYMMETRY * largest).any():
        where = int(np.argmin(diagonal))
        raise InvalidProblem(
            f"W[{where}, {where}] is {diagonal[where]:.6g}, but W must be positive semidefinite"
        )
    for part in (W.data, W.indices, W.indptr):
        part.flags.writeable = False
    return W
