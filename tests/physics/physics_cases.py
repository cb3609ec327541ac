"""Small systems with known motion, shared by the physics tests."""

from __future__ import annotations

import math

import numpy as np

from granufab.packing import Cell, Grains, Packing
from granufab.simulate import Loading, Solver

RIGID = Solver(stiffness=math.inf, tolerance=1e-13, max_sweeps=200_000)


def grains(position, *, radius=0.5, mass=1.0, velocity=None, spin=None) -> Grains:
    """Grains with masses; velocity and spin default to rest."""
    position = np.atleast_2d(np.array(position, dtype=float))
    count, dimension = position.shape
    spins = 1 if dimension == 2 else 3
    return Grains(
        position=position,
        radius=np.broadcast_to(np.asarray(radius, dtype=float), (count,)),
        mass=np.broadcast_to(np.asarray(mass, dtype=float), (count,)),
        velocity=np.zeros((count, dimension)) if velocity is None else np.atleast_2d(velocity),
        spin=np.zeros((count, spins)) if spin is None else np.atleast_2d(spin),
    )


def on_floor(made: Grains, *, width: float = 100.0, height: float = 1000.0) -> Packing:
    """Grains above a floor at height 0 (last axis); periodic sideways, a far lid on top."""
    dimension = made.dimension
    edges = np.full(dimension, width)
    edges[-1] = height
    return Packing(
        grains=made, cell=Cell(matrix=np.diag(edges), periodic=(True,) * (dimension - 1) + (False,))
    )


def in_open_space(made: Grains, *, width: float = 100.0) -> Packing:
    """Grains in a periodic cell so wide that its images never meet."""
    return Packing(grains=made, cell=Cell(matrix=np.eye(made.dimension) * width))


def fixed_cell(dimension: int = 2) -> Loading:
    """A cell that neither moves nor is driven."""
    zero = np.zeros((dimension, dimension))
    axes = np.eye(dimension)
    return Loading(
        rate=zero,
        free=zero.astype(bool),
        dilation=False,
        stress=zero,
        direction=axes[1],
        extension=axes[0],
    )


def downhill(slope: float, g: float = 1.0, dimension: int = 2) -> np.ndarray:
    """Gravity seen from a plane inclined by ``slope`` [rad]; downhill is +x."""
    gravity = np.zeros(dimension)
    gravity[0], gravity[-1] = g * math.sin(slope), -g * math.cos(slope)
    return gravity


def velocity(simulation) -> np.ndarray:
    """Grain velocities (fluctuations) now, shape (grain_count, D)."""
    return simulation.motion[: simulation.grain_count, : simulation.dimension].copy()


def spin(simulation) -> np.ndarray:
    """Grain spins ω now, shape (grain_count, 1 or 3)."""
    dimension = simulation.dimension
    columns = slice(dimension, dimension + (1 if dimension == 2 else 3))
    return simulation.motion[: simulation.grain_count, columns] / simulation.radius[:, None]


def impulses(simulation) -> dict[tuple[int, int], np.ndarray]:
    """Impulse on the second body of every contact of the last solve, in global axes [N s]."""
    problem, state = simulation.problem, simulation.state
    push = impulse_vectors(problem, state)
    return {
        (int(i), int(j)): p for i, j, p in zip(problem.first, problem.second, push, strict=True)
    }


def impulse_vectors(problem, state) -> np.ndarray:
    """P = P_n n + P_t in global axes, shape (contact_count, D) [N s]."""
    n = problem.normal
    if n.shape[1] == 2:
        tangent = np.column_stack([-n[:, 1], n[:, 0]])
        return state.impulse_n[:, None] * n + state.impulse_t * tangent
    return state.impulse_n[:, None] * n + state.impulse_t


def floor(simulation) -> int:
    """Body number of the floor: the lower wall of the last axis."""
    return simulation.grain_count + 2 * (simulation.dimension - 1)
