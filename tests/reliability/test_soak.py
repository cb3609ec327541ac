"""A hundred thousand steps at rest: nothing sinks, no memory is lost."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from granufab.packing import Cell, Grains, Packing
from granufab.simulate import Loading, Material, Simulation, Solver

STATUS = Path("/proc/self/statm")
STEPS, WARM = 100_000, 5_000
RADIUS = 0.5


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


def _packing(position: np.ndarray, cell: Cell) -> Packing:
    count = len(position)
    grains = Grains(
        position=position,
        radius=np.full(count, RADIUS),
        mass=np.ones(count),
        velocity=np.zeros((count, 2)),
        spin=np.zeros((count, 1)),
    )
    return Packing(grains=grains, cell=cell)


def _column(count: int = 10) -> Packing:
    """Grains exactly on top of each other between far walls."""
    position = np.stack([np.full(count, 5.0), RADIUS + 2 * RADIUS * np.arange(count)], axis=1)
    return _packing(position, Cell(matrix=np.diag([10.0, 20.0]), periodic=(True, False)))


def _box(side: int = 6) -> Packing:
    """A dense triangular stack of grains between side walls, on a floor."""
    rows = []
    for row in range(side):
        shift = RADIUS * (row % 2)
        x = RADIUS + shift + 2 * RADIUS * np.arange(side - row % 2)
        rows.append(np.stack([x, np.full(len(x), RADIUS + math.sqrt(3) * RADIUS * row)], axis=1))
    cell = Cell(matrix=np.diag([2 * RADIUS * side, 3.0 * side]), periodic=(False, False))
    return _packing(np.concatenate(rows), cell)


def _overlap(simulation: Simulation) -> float:
    simulation.measure_gaps()
    return max(0.0, -float(simulation.candidates.gap.min()))


def _memory() -> int:
    gc.collect()
    return int(STATUS.read_text().split()[1])


def _soaked(packing: Packing, stiffness: float, steps: int) -> tuple[float, float, float]:
    """Overlap after the warm-up and largest one after it [R], and growth of memory."""
    simulation = Simulation(
        packing,
        _still(),
        material=Material(friction=0.3, wall_friction=0.3),
        solver=Solver(stiffness=stiffness, tolerance=1e-8),
        gravity=np.array([0.0, -1.0]),
        step=0.01,
    )
    made = 0
    while made < WARM:
        made += len(simulation.advance(WARM - made))
    before, began, worst, made = _overlap(simulation), _memory(), 0.0, 0
    while made < steps:
        made += len(simulation.advance(min(1000, steps - made)))
        worst = max(worst, _overlap(simulation))
    assert simulation.kinetic_ratio() < 1e-10
    return before / RADIUS, worst / RADIUS, _memory() / began - 1


@pytest.mark.slow
@pytest.mark.skipif(not STATUS.exists(), reason="memory is read from /proc")
@pytest.mark.parametrize("stiffness", [math.inf, 1.6e5])
@pytest.mark.parametrize("make", [_column, _box])
def test_a_resting_stack_neither_sinks_nor_loses_memory(
    make, stiffness: float, tell: Callable[..., None]
) -> None:
    began = time.perf_counter()
    before, worst, growth = _soaked(make(), stiffness, STEPS)
    spent = time.perf_counter() - began
    rigid, name = math.isinf(stiffness), make.__name__[1:]
    tell(make=name, rigid=rigid, before=before, worst=worst, memory=growth, seconds=spent)
    assert worst - before <= 1e-6
    assert growth <= 0.01
