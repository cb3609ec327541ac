"""The memory of a run's steps: allocated here, then used step after step."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

from granufab.kernels.problem import Problem, State
from granufab.kernels.step_arrays import (
    ASSEMBLY,
    CLOCKS,
    CONTROL,
    COUNT,
    GEOMETRY,
    ITERATION,
    PIECES,
    REST,
    ROWS,
    STRAIN_COLUMN,
    TENSORS,
    Bodies,
    Box,
    Notes,
)
from granufab.packing import Array
from granufab.simulate.bodies import aligned

__all__ = ["ProblemLaw", "StageClock", "StepMemory"]

STAGES = {"geometry": GEOMETRY, "assembly": ASSEMBLY, "sweeps": ITERATION, "rest": REST}


class ProblemLaw(NamedTuple):
    """Last fields of a :class:`Problem`, in their order."""

    softness: float
    spin_factor: float
    coupled: bool
    dilation_weight: float
    weight: Array


class StepMemory:
    """Arrays of the steps.

    Args:
        motion: body records of grains, walls and the spare body; shared.
        position, radius: of the grains [m]; shared.
        chunk_count, members: of the solver.
    """

    def __init__(
        self, motion: Array, position: Array, radius: Array, *, chunk_count: int, members: int
    ) -> None:
        dimension = self.dimension = position.shape[1]
        self.motion, self.position, self.radius = motion, position, radius
        self.free, self.start = aligned(motion.shape), aligned(motion.shape)
        self.free[:] = motion
        self.walked = np.zeros_like(position)
        self.tensors = np.zeros((TENSORS, dimension, dimension))
        self.origin, self.gravity = np.zeros(dimension), np.zeros(dimension)
        self.free_rate = np.zeros((dimension, dimension))
        self.notes = Notes(
            control=np.zeros(CONTROL),
            partial=np.zeros((PIECES, 16)),
            own=np.zeros((members, 2, dimension, dimension)),
            pushes=np.zeros((chunk_count + 1, dimension, dimension)),
            rows=np.zeros((ROWS, STRAIN_COLUMN + 2 * dimension**2)),
            clock=np.zeros(CLOCKS, np.int64),
            stamp=np.zeros(2, np.int64),
        )
        self.reserve(0)

    def reserve(self, count: int) -> None:
        """Room for ``count`` contacts; what was there is lost where it grows."""
        dimension, tangents = self.dimension, 1 if self.dimension == 2 else 3
        if count and count <= len(self._lines[0]):
            return
        room = count * 5 // 4
        self._bodies = np.zeros(room, np.int32), np.zeros(room, np.int32)
        self._normal = np.zeros((room, dimension))
        self._lines = [np.zeros(room) for _ in range(4)]  # length, offset_n, µ, impulse_n
        self._planes = [np.zeros((room, tangents)) for _ in range(2)]  # offset_t, impulse_t

    @property
    def contact_count(self) -> int:
        """Contacts of the last solve."""
        return int(self.notes.control[COUNT])

    def bodies(self) -> Bodies:
        """Grains and body records, for kernels."""
        return Bodies(
            self.position, self.radius, self.motion, self.motion.view(np.int64),
            self.position.view(np.int64), self.radius.view(np.int64),
            self.free, self.start, self.walked,
        )  # fmt: skip

    def box(self) -> Box:
        """The cell, for kernels."""
        return Box(self.tensors, self.tensors.view(np.int64), self.origin, self.gravity)

    def problem(self, law: ProblemLaw, count: int | None = None) -> Problem:
        """The contact problem: its first ``count`` contacts, or all there is room for."""
        (first, second), (length, offset_n, mu, _) = self._bodies, self._lines
        return Problem(
            first[:count], second[:count], self._normal[:count], length[:count],
            offset_n[:count], self._planes[0][:count], mu[:count], *law,
        )  # fmt: skip

    def state(self, count: int | None = None) -> State:
        """What a solve changes."""
        impulse_n, impulse_t = self._lines[3], self._planes[1]
        return State(self.motion, self.free_rate, impulse_n[:count], impulse_t[:count])


class StageClock:
    """Seconds by stage, read by the kernels themselves."""

    def __init__(self) -> None:
        self.seconds = {"search": 0.0, **dict.fromkeys(STAGES, 0.0)}

    def add(self, clock: Any, since: float) -> None:
        """Add what a call noted since ``since``; what it did not is overhead, in ``rest``."""
        whole = time.perf_counter() - since
        for name, place in STAGES.items():
            spent = 1e-9 * float(clock[place])
            self.seconds[name] += spent
            whole -= spent
            clock[place] = 0
        self.seconds["rest"] += whole
