"""A few steps of tiny systems; run as a program it prints them, compiled or not."""

from __future__ import annotations

import json
import math

import numpy as np

from granufab.packing import Cell, Grains, Packing
from granufab.simulate import Biaxial, ConstantMean, Loading, Material, Simulation, Solver


def results() -> dict[str, list[float]]:
    """Velocities, stress, residual and sweeps of each system."""
    return {
        "pyramid": _pyramid(),
        "biaxial": _pressed(2, Biaxial(axial_rate=0.1)),
        "bounce": _bounce(),
        "spheres": _pressed(3, ConstantMean(rate=0.1, dimension=3)),
    }


def _packing(position: list, cell: Cell, speed: float = 0.0) -> Packing:
    count, dimension = np.shape(position)
    wave = np.sin(np.arange(count * dimension)).reshape(count, dimension)
    return Packing(
        grains=Grains(
            position=np.array(position),
            radius=np.full(count, 0.5),
            mass=np.linspace(1.0, 1.3, count),
            velocity=speed * wave,
            spin=np.zeros((count, 1 if dimension == 2 else 3)),
        ),
        cell=cell,
    )


def _still() -> Loading:
    zero = np.zeros((2, 2))
    return Loading(
        rate=zero,
        free=zero.astype(bool),
        dilation=False,
        stress=zero,
        direction=np.array([0.0, 1.0]),
        extension=np.array([1.0, 0.0]),
    )


def _floor() -> Cell:
    return Cell(matrix=np.diag([10.0, 10.0]), periodic=(True, False))


def _pyramid() -> list[float]:
    stack = [[4.5, 0.5], [5.5, 0.5], [5.0, 0.5 + math.sqrt(0.75)]]
    simulation = Simulation(
        _packing(stack, _floor()),
        _still(),
        material=Material(friction=0.2, wall_friction=0.05),
        solver=Solver(stiffness=math.inf, tolerance=1e-9),
        gravity=np.array([0.0, -1.0]),
        step=0.01,
    )
    return _steps(simulation)


def _bounce() -> list[float]:
    simulation = Simulation(
        _packing([[5.0, 0.52], [5.1, 1.515]], _floor()),
        _still(),
        material=Material(friction=0.3, wall_friction=0.3, restitution=0.5),
        solver=Solver(tolerance=1e-9),
        gravity=np.array([0.1, -3.0]),
        step=0.02,
    )
    return _steps(simulation, 8)


def _pressed(dimension: int, loading: Loading) -> list[float]:
    steps = np.stack(np.meshgrid(*[np.arange(2)] * dimension), axis=-1).reshape(-1, dimension)
    position = steps * 1.02 + 0.05 * np.cos(np.arange(steps.size)).reshape(steps.shape)
    simulation = Simulation(
        _packing(position.tolist(), Cell(matrix=np.eye(dimension) * 2.04), speed=0.05),
        loading,
        material=Material(friction=0.4),
        solver=Solver(tolerance=1e-6, max_sweeps=60),
    )
    return _steps(simulation)


def _steps(simulation: Simulation, count: int = 3) -> list[float]:
    reports = [simulation.step() for _ in range(count)]
    numbers = [simulation.motion.ravel(), simulation.stress.ravel(), simulation.rate.ravel()]
    numbers.append(np.array([[r.residual, r.sweeps, r.contacts] for r in reports]).ravel())
    return np.concatenate(numbers).tolist()


if __name__ == "__main__":
    print(json.dumps(results()))
