"""Solves the contact problem of a step: packs it, sweeps with several threads, unpacks it.

The grains lie in chunks, a number that depends on the sample alone; threads share the chunks, so
the result has the same bits for any number of threads.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from llvmlite import binding
from numba.core import config

from granufab.errors import InvalidSettings
from granufab.kernels.lanes import WIDTH
from granufab.kernels.neighbours import morton_order
from granufab.kernels.problem import Problem, State
from granufab.kernels.slots import Slots, fields, pack, schedule, unpack
from granufab.kernels.solve import CONTROLS, SUMS, Work, solve
from granufab.kernels.sweep import Law
from granufab.kernels.team import COUNTERS
from granufab.packing import Array, IntArray
from granufab.simulate.bodies import aligned

__all__ = ["ContactSolver", "Solution", "thread_count", "wide_by_default"]

CHUNK_GRAINS, MOST_CHUNKS = 3000, 64


class Solution(NamedTuple):
    """How a solve ended: sweeps, residual, its largest single share, worst −ũ_n [m/s]."""

    sweeps: int
    residual: float
    residual_contact: float
    violation: float


def thread_count() -> int:
    """Threads of a run: GRANUFAB_THREADS, else the processors this process may use.

    Raises:
        InvalidSettings: GRANUFAB_THREADS is not a positive integer.
    """
    given = os.environ.get("GRANUFAB_THREADS")
    if given is None:
        usable = getattr(os, "sched_getaffinity", None)
        return len(usable(0)) if usable else os.cpu_count() or 1
    if not given.isdigit() or int(given) < 1:
        raise InvalidSettings(f"GRANUFAB_THREADS is {given!r}, must be an integer ≥ 1")
    return int(given)


def wide_by_default() -> bool:
    """Whether eight contacts are updated at once: where the processor has vectors of four doubles.

    GRANUFAB_LANES=0 switches it off.
    """
    if config.DISABLE_JIT or os.environ.get("GRANUFAB_LANES") == "0":
        return False
    return bool(binding.get_host_cpu_features().get("avx2"))


class ContactSolver:
    """Workspace of the solves of a run.

    Args:
        grain_count: grains; bodies beyond are walls and the spare one.
        dimension: 2 or 3.
        threads: most threads to use; default :func:`thread_count`.
        wide: update eight contacts at once; default :func:`wide_by_default`.
    """

    def __init__(
        self,
        grain_count: int,
        dimension: int,
        *,
        threads: int | None = None,
        wide: bool | None = None,
    ) -> None:
        self.grain_count, self.dimension = grain_count, dimension
        self.chunk_count = min(MOST_CHUNKS, max(1, grain_count // CHUNK_GRAINS))
        self.threads = min(threads or thread_count(), self.chunk_count)
        self.like = (0.0,) * dimension
        self.wide = wide_by_default() if wide is None else wide
        self.chunk = np.zeros(grain_count, np.int64)
        self._pool: ThreadPoolExecutor | None = None
        self._values, self._index = aligned((0,)), np.zeros((2, 0), np.uint32)
        self._work: Work | None = None

    def arrange(self, position: Array, matrix: Array, origin: Array) -> None:
        """Divide the grains into chunks that lie together."""
        if self.chunk_count > 1:
            order = morton_order(position, origin, np.linalg.inv(matrix))
            self.chunk[order] = np.arange(self.grain_count) * self.chunk_count // self.grain_count

    def solve(
        self, problem: Problem, state: State, settings: tuple[float, int, float, float]
    ) -> Solution:
        """Solve; ``state`` holds the warm start, velocities included, and then the solution.

        Args:
            problem: contacts of the step.
            state: impulses, body records, free rates of the cell.
            settings: (tolerance, max_sweeps, momentum cap, floor), see ``kernels.solve``.
        """
        like = self.like
        law = Law(
            problem.softness, problem.spin_factor, problem.coupled,
            problem.dilation_weight, problem.weight,
        )  # fmt: skip
        order = np.empty(len(problem.length), np.int64)
        starts = schedule(
            problem.first, problem.second, self.grain_count, self.chunk, self.chunk_count, order
        )
        size = fields(like, problem.coupled) * WIDTH
        slots = self._slots(starts, size)
        pack(problem, state.motion, state.impulse_n, state.impulse_t, order, slots, like)
        work = self._workspace(state.motion)
        work.cells[-1, 0] = state.rate
        solution = Solution(*self._run(slots, state.motion, law, work, size, settings))
        state.rate[:] = work.cells[-1, 0]
        unpack(slots, size, order, state.impulse_n, state.impulse_t, like)
        return solution

    def _run(
        self,
        slots: Slots,
        bodies: Array,
        law: Law,
        work: Work,
        size: int,
        settings: tuple[float, int, float, float],
    ) -> tuple[int, float, float, float]:
        like = (self.like,) if self.wide else self.like
        members = self.threads
        if members == 1:
            return solve(slots, bodies, law, work, like, size, settings, 0, 1)
        if self._pool is None:
            self._pool = ThreadPoolExecutor(members - 1, thread_name_prefix="granufab")
        common = (slots, bodies, law, work, like, size, settings)
        others = [self._pool.submit(solve, *common, k, members) for k in range(1, members)]
        found = solve(*common, 0, members)
        for other in others:
            other.result()
        return found

    def _slots(self, starts: IntArray, size: int) -> Slots:
        batches = int(starts[-1])
        if len(self._values) < batches * size:
            self._values = aligned((batches * size * 5 // 4 + size,))
        if self._index.shape[1] < batches * WIDTH:
            self._index = np.zeros((2, batches * WIDTH * 5 // 4 + WIDTH), np.uint32)
        return Slots(self._values, self._index[0], self._index[1], starts)

    def _workspace(self, bodies: Array) -> Work:
        if self._work is None:
            dimension, chunks = self.dimension, self.chunk_count
            self._work = Work(
                before=aligned(bodies.shape),
                cells=np.zeros((chunks + 1, 3, dimension, dimension)),
                rate_before=np.zeros((dimension, dimension)),
                sums=np.zeros((chunks + 1, SUMS)),
                control=np.zeros(CONTROLS),
                counters=np.zeros(COUNTERS, np.int64),
            )
        return self._work
