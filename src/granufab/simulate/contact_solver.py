"""Solves the contact problem of a step: packs it, sweeps with several threads, unpacks it.

The grains lie in chunks, a number that depends on the sample alone; threads share the chunks, so
the result has the same bits for any number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import binding
from numba.core import config

from granufab.kernels.lanes import WIDTH
from granufab.kernels.neighbours import morton_order
from granufab.kernels.pack import pack, solve_packed, unpack
from granufab.kernels.problem import Problem, State
from granufab.kernels.schedule import Plan, schedule
from granufab.kernels.slots import Slots, fields, places
from granufab.kernels.solve import CONTROLS, SUMS, Work, patient_sweeps
from granufab.kernels.sweep import Law
from granufab.packing import Array, IntArray
from granufab.simulate.bodies import aligned
from granufab.simulate.mending import mend
from granufab.simulate.team import Team, thread_count

__all__ = ["ContactSolver", "Packed", "Solution", "patience_of", "wide_by_default"]

CHUNK_GRAINS, MOST_CHUNKS = 3000, 64
"""Grains for one chunk; from twice as many on the number of chunks is rounded up to ``TEAMS``."""
TEAMS = 4
"""Chunks are a multiple of this, so that two or four threads have equal shares."""


PATIENCE = 1.2e6
"""Contact updates without progress before a group is solved together: what solving one costs."""


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


def patience_of(softness: float, cap: float) -> float:
    """Contact updates without progress before a stop; only compliant contacts can be mended."""
    return PATIENCE if cap > 0 and softness > 0 else np.inf


def wide_by_default() -> bool:
    """Whether eight contacts are updated at once: where the processor has vectors of four doubles.

    GRANUFAB_LANES=0 switches it off.
    """
    if getattr(config, "DISABLE_JIT", 0) or os.environ.get("GRANUFAB_LANES") == "0":
        return False
    return bool(binding.get_host_cpu_features().get("avx2"))


class Packed(NamedTuple):
    """A packed problem: contacts, shared law, where they lie, numbers of a batch."""

    slots: Slots
    law: Law
    plan: Plan
    size: int


class ContactSolver:
    """Workspace of the solves of a run.

    Args:
        grain_count: grains; bodies beyond are walls and the spare one.
        dimension: 2 or 3.
        threads: most threads to use; default :func:`granufab.simulate.team.thread_count`.
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
        self.team = Team(1 if getattr(config, "DISABLE_JIT", 0) else threads or thread_count())
        self.wide = wide_by_default() if wide is None else wide
        self.chunk, self._grains = np.zeros(grain_count, np.int64), np.arange(grain_count)
        teams = -(-(grain_count // CHUNK_GRAINS) // TEAMS)
        self.divide(min(MOST_CHUNKS, TEAMS * teams) if grain_count >= 2 * CHUNK_GRAINS else 1)
        self._values, self._first, self._second = aligned((0,)), _indices(0), _indices(0)
        self._plan: Plan | None = None
        self._work: Work | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but memory that is made again when needed."""
        return {**self.__dict__, "_plan": None, "_work": None}

    @property
    def grain_order(self) -> IntArray:
        """The grains chunk by chunk."""
        return self._grains

    @property
    def threads(self) -> int:
        """Threads that share a solve: as many as wanted, at most one for each chunk."""
        return min(self.team.most, self.chunk_count)

    @property
    def width(self) -> tuple[Any, ...]:
        """Width and dimension of the sweep, as kernels are told."""
        return (self.like,) if self.wide else self.like

    def arrange(self, position: Array, matrix: Array, origin: Array) -> None:
        """Divide the grains into chunks that lie together."""
        if self.chunk_count > 1:
            self.divide(self.chunk_count, morton_order(position, origin, np.linalg.inv(matrix)))

    def divide(self, chunk_count: int, order: IntArray | None = None) -> None:
        """Divide the grains into chunks of equal size, as they are numbered or in this order."""
        self.chunk_count = chunk_count
        turn = np.arange(self.grain_count)
        self._grains[:] = turn if order is None else order
        self.chunk[self._grains] = turn * chunk_count // self.grain_count

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
        patience = patient_sweeps(patience_of(problem.softness, cap), len(problem.length))
        packed = self.pack(problem, state)
        sweeps = mends = 0
        while True:
            found = self.iterate(packed, state, (tolerance, most - sweeps, cap, floor), patience)
            sweeps += found.sweeps
            if found.residual <= tolerance or sweeps >= most:
                unpack(packed.slots, packed.plan, packed.size, state, self.like)
                return found._replace(sweeps=sweeps, mends=mends)
            mends += self.mend(problem, state, packed.slots, mends)

    def mend(self, problem: Problem, state: State, slots: Slots, before: int) -> bool:
        """Solve the contacts that circle together, in the packed contacts and in ``state``.

        Args:
            problem: contacts of the step, packed in ``slots``.
            state: velocities that belong to the packed impulses; gets these, too.
            slots: impulses of the last sweep and of the one before; both then hold the solution.
            before: groups of this step that were solved already.
        Returns:
            Whether anything was done, see :func:`granufab.simulate.mending.mend`.
        """
        at, batches = places(self.like), int(slots.starts[-1])
        size = fields(self.like, problem.coupled)
        table = slots.values[: batches * size * WIDTH].reshape(batches, size, WIDTH)
        slot = self.plan(0).order[: len(problem.length)]
        batch, lane, tangents = slot // WIDTH, slot % WIDTH, state.impulse_t.shape[1]
        now = [at.impulse_n, *(at.impulse_t + k for k in range(tangents))]
        last = [at.before_n, *(at.before_t + k for k in range(tangents))]
        impulse = np.stack([table[batch, field, lane] for field in now], axis=1)
        change = impulse - np.stack([table[batch, field, lane] for field in last], axis=1)
        state.impulse_n[:], state.impulse_t[:] = impulse[:, 0], impulse[:, 1:]
        mended = mend(problem, state, np.linalg.norm(change, axis=1), before)
        impulse = np.column_stack([state.impulse_n, state.impulse_t])
        for k in range(tangents + 1):
            table[batch, now[k], lane] = table[batch, last[k], lane] = impulse[:, k]
        return mended

    def pack(self, problem: Problem, state: State) -> Packed:
        """The contacts in the order of the sweep; valid until the next call."""
        law = Law(
            problem.softness, problem.spin_factor, problem.coupled,
            problem.dilation_weight, problem.weight,
        )  # fmt: skip
        plan = self.plan(len(problem.length))
        batches = schedule(plan, problem.first, problem.second)
        slots = self.slots(batches, coupled=problem.coupled)
        pack(problem, state, plan, slots, self.like)
        return Packed(slots, law, plan, fields(self.like, problem.coupled) * WIDTH)

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
        work = self.work(state.motion)
        work.cells[-1, 0] = state.rate
        arguments = (
            packed.slots,
            state.motion,
            packed.law,
            work,
            self.width,
            packed.size,
            (*settings, patience),
        )
        found = self.together(solve_packed, arguments)
        state.rate[:] = work.cells[-1, 0]
        return Solution(*found)

    def together(self, kernel: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """Call a kernel for every thread of the solver; see :meth:`Team.run`."""
        return self.team.run(kernel, arguments, self.threads)

    def plan(self, contact_count: int) -> Plan:
        """Memory to arrange at least so many contacts, for the present chunks."""
        plan, chunks = self._plan, self.chunk_count
        if plan is None or len(plan.listed) < contact_count or len(plan.heads) != chunks + 2:
            plan = self._plan = Plan.of(self.chunk, chunks, contact_count * 5 // 4)
        return plan

    def slots(self, batches: int, *, coupled: bool) -> Slots:
        """Room for so many batches; the contacts packed before are lost where it grows."""
        size = fields(self.like, coupled) * WIDTH
        if len(self._values) < batches * size:
            self._values = aligned((batches * size * 5 // 4 + size,))
        if len(self._first) < batches * WIDTH:
            room = batches * WIDTH * 5 // 4 + WIDTH
            self._first, self._second = _indices(room), _indices(room)
        return Slots(self._values, self._first, self._second, self.plan(0).starts)

    def room(self, *, coupled: bool) -> int:
        """Batches that the slots have room for."""
        size = fields(self.like, coupled) * WIDTH
        return min(len(self._values) // size, len(self._first) // WIDTH)

    def work(self, bodies: Array) -> Work:
        """Memory of the team that solves."""
        counters = self.team.ready()
        work, dimension, chunks = self._work, self.dimension, self.chunk_count
        if work is None or len(work.sums) != chunks + 1 or len(work.before) != len(bodies):
            work = Work(
                grains=self._grains,
                before=aligned(bodies.shape),
                cells=np.zeros((chunks + 1, 3, dimension, dimension)),
                rate_before=np.zeros((dimension, dimension)),
                sums=np.zeros((chunks + 1, SUMS)),
                control=np.zeros(CONTROLS),
                counters=counters,
            )
        self._work = work._replace(counters=counters)
        return self._work


def _indices(count: int) -> np.ndarray:
    return np.zeros(count, np.uint32)
