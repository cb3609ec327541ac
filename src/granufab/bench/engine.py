"""The few calls that the benchmarks make into the engine; all else here works on their results.

A kernel or a thread count that the engine does not have answers None.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import kernel
from granufab.kernels.pack import unpack
from granufab.kernels.problem import Problem, State
from granufab.kernels.slots import places
from granufab.kernels.sweep import lag_of, sweep
from granufab.packing import Array, Packing
from granufab.simulate import Loading, Material, Simulation, Solver
from granufab.simulate.bodies import aligned
from granufab.simulate.contact_solver import ContactSolver, wide_by_default

__all__ = [
    "Case",
    "Kernel",
    "Marching",
    "StepCost",
    "Streams",
    "copy_of",
    "problem_of",
    "streams_of",
    "sweep_seconds",
]

Kernel = Literal["scalar", "fast"]
NO_SWEEPS = 0.99
BETA = 0.0  # plain sweeps, by kernels that could do more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One step's contact problem with a warm start, ready to be swept.

    Attributes:
        problem, state: as the kernels take them.
        dimension: 2 or 3.
        grain_count: bodies without walls.
        residual: of the warm start [-].
    """

    problem: Problem
    state: State
    dimension: int
    grain_count: int
    residual: float

    @property
    def contact_count(self) -> int:
        """Contacts in the solve."""
        return len(self.problem.length)


class Streams(NamedTuple):
    """A case as plain arrays in solve order, whatever the engine's own layout: for the reference.

    The empty places of the engine's batches are contacts of a spare body that stay open.

    Attributes:
        contact_count, lag: contacts, and contacts between two updates of the dilation.
        first, second: bodies, int32, shape (contact_count,).
        normal: shape (contact_count, D).
        length, offset_n: shape (contact_count,); offset_t: shape (contact_count, 1 or 3).
        mu, inverse_n, inverse_t: friction, 1/(W_nn + ε), 1/(W_tt + ε), shape (contact_count,).
        eps, kappa, w_cell: 1/(k h²), m R²/I, 1/(D M).
        motion: body records, shape (body_count, 4 or 8); changed by a sweep.
        impulse_n, impulse_t: shapes (contact_count,), (contact_count, 1 or 3); changed by a sweep.
        before_n, before_t: impulses of the iterate before; changed by a sweep.
        beta: momentum of the impulses.
        dilation: and Σ|P|², shape (2,); changed by a sweep.
    """

    contact_count: int
    lag: int
    first: np.ndarray
    second: np.ndarray
    normal: Array
    length: Array
    offset_n: Array
    offset_t: Array
    mu: Array
    inverse_n: Array
    inverse_t: Array
    eps: float
    kappa: float
    w_cell: float
    motion: Array
    impulse_n: Array
    impulse_t: Array
    before_n: Array
    before_t: Array
    beta: float
    dilation: Array


def streams_of(case: Case) -> Streams:
    """A case as :class:`Streams`.

    Raises:
        ValueError: the cell has free components other than the dilation.
    """
    p, like = case.problem, (0.0,) * case.dimension
    if p.coupled:
        raise ValueError("the reference sweeps problems whose only free component is the dilation")
    packed = _solver(case).pack(p, case.state)
    batches = int(packed.slots.starts[-1])
    table = packed.slots.values[: batches * packed.size].reshape(batches, -1, WIDTH)
    at = places(like)

    def line(field: int) -> Array:
        return table[:, field].ravel()

    def columns(field: int, count: int) -> Array:
        return np.stack([line(field + k) for k in range(count)], axis=1)

    tangents = p.offset_t.shape[1]
    size2 = np.sum(case.state.impulse_n**2) + np.sum(case.state.impulse_t**2)
    return Streams(
        contact_count=batches * WIDTH,
        lag=WIDTH * lag_of(batches),
        first=packed.slots.first[: batches * WIDTH].astype(np.int32),
        second=packed.slots.second[: batches * WIDTH].astype(np.int32),
        normal=columns(at.normal, case.dimension),
        length=line(at.length),
        offset_n=line(at.offset_n),
        offset_t=columns(at.offset_t, tangents),
        mu=line(at.mu),
        inverse_n=line(at.inverse_n),
        inverse_t=line(at.inverse_t),
        eps=p.softness,
        kappa=p.spin_factor,
        w_cell=p.dilation_weight,
        motion=_copied_array(case.state.motion),
        impulse_n=line(at.impulse_n),
        impulse_t=columns(at.impulse_t, tangents),
        before_n=line(at.before_n),
        before_t=columns(at.before_t, tangents),
        beta=BETA,
        dilation=np.array([case.state.rate[0, 0], size2]),
    )


def _solver(case: Case, threads: int | None = None, *, wide: bool = False) -> ContactSolver:
    """Solver of a case; in one chunk unless a team takes it."""
    solver = ContactSolver(case.grain_count, case.dimension, threads=threads or 1, wide=wide)
    if threads is None:
        solver.divide(1)
    return solver


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCost:
    """What one step took.

    Attributes:
        sweeps: Gauss–Seidel sweeps.
        seconds: of the whole solve.
        step_seconds: of the whole step.
        residual: reached [-].
        reached: whether the tolerance was met before the cap.
        contacts: in the solve.
    """

    sweeps: int
    seconds: float
    step_seconds: float
    residual: float
    reached: bool
    contacts: int


def problem_of(packing: Packing, loading: Loading, *, friction: float) -> Case:
    """The contact problem of the next step of a packing, at its stored forces, unsolved."""
    simulation = Simulation(
        packing,
        loading,
        material=Material(friction=friction),
        solver=Solver(tolerance=NO_SWEEPS),
    )
    report = simulation.step()
    return Case(
        problem=_copied(simulation.problem),
        state=_copied(simulation.state),
        dimension=simulation.dimension,
        grain_count=simulation.grain_count,
        residual=report.residual,
    )


def copy_of(case: Case) -> Case:
    """The same case with a state of its own."""
    return replace(case, state=_copied(case.state))


def _copied(record):
    arrays = (_copied_array(x) if isinstance(x, np.ndarray) else x for x in record)
    return type(record)(*arrays)


def _copied_array(array: np.ndarray) -> np.ndarray:
    """A copy that begins at a cache line, as the engine's arrays do."""
    copy = aligned(array.shape, array.dtype.type)
    copy[...] = array
    return copy


@kernel
def _make_sweeps(slots, bodies, law, cell, like, size, count, beta):
    moved = 0.0
    for _ in range(count):
        cell[1:] = 0.0
        moved, _length2 = sweep(
            slots, bodies, law, (0, slots.starts[-1], beta, 1.0), cell, like, size
        )
    return moved


def sweep_seconds(
    case: Case, sweeps: int, *, kernel: Kernel = "scalar", threads: int | None = None
) -> float | None:
    """Make ``sweeps`` plain sweeps of a case in place.

    Args:
        case: changed by the sweeps.
        sweeps: how many.
        kernel: one contact at a time (scalar) or eight (fast).
        threads: members of a team, with all that a team does besides; None: the bare sweep.
    Returns:
        The seconds they took; None where the engine has no such kernel or threads.
    """
    if kernel == "fast" and not wide_by_default():
        return None
    solver = _solver(case, threads, wide=kernel == "fast")
    if threads is not None and solver.threads < threads:
        return None
    packed, state = solver.pack(case.problem, case.state), case.state
    began = time.perf_counter()
    if threads is None:
        cell = np.zeros((3, case.dimension, case.dimension))
        cell[0] = state.rate
        like = (solver.like,) if solver.wide else solver.like
        _make_sweeps(packed.slots, state.motion, packed.law, cell, like, packed.size, sweeps, BETA)
        state.rate[:] = cell[0]
    else:
        solver.iterate(packed, state, (-1.0, sweeps, 0.0, 1.0))
    seconds = time.perf_counter() - began
    unpack(packed.slots, packed.plan, packed.size, state, solver.like)
    return seconds


class Marching:
    """A packing stepped on under a loading, plain or accelerated, with the cost of each step.

    Args:
        packing: starting state with its forces.
        loading: what drives the cell.
        friction: µ between grains.
        tolerance: residual of each step.
        accelerated: momentum on, else plain Gauss–Seidel.
        cap: sweeps after which a step stops.
    """

    def __init__(
        self,
        packing: Packing,
        loading: Loading,
        *,
        friction: float,
        tolerance: float,
        accelerated: bool = True,
        cap: int = 2000,
    ) -> None:
        solver = Solver(tolerance=tolerance, momentum=accelerated, max_sweeps=cap)
        self.stiffness = solver.stiffness
        self._simulation = Simulation(
            packing, loading, material=Material(friction=friction), solver=solver
        )

    def step(self) -> StepCost:
        """One step."""
        before = self._solving()
        began = time.perf_counter()
        report = self._simulation.step()
        return StepCost(
            sweeps=report.sweeps,
            seconds=self._solving() - before,
            step_seconds=time.perf_counter() - began,
            residual=report.residual,
            reached=report.converged,
            contacts=report.contacts,
        )

    def _solving(self) -> float:
        return self._simulation.seconds["assembly"] + self._simulation.seconds["sweeps"]

    def seconds_by_stage(self) -> dict[str, float]:
        """Seconds so far: iterations of the solver, rest of the solve, search, geometry, rest."""
        seconds = dict(self._simulation.seconds)
        return {
            "sweeps": seconds.pop("sweeps"),
            "rest of the solve": seconds.pop("assembly"),
            **seconds,
        }
