"""Solves the contact problem of a step: packs it, sweeps with several threads, unpacks it.

The grains lie in chunks, a number that depends on the sample alone; threads share the chunks, so
the result has the same bits for any number of threads.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llvmlite import binding
from numba.core import config

from granufab.errors import InvalidSettings
from granufab.kernels.lanes import WIDTH
from granufab.kernels.neighbours import morton_order
from granufab.kernels.problem import Problem, State
from granufab.kernels.slots import Slots, fields, pack, places, schedule, unpack
from granufab.kernels.solve import CONTROLS, SUMS, Work, solve
from granufab.kernels.sweep import Law
from granufab.kernels.team import COUNTERS, GIVE_UP
from granufab.packing import Array, IntArray
from granufab.simulate.bodies import aligned
from granufab.simulate.mending import mend

__all__ = ["ContactSolver", "Packed", "Solution", "thread_count", "wide_by_default"]

CHUNK_GRAINS, MOST_CHUNKS = 3000, 64
"""Grains for one chunk; from twice as many on the number of chunks is rounded up to ``TEAMS``."""
TEAMS = 4
"""Chunks are a multiple of this, so that two or four threads have equal shares."""


PATIENCE = 150.0
"""Sweeps without progress before a group is solved together."""


class Solution(NamedTuple):
    """How a solve ended.

    Attributes:
        sweeps: Gauss–Seidel sweeps.
        residual: reached [-].
        residual_contact: its largest single share [-].
        violation: worst −ũ_n [m/s].
        mends: groups of contacts that were solved together.
    """

    sweeps: int
    residual: float
    residual_contact: float
    violation: float
    mends: int = 0


def thread_count() -> int:
    """Threads of a run: GRANUFAB_THREADS, else the processors this process may use.

    Teams wait actively, so the default is 1 where a waiting thread cannot give its processor
    away (not POSIX) and at most what a container is allowed.

    Raises:
        InvalidSettings: GRANUFAB_THREADS is not a positive integer.
    """
    given = os.environ.get("GRANUFAB_THREADS")
    if not given:
        if os.name != "posix":
            return 1
        usable = getattr(os, "sched_getaffinity", None)
        count = len(usable(0)) if usable else os.cpu_count() or 1
        return max(1, min(count, _quota()))
    if not given.isdecimal() or int(given) < 1:
        raise InvalidSettings(f"GRANUFAB_THREADS is {given!r}, must be an integer ≥ 1")
    return int(given)


def _quota() -> int:
    """Processors that the control group of this process may use, rounded up."""
    try:
        allowed, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()
        return -(-int(allowed) // int(period))
    except (OSError, ValueError):  # no such file, or no limit ("max")
        return sys.maxsize


def wide_by_default() -> bool:
    """Whether eight contacts are updated at once: where the processor has vectors of four doubles.

    GRANUFAB_LANES=0 switches it off.
    """
    if getattr(config, "DISABLE_JIT", 0) or os.environ.get("GRANUFAB_LANES") == "0":
        return False
    return bool(binding.get_host_cpu_features().get("avx2"))


class Packed(NamedTuple):
    """A packed problem: contacts, shared law, slot of every contact, numbers of a batch."""

    slots: Slots
    law: Law
    order: IntArray
    size: int


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
        self.like = (0.0,) * dimension
        self.wanted = 1 if getattr(config, "DISABLE_JIT", 0) else threads or thread_count()
        self.wide = wide_by_default() if wide is None else wide
        self.chunk = np.zeros(grain_count, np.int64)
        teams = -(-(grain_count // CHUNK_GRAINS) // TEAMS)
        self.divide(min(MOST_CHUNKS, TEAMS * teams) if grain_count >= 2 * CHUNK_GRAINS else 1)
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()
        self._values, self._index = aligned((0,)), np.zeros((2, 0), np.uint32)
        self._work: Work | None = None

    @property
    def threads(self) -> int:
        """Threads that share a solve: as many as wanted, at most one for each chunk."""
        return min(self.wanted, self.chunk_count)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but threads and what they share, which are made again when needed."""
        return {**self.__dict__, "_pool": None, "_work": None}

    def arrange(self, position: Array, matrix: Array, origin: Array) -> None:
        """Divide the grains into chunks that lie together."""
        if self.chunk_count > 1:
            self.divide(self.chunk_count, morton_order(position, origin, np.linalg.inv(matrix)))

    def divide(self, chunk_count: int, order: IntArray | None = None) -> None:
        """Divide the grains into chunks of equal size, as they are numbered or in this order."""
        self.chunk_count = chunk_count
        turn = np.arange(self.grain_count)
        self.chunk[turn if order is None else order] = turn * chunk_count // self.grain_count

    def solve(
        self, problem: Problem, state: State, settings: tuple[float, int, float, float]
    ) -> Solution:
        """Solve; ``state`` holds the warm start, velocities included, and then the solution.

        Args:
            problem: contacts of the step.
            state: impulses, body records, free rates of the cell.
            settings: (tolerance, max_sweeps, momentum cap, floor), see ``kernels.solve``.
        """
        tolerance, most, cap, floor = settings
        patience = PATIENCE if cap > 0 and problem.softness > 0 else np.inf
        sweeps = mends = 0
        while True:
            packed = self.pack(problem, state)
            found = self.iterate(packed, state, (tolerance, most - sweeps, cap, floor), patience)
            unpack(
                packed.slots, packed.size, packed.order, state.impulse_n, state.impulse_t, self.like
            )
            sweeps += found.sweeps
            if found.residual <= tolerance or sweeps >= most:
                return found._replace(sweeps=sweeps, mends=mends)
            mends += mend(problem, state, self._change(packed), mends)

    def pack(self, problem: Problem, state: State) -> Packed:
        """The contacts in the order of the sweep; valid until the next call."""
        law = Law(
            problem.softness, problem.spin_factor, problem.coupled,
            problem.dilation_weight, problem.weight,
        )  # fmt: skip
        order = np.empty(len(problem.length), np.int64)
        starts = schedule(
            problem.first, problem.second, self.grain_count, self.chunk, self.chunk_count, order
        )
        size = fields(self.like, problem.coupled) * WIDTH
        slots = self._slots(starts, size)
        pack(problem, state.motion, state.impulse_n, state.impulse_t, order, slots, self.like)
        return Packed(slots, law, order, size)

    def _change(self, packed: Packed) -> Array:
        """|ΔP| of every contact in the last sweep [N s]."""
        at, slots = places(self.like), packed.slots
        batches = int(slots.starts[-1])
        table = slots.values[: batches * packed.size].reshape(batches, -1, WIDTH)
        tangents = 1 if self.dimension == 2 else 3
        change = table[:, at.impulse_n] - table[:, at.before_n]
        squared = change**2
        for k in range(tangents):
            squared += (table[:, at.impulse_t + k] - table[:, at.before_t + k]) ** 2
        return np.sqrt(squared).ravel()[packed.order]

    def iterate(
        self,
        packed: Packed,
        state: State,
        settings: tuple[float, int, float, float],
        patience: float = np.inf,
    ) -> Solution:
        """Sweep; impulses stay in the packed contacts, velocities and rates in ``state``.

        Ends also after ``patience`` sweeps without progress.
        """
        if self._process != os.getpid():  # a fork has none of its parent's threads
            self._process, self._pool, self._work = os.getpid(), None, None
        work = self._workspace(state.motion)
        work.cells[-1, 0] = state.rate
        like = (self.like,) if self.wide else self.like
        common = (
            packed.slots,
            state.motion,
            packed.law,
            work,
            like,
            packed.size,
            (*settings, patience),
        )
        run: Any = self._together if self.threads > 1 else solve
        found = run(*common, 0, self.threads)
        state.rate[:] = work.cells[-1, 0]
        return Solution(*found)

    def _together(self, *arguments: Any) -> Any:
        """Solve with all threads; if one fails the others end, and the next solve starts afresh."""
        *common, first, members = arguments
        work: Work = common[3]
        others: list[Future[Any]] = []
        run: Any = solve
        try:
            others += [self._submit(*common, k, members) for k in range(first + 1, members)]
            found = run(*arguments)
            for other in others:
                other.result()
        except BaseException:
            work.counters[GIVE_UP] = 1
            wait(others)
            self._work = None
            raise
        return found

    def _submit(self, *arguments: Any) -> Future[Any]:
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.wanted - 1, thread_name_prefix="granufab")
        return self._pool.submit(solve, *arguments)

    def _slots(self, starts: IntArray, size: int) -> Slots:
        batches = int(starts[-1])
        if len(self._values) < batches * size:
            self._values = aligned((batches * size * 5 // 4 + size,))
        if self._index.shape[1] < batches * WIDTH:
            self._index = np.zeros((2, batches * WIDTH * 5 // 4 + WIDTH), np.uint32)
        return Slots(self._values, self._index[0], self._index[1], starts)

    def _workspace(self, bodies: Array) -> Work:
        if self._work is None or len(self._work.sums) != self.chunk_count + 1:
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
