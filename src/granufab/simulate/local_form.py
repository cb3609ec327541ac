"""One step of a simulation as a problem (W, q, mu) that any solver of frictional contact can read.

With v the velocities of grains and of the free cell components, M⁻¹ their inverse masses and B the
map to the contacts, u = B v + b + ε P and v = v_free + M⁻¹ Bᵀ P give W = B M⁻¹ Bᵀ + ε and
q = B v_free + b. Free cell components touch all contacts, so W is then dense.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidProblem
from granufab.kernels.problem import Problem, State
from granufab.local_problem import LocalProblem, LocalState
from granufab.packing import Array, IntArray

__all__ = ["contact_frames", "local_form", "local_state"]

LARGEST_DENSE = 20_000


def local_form(problem: Problem, state: State, *, title: str = "") -> LocalProblem:
    """The contact problem of one step in FCLIB's form.

    Args:
        problem: ``Simulation.problem``, of the last step.
        state: ``Simulation.state``, that step's solution; only its free velocities enter.
        title: for files.
    Returns:
        Rows n, t of every contact in 2D, n, t_1, t_2 in 3D (:func:`contact_frames`); gap, bounce,
        imposed flow and the implicit spring included.
    Raises:
        InvalidProblem: a free cell makes W dense and it is too large for memory.
    """
    dimension = problem.normal.shape[1]
    size = dimension * len(problem.length)
    parts = _maps(problem, state)
    if parts[1].weight.any() and size > LARGEST_DENSE:
        raise InvalidProblem(
            f"the free cell makes W dense with {size} rows, at most {LARGEST_DENSE} are made; "
            "take a smaller sample or a fixed cell"
        )
    impulse = _rows(problem, state.impulse_n, state.impulse_t)
    W: Any = scipy.sparse.csr_array((size, size))
    q = _rows(problem, problem.offset_n, problem.offset_t)
    for part in parts:
        W = W + part.B @ scipy.sparse.diags_array(part.weight) @ part.B.T
        q += part.B @ (part.velocity - part.weight * (part.B.T @ impulse))
    spring = problem.softness * scipy.sparse.eye_array(size)
    W = scipy.sparse.csr_array(W + spring)
    return LocalProblem(
        W=(W + W.T) / 2,
        q=q,
        mu=problem.mu,
        dimension=dimension,
        title=title,
        description="one step of a Contact Dynamics simulation with granufab",
    )


def local_state(problem: Problem, state: State) -> LocalState:
    """The engine's own solution of a step, in the frames of :func:`local_form`.

    Args:
        problem: the step as the engine poses it.
        state: what it ended with.
    """
    impulse = _rows(problem, state.impulse_n, state.impulse_t)
    velocity = _rows(problem, problem.offset_n, problem.offset_t) + problem.softness * impulse
    for part in _maps(problem, state):
        velocity += part.B @ part.velocity
    return LocalState(impulse=impulse, velocity=velocity)


def contact_frames(normal: Array) -> Array:
    """Right-handed frames (n, t) or (n, t_1, t_2) as rows, shape (contact_count, D, D) [-].

    In 2D t = (−n_y, n_x). In 3D t_1 is perpendicular to n and to the axis that n leans on least.

    Args:
        normal: unit vectors, shape (contact_count, D).
    """
    if normal.shape[1] == 2:
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        return np.stack([normal, tangent], axis=1)
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first: Array = np.cross(normal, axis)
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    second: Array = np.cross(normal, first)
    return np.stack([normal, first, second], axis=1)


class _Map(NamedTuple):
    """B, inverse masses and present velocities of one kind of bodies."""

    B: scipy.sparse.csr_array
    weight: Array
    velocity: Array


def _maps(problem: Problem, state: State) -> tuple[_Map, _Map]:
    """Grains and walls with (v, s = R ω) each, and the free cell rates."""
    frames = contact_frames(problem.normal)
    return _grains(problem, state.motion, frames), _cell(problem, state.rate, frames)


def _grains(problem: Problem, motion: Array, frames: Array) -> _Map:
    count, dimension = problem.normal.shape
    spins = 1 if dimension == 2 else 3
    width = dimension + spins
    if dimension == 2:  # n × n = 0 and n × t = 1
        arm = np.broadcast_to([[[0.0], [1.0]]], (count, 2, 1))
    else:
        arm = np.cross(problem.normal[:, None, :], frames)
    first = np.concatenate([-frames, -arm], axis=2)
    second = np.concatenate([frames, -arm], axis=2)
    bodies = np.stack([problem.first, problem.second], axis=1).astype(np.int64)
    columns = bodies[:, None, :, None] * width + np.arange(width)
    entries = np.stack([first, second], axis=2)
    columns = np.broadcast_to(columns, entries.shape)
    rows = np.arange(count * dimension).reshape(count, dimension, 1, 1)
    inverse = motion[:, width]
    weight = np.repeat(inverse[:, None], width, axis=1)
    weight[:, dimension:] *= problem.spin_factor
    return _Map(
        B=_sparse(entries, np.broadcast_to(rows, entries.shape), columns, weight.size),
        weight=weight.ravel(),
        velocity=motion[:, :width].ravel(),
    )


def _cell(problem: Problem, rate: Array, frames: Array) -> _Map:
    """All components of L where some are free alone, else the dilation."""
    count, dimension = problem.normal.shape
    branch = problem.length[:, None] * problem.normal
    if problem.coupled:
        entries = (frames[:, :, :, None] * branch[:, None, None, :]).reshape(
            count, dimension, dimension**2
        )
        weight, velocity = problem.weight.ravel(), rate.ravel()
    else:
        entries = np.zeros((count, dimension, 1))
        entries[:, 0, 0] = problem.length
        weight, velocity = np.array([problem.dilation_weight]), rate[0, :1]
    index = np.indices((count * dimension, entries.shape[2]))
    return _Map(
        B=_sparse(entries, index[0], index[1], entries.shape[2]),
        weight=weight,
        velocity=velocity,
    )


def _sparse(
    entries: Array, rows: IntArray, columns: IntArray, width: int
) -> scipy.sparse.csr_array:
    size = entries.shape[0] * entries.shape[1]
    made = scipy.sparse.coo_array(
        (entries.ravel(), (rows.ravel(), columns.ravel())), shape=(size, width)
    )
    return scipy.sparse.csr_array(made)


def _rows(problem: Problem, normal: Array, tangent: Array) -> Array:
    """Normal and tangential parts as rows in the frames, shape (D·contact_count,)."""
    count, dimension = problem.normal.shape
    result = np.empty((count, dimension))
    result[:, 0] = normal
    if dimension == 2:
        result[:, 1] = tangent[:, 0]
    else:
        frames = contact_frames(problem.normal)
        result[:, 1:] = np.einsum("cij,cj->ci", frames[:, 1:], tangent)
    return result.ravel()
