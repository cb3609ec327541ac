"""The few calls that the benchmarks make into the engine; all else here works on their results.

A kernel or a thread count that the engine does not have answers None.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from granufab.kernels.options import kernel
from granufab.kernels.problem import Problem, State
from granufab.kernels.sweep import sweep
from granufab.packing import Array, Packing
from granufab.simulate import Loading, Material, Simulation, Solver

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
LAG = 64
NO_SWEEPS = 0.99


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One step's contact problem with a warm start, ready to be swept.

    Attributes:
        problem, state: as the kernels take them.
        dimension: 2 or 3.
        grain_count: bodies without walls.
        lag: contacts between two updates of the cell's free rate.
        residual: of the warm start [-].
    """

    problem: Problem
    state: State
    dimension: int
    grain_count: int
    lag: int
    residual: float

    @property
    def contact_count(self) -> int:
        """Contacts in the solve."""
        return len(self.problem.length)


class Streams(NamedTuple):
    """A case as plain arrays in solve order, whatever the engine's own layout: for the reference.

    Attributes:
        contact_count, lag: contacts, and contacts between two updates of the dilation.
        first, second: bodies, int32, shape (contact_count,).
        normal: shape (contact_count, D).
        length, offset_n: shape (contact_count,); offset_t: shape (contact_count, 1 or 3).
        mu: shape (contact_count,).
        eps, kappa, w_cell: 1/(k h²), m R²/I, 1/(D M).
        motion: body records, shape (body_count, 4 or 8); changed by a sweep.
        impulse_n, impulse_t: shapes (contact_count,), (contact_count, 1 or 3); changed by a sweep.
        dilation: shape (1,); changed by a sweep.
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
    eps: float
    kappa: float
    w_cell: float
    motion: Array
    impulse_n: Array
    impulse_t: Array
    dilation: Array


def streams_of(case: Case) -> Streams:
    """Copies of a case's arrays as :class:`Streams`.

    Raises:
        ValueError: the cell has free components other than the dilation.
    """
    p, s = case.problem, case.state
    if p.coupled:
        raise ValueError("the reference sweeps problems whose only free component is the dilation")
    return Streams(
        contact_count=case.contact_count,
        lag=case.lag,
        first=np.array(p.first, dtype=np.int32),
        second=np.array(p.second, dtype=np.int32),
        normal=np.array(p.normal),
        length=np.array(p.length),
        offset_n=np.array(p.offset_n),
        offset_t=np.array(p.offset_t),
        mu=np.array(p.mu),
        eps=p.softness,
        kappa=p.spin_factor,
        w_cell=p.dilation_weight,
        motion=np.array(s.motion),
        impulse_n=np.array(s.impulse_n),
        impulse_t=np.array(s.impulse_t),
        dilation=np.array(s.rate[:1, 0]),
    )


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
        lag=min(LAG, max(1, report.contacts // 50)),
        residual=report.residual,
    )


def copy_of(case: Case) -> Case:
    """The same case with a state of its own."""
    return replace(case, state=_copied(case.state))


def _copied(record):
    arrays = (np.array(x) if isinstance(x, np.ndarray) else x for x in record)
    return type(record)(*arrays)


@kernel
def _make_sweeps(problem, state, like, lag, count):
    moved = 0.0
    for _ in range(count):
        moved = sweep(problem, state, like, lag)
    return moved


def sweep_seconds(
    case: Case, sweeps: int, *, kernel: Kernel = "scalar", threads: int = 1
) -> float | None:
    """Make ``sweeps`` plain sweeps of a case in place.

    Args:
        case: changed by the sweeps.
        sweeps: how many.
        kernel: the readable law (scalar) or the vectorised one (fast).
        threads: how many share a sweep.
    Returns:
        The seconds they took; None where the engine has no such kernel or threads.
    """
    if kernel != "scalar" or threads != 1:
        return None
    like = (0.0,) * case.dimension
    began = time.perf_counter()
    _make_sweeps(case.problem, case.state, like, case.lag, sweeps)
    return time.perf_counter() - began


class _Timed(Simulation):
    """A simulation that also knows the time spent in the iterations alone."""

    sweeping = 0.0

    def _iterate(self, problem: Problem) -> tuple[int, float, float, float]:
        began = time.perf_counter()
        found = super()._iterate(problem)
        self.sweeping += time.perf_counter() - began
        return found


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
        self._simulation = _Timed(
            packing, loading, material=Material(friction=friction), solver=solver
        )

    def step(self) -> StepCost:
        """One step."""
        before = self._simulation.seconds["solve"]
        began = time.perf_counter()
        report = self._simulation.step()
        return StepCost(
            sweeps=report.sweeps,
            seconds=self._simulation.seconds["solve"] - before,
            step_seconds=time.perf_counter() - began,
            residual=report.residual,
            reached=report.converged,
            contacts=report.contacts,
        )

    def seconds_by_stage(self) -> dict[str, float]:
        """Seconds so far: search, geometry, iterations of the solver, rest of the solve, rest."""
        seconds = dict(self._simulation.seconds)
        solve = seconds.pop("solve")
        sweeping = self._simulation.sweeping
        return {"sweeps": sweeping, "rest of the solve": solve - sweeping, **seconds}
