"""A running system: grains, cell, candidate contacts, loading, and the call that steps them on.

A step itself is compiled (:mod:`granufab.kernels.step`): Moreau–Jean midpoint. The cell is one
more body in the solve, so stress-driven components need no controller.
"""

from __future__ import annotations

import os
import time
from typing import NamedTuple

import numpy as np

from granufab.errors import InvalidSettings
from granufab.kernels.lanes import WIDTH
from granufab.kernels.motion import kinetic_energy
from granufab.kernels.problem import Problem, State
from granufab.kernels.step import Step, advance
from granufab.kernels.step_arrays import (
    BATCHES,
    DRIFT,
    EXTERNAL,
    FARTHEST,
    FREE,
    IMPOSED,
    MADE,
    MATRIX,
    MEND,
    MENDS,
    PATIENCE,
    PHASE,
    RATE,
    ROOM,
    ROWS,
    SEARCH,
    STATUS,
    STOP,
    STRAIN,
    STRAIN_WALKED,
    STRESS,
    TIME,
    TOTAL,
    TOTAL_GOAL,
    WALK_GOAL,
    WALKED,
    WATCH,
    StepLaw,
)
from granufab.packing import Array, Packing, require
from granufab.simulate.bodies import body_records
from granufab.simulate.candidates import Candidates
from granufab.simulate.cell_motion import Tensor, shorten_cell
from granufab.simulate.contact_solver import ContactSolver
from granufab.simulate.loading import Loading
from granufab.simulate.scales import Scales
from granufab.simulate.settings import Material, Solver
from granufab.simulate.step_checks import check_places, check_step
from granufab.simulate.step_law import problem_law, skin_of, solve_settings, step_law
from granufab.simulate.step_memory import StageClock, StepMemory
from granufab.simulate.step_report import StepReport, StepReports

__all__ = ["Simulation", "Watch"]

SECONDS_OF_A_CALL = 0.2
FEWEST_BATCHES = 16


class Watch(NamedTuple):
    """When :meth:`Simulation.advance` is to return: a strain W : ε has been walked.

    Attributes:
        weight: W, symmetric, shape (D, D).
        walked: Σ W : Δε to reach [-].
        total: Σ |W : Δε| to reach [-].
    """

    weight: Array
    walked: float
    total: float


class Simulation:
    """A running system: grains, cell, candidate contacts, loading, solver.

    Args:
        packing: starting state; grains need masses, the cell must be given.
        loading: imposed rates and free components.
        material: friction, wall friction, restitution.
        solver: tolerances and step sizes.
        gravity: acceleration [m/s²], shape (D,).
        rotation: False blocks all spins (W_tt loses its rotational part).
        step: time step [s]; default from the solver settings and the imposed rate.
        rate_cap: largest |free rate| after a solve [1/s]; for compaction only.
        damping: share of every velocity removed per step; for relaxation only.
    """

    def __init__(
        self,
        packing: Packing,
        loading: Loading,
        *,
        material: Material | None = None,
        solver: Solver | None = None,
        gravity: Array | None = None,
        rotation: bool = True,
        step: float | None = None,
        rate_cap: float | None = None,
        damping: float = 0.0,
    ) -> None:
        grains, cell = packing.grains, require(packing.cell, "the cell", "give Packing.cell")
        self.material = material or Material()
        self.solver = solver or Solver()
        self.dimension = grains.dimension
        self.grain_count = grains.count
        pressure = float(np.trace(loading.stress)) / self.dimension or 1.0
        self.scales = Scales.of(packing, pressure)
        self.radius = grains.radius.copy()
        self.mass = require(grains.mass, "grain masses").copy()
        ball = np.pi * self.radius**2 if self.dimension == 2 else 4 / 3 * np.pi * self.radius**3
        self.solid_volume = float(ball.sum())
        self.position = grains.position.copy()
        self.number = grains.number
        self.periodic = np.array(cell.periodic)
        self.time = packing.time or 0.0
        self.remap = np.eye(self.dimension, dtype=np.int64)
        self.rotation = rotation
        self.rate_cap, self.damping = rate_cap, damping
        self.like = (0.0,) * self.dimension
        self.spin_factor = (2.0 if self.dimension == 2 else 2.5) if rotation else 0.0
        self.motion = body_records(packing)
        self.contact_solver = ContactSolver(self.grain_count, self.dimension)
        self.memory = StepMemory(
            self.motion, self.position, self.radius, chunk_count=self.contact_solver.chunk_count,
            members=self.contact_solver.team.most,
        )  # fmt: skip
        self.tensors = self.memory.tensors
        self.matrix, self.rate, self.origin = map(np.array, (cell.matrix, cell.rate, cell.origin))
        self.gravity = np.zeros(self.dimension) if gravity is None else np.asarray(gravity, float)
        self.candidates = Candidates(self.grain_count, self.dimension)
        self.step_size = 0.0
        self.contact_updates = 0
        self.searches = 0
        self._clock = StageClock()
        self.set_loading(loading, step=step)
        self.search()
        self.measure_gaps()
        self.candidates.seed_impulses(
            packing.contacts, packing.wall_contacts, self.step_size, self.remap
        )

    matrix, rate = Tensor(MATRIX), Tensor(RATE)
    strain, stress = Tensor(STRAIN), Tensor(STRESS)

    @property
    def origin(self) -> Array:
        """Corner of the cell [m], shape (D,)."""
        return self.memory.origin.copy()

    @origin.setter
    def origin(self, value: Array) -> None:
        self.memory.origin[:] = value

    @property
    def gravity(self) -> Array:
        """Acceleration [m/s²], shape (D,)."""
        return self.memory.gravity.copy()

    @gravity.setter
    def gravity(self, value: Array) -> None:
        if value.shape != (self.dimension,):
            raise InvalidSettings(f"gravity has shape {value.shape}, expected {(self.dimension,)}")
        self.memory.gravity[:] = value

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time so far by stage: search, geometry, assembly, sweeps, rest [s]."""
        return self._clock.seconds

    @property
    def problem(self) -> Problem:
        """Contact problem of the last step; valid until the next one."""
        return self.memory.problem(problem_law(self), self.memory.contact_count)

    @property
    def state(self) -> State:
        """Solution of the last step; valid until the next one."""
        return self.memory.state(self.memory.contact_count)

    def set_loading(self, loading: Loading, *, step: float | None = None) -> None:
        """Change what drives the cell; impulses are rescaled to the new time step.

        Raises:
            InvalidSettings: the loading is for another dimension, or the step is not positive.
        """
        if loading.rate.shape != self.matrix.shape:
            raise InvalidSettings(
                f"loading is for {len(loading.rate)} dimensions, the packing has {self.dimension}"
            )
        if step is not None and not (np.isfinite(step) and step > 0):
            raise InvalidSettings(f"step is {step!r}, must be > 0")
        free_before = self._free_part(self.rate - loading.rate, loading)
        self.loading = loading
        self.rate = loading.rate + free_before
        new = step or self.default_step(loading)
        if self.step_size:
            self.candidates.impulse_n *= new / self.step_size
            self.candidates.impulse_t *= new / self.step_size
        self.step_size = new
        inertia = self.grain_count * self.scales.mass * self.scales.diameter**2 / 2
        self.cell_inertia = inertia
        self.dilation_weight = 1 / (self.dimension * inertia) if loading.dilation else 0.0
        self.weight = loading.free.astype(float) / inertia
        self.coupled = bool(loading.free.any())
        self.tensors[IMPOSED] = loading.rate
        self.tensors[EXTERNAL] = loading.stress
        self.tensors[FREE] = loading.free

    def _free_part(self, rate: Array, loading: Loading) -> Array:
        if loading.dilation:
            return np.eye(self.dimension) * (np.trace(rate) / self.dimension)
        return np.where(loading.free, rate, 0.0)

    def default_step(self, loading: Loading) -> float:
        """h from ``time_step`` and ``step_strain`` of the solver settings [s]."""
        step = self.solver.time_step * self.scales.time
        rate = abs(loading.nominal_rate)
        return min(step, self.solver.step_strain / rate) if rate > 0 else step

    def step_size_limit(self, strain: float, rate: float) -> None:
        """Shorten the step so that a whole number of them makes ``strain`` at ``rate``."""
        steps = max(1, int(np.ceil(strain / (rate * self.step_size) - 1e-9)))
        self.set_loading(self.loading, step=strain / rate / steps)

    def stress_of_impulses(self) -> Array:
        """Stress of the impulses that the candidates hold now, before any solve."""
        return self.candidates.virial() / (self.step_size * self.volume)

    def stress_error(self) -> float:
        """Worst |σ − σ_ext| / p on the stress-driven components at the last solve [-]."""
        return float(self._stress_errors(self.stress[None])[0])

    def _stress_errors(self, stress: Array) -> Array:
        difference = stress - self.loading.stress
        if self.loading.dilation:
            trace = np.trace(difference, axis1=1, axis2=2)
            return np.abs(trace) / self.dimension / self.scales.pressure
        if self.coupled:
            return np.abs(difference[:, self.loading.free]).max(axis=1) / self.scales.pressure
        return np.zeros(len(stress))

    def remove_drift(self) -> None:
        """Take the centre of mass's velocity out of a fully periodic system."""
        if self.periodic.all():
            velocity = self.motion[: self.grain_count, : self.dimension]
            velocity -= (self.mass @ velocity) / self.mass.sum()

    def stop(self) -> None:
        """End every motion: of the grains, their spins, and the cell."""
        self.motion[:, : self.dimension + self.candidates.tangents] = 0.0
        self.tensors[RATE] = 0.0

    def step(self) -> StepReport:
        """Advance by ``step_size``.

        Raises:
            BrokenState: a state is not finite or grains overlap beyond the limit.
            NotConverged: the residual was not met and the solver is ``strict``.
        """
        return self.advance(1).last

    def advance(self, steps: int, watch: Watch | None = None) -> StepReports:
        """Make steps, the same as so many calls of :meth:`step`.

        Args:
            steps: how many at most, ≥ 1.
            watch: return after the step with which a goal is reached.
        Returns:
            Reports of the steps made: fewer than ``steps`` where a goal was reached, and after
            some tenths of a second, so that a caller can tell about progress.
        Raises:
            BrokenState, NotConverged: as :meth:`step`; the last step is then the faulty one.
        """
        control = self.memory.notes.control
        self._set_watch(watch)
        began, rows, made = time.perf_counter(), [], 0
        law = step_law(self)
        while True:
            self._call(law, min(steps - made, ROWS if os.name == "posix" else 1))
            fresh = int(control[MADE])
            rows.append(self.memory.notes.rows[:fresh].copy())
            made += fresh
            if control[STATUS] == SEARCH:
                self.search()
            elif control[STATUS] == ROOM:
                self.contact_solver.slots(int(control[BATCHES]), coupled=self.coupled)
            elif control[STATUS] == MEND:
                self._mend()
            elif (
                made == steps
                or control[STATUS] == STOP
                or time.perf_counter() - began > SECONDS_OF_A_CALL
            ):
                break
        reports = StepReports.of_rows(
            rows[0] if len(rows) == 1 else np.concatenate(rows),
            (self.dimension, self.dimension),
            violation_unit=self.scales.diameter / self.step_size,
            diameter=self.scales.diameter,
            tolerance=self.solver.tolerance,
            stress_error=self._stress_errors,
        )
        self.time = float(control[TIME])
        self.contact_updates += int(reports.contact_updates.sum())
        self.last_report = reports.last
        if control[STATUS] == STOP:
            check_step(self, self.last_report)
        return reports

    def _mend(self) -> None:
        """Solve together the contacts round which the sweeps circle."""
        began = time.perf_counter()
        control, solver = self.memory.notes.control, self.contact_solver
        slots = solver.slots(0, coupled=self.coupled)
        control[MENDS] += solver.mend(self.problem, self.state, slots, int(control[MENDS]))
        self._clock.seconds["sweeps"] += time.perf_counter() - began

    def _set_watch(self, watch: Watch | None) -> None:
        control = self.memory.notes.control
        control[TIME], control[WALKED], control[TOTAL] = self.time, 0.0, 0.0
        control[WALK_GOAL], control[TOTAL_GOAL] = np.inf, np.inf
        self.tensors[WATCH] = 0.0
        if watch is not None:
            self.tensors[WATCH] = watch.weight
            control[WALK_GOAL], control[TOTAL_GOAL] = watch.walked, watch.total

    def _call(self, law: StepLaw, steps: int) -> None:
        """One call of the kernel."""
        since = time.perf_counter()
        memory, solver = self.memory, self.contact_solver
        memory.notes.clock[PATIENCE] = int(1e9 * SECONDS_OF_A_CALL)
        step = Step(
            bodies=memory.bodies(),
            box=memory.box(),
            pairs=self.candidates.arrays(),
            problem=memory.problem(problem_law(self)),
            state=memory.state(),
            plan=solver.plan(self.candidates.count),
            slots=solver.slots(0, coupled=self.coupled),
            work=solver.work(self.motion),
            notes=memory.notes,
        )
        arguments = (step, law, solve_settings(self), self.like, solver.width, steps)
        try:
            solver.together(advance, arguments)
        except BaseException:
            memory.notes.control[PHASE] = DRIFT
            raise
        self._clock.add(memory.notes.clock, since)

    def search(self) -> None:
        """Find the candidate pairs afresh; gaps are measured separately."""
        began = time.perf_counter()
        check_places(self)
        matrix, origin = self.tensors[MATRIX], self.memory.origin
        shorten_cell(matrix, self.periodic, self.remap, self.candidates.shear_images)
        friction = (self.material.friction, self.material.wall_friction)
        solver = self.contact_solver
        self.candidates.search(
            self.position, self.radius, (matrix, origin, self.periodic), skin_of(self), friction,
            solver.together,
        )  # fmt: skip
        solver.arrange(self.position, matrix, origin)
        self.candidates.divide(solver.chunk, solver.chunk_count)
        self.make_room()
        self.memory.walked[:] = 0.0
        self.memory.notes.control[[STRAIN_WALKED, FARTHEST]] = 0.0
        self.searches += 1
        self._clock.seconds["search"] += time.perf_counter() - began

    def make_room(self) -> None:
        """Memory for the contacts that the candidates can become."""
        count = self.candidates.count
        self.memory.reserve(count)
        self.contact_solver.slots(count // WIDTH + FEWEST_BATCHES, coupled=self.coupled)

    def measure_gaps(self) -> None:
        """Normals, lengths and gaps of the candidates; impulses turn with the normals."""
        self._call(step_law(self), 0)

    @property
    def volume(self) -> float:
        """Cell volume now [m^D]."""
        return float(np.linalg.det(self.matrix))

    def kinetic_ratio(self) -> float:
        """Kinetic energy of the fluctuations / (p V) [-]."""
        energy = kinetic_energy(self.motion, self.grain_count, self.spin_factor, self.like)
        return energy / (self.scales.pressure * self.volume)
