"""One Contact Dynamics step, as a list of named stages on a private mutable workspace.

Moreau–Jean midpoint: half drift, contacts and normals there, v_free, solve, half drift. The cell
is one more body in the solve, so stress-driven components need no controller.
"""

from __future__ import annotations

import time

import numpy as np

from granufab.errors import InvalidPacking, InvalidSettings, NotConverged
from granufab.kernels.impulses import apply_impulses
from granufab.kernels.motion import (
    accumulate_drift,
    drift,
    find_missed,
    kinetic_energy,
    virial,
)
from granufab.kernels.problem import Problem, State
from granufab.kernels.select import select_active
from granufab.packing import Array, IntArray, Packing, require
from granufab.simulate.assembly import Buffers, StepLaw, assemble, impulses
from granufab.simulate.bodies import body_records
from granufab.simulate.candidates import Candidates
from granufab.simulate.cell_motion import matrix_exponential, shorten_cell
from granufab.simulate.contact_solver import ContactSolver, Solution
from granufab.simulate.loading import Loading
from granufab.simulate.scales import Scales
from granufab.simulate.settings import Material, Solver
from granufab.simulate.step_report import StepReport

__all__ = ["Simulation"]

MOMENTUM_CAP = 0.9
ACTIVE_MARGIN = 2e-3
MISSED_TOLERANCE = 1e-6
RESOLVES = 3
OVERLAP_LIMIT = 0.5


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
        self.matrix, self.origin = cell.matrix.copy(), np.array(cell.origin)
        self.periodic = np.array(cell.periodic)
        self.rate = np.array(cell.rate)
        self.time = packing.time or 0.0
        self.strain = np.zeros((self.dimension, self.dimension))
        self.remap = np.eye(self.dimension, dtype=np.int64)
        self.gravity = np.zeros(self.dimension) if gravity is None else np.asarray(gravity, float)
        if self.gravity.shape != (self.dimension,):
            raise InvalidSettings(
                f"gravity has shape {self.gravity.shape}, expected {(self.dimension,)}"
            )
        self.rotation = rotation
        self.rate_cap, self.damping = rate_cap, damping
        self.like = (0.0,) * self.dimension
        self.spin_factor = (2.0 if self.dimension == 2 else 2.5) if rotation else 0.0
        self.motion = body_records(packing)
        self.free_motion = self.motion.copy()
        self.contact_solver = ContactSolver(self.grain_count, self.dimension)
        self.walked = np.zeros((self.grain_count, self.dimension))
        self.strain_walked = 0.0
        self.candidates = Candidates(self.grain_count, self.dimension)
        self.stress = np.zeros((self.dimension, self.dimension))
        self.step_size = 0.0
        self.contact_updates = 0
        self.searches = 0
        self.seconds = {"search": 0.0, "geometry": 0.0, "solve": 0.0, "rest": 0.0}
        self.set_loading(loading, step=step)
        self.search()
        self.measure_gaps()
        self.candidates.seed_impulses(
            packing.contacts, packing.wall_contacts, self.step_size, self.remap
        )

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
        difference = self.stress - self.loading.stress
        if self.loading.dilation:
            return abs(float(np.trace(difference))) / self.dimension / self.scales.pressure
        if self.coupled:
            return float(np.abs(difference[self.loading.free]).max()) / self.scales.pressure
        return 0.0

    def remove_drift(self) -> None:
        """Take the centre of mass's velocity out of a fully periodic system."""
        if self.periodic.all():
            velocity = self.motion[: self.grain_count, : self.dimension]
            velocity -= (self.mass @ velocity) / self.mass.sum()

    def stop(self) -> None:
        """End every motion: of the grains, their spins, and the cell."""
        self.motion[:, : self.dimension + self.candidates.tangents] = 0.0
        self.rate = np.zeros_like(self.rate)

    def step(self) -> StepReport:
        """Advance by ``step_size``.

        Raises:
            InvalidPacking: a state is not finite or grains overlap beyond the limit.
            NotConverged: the residual was not met and the solver is ``strict``.
        """
        clock = time.perf_counter()
        rate_before = self.rate.copy()
        self._half_drift()
        if self._needs_search():
            self.search()
        clock = self._tick("search", clock)
        self.measure_gaps()
        self._select()
        self._free_velocities(rate_before)
        clock = self._tick("geometry", clock)
        report = self.last_report = self._solve(rate_before)
        clock = self._tick("solve", clock)
        self._finish()
        self._check(report)
        self._tick("rest", clock)
        return report

    def _tick(self, name: str, since: float) -> float:
        now = time.perf_counter()
        self.seconds[name] += now - since
        return now

    def _half_drift(self) -> None:
        half = 0.5 * self.step_size
        affine = matrix_exponential(half * self.rate)
        drift(self.position, self.motion, affine, half)
        self.matrix = affine @ self.matrix
        self.origin = affine @ self.origin
        self.strain -= half * 0.5 * (self.rate + self.rate.T)
        self.strain_walked += half * float(np.linalg.norm(self.rate))
        self._farthest = accumulate_drift(self.walked, self.motion, half)

    def _needs_search(self) -> bool:
        reach = 2 * float(self.radius.max()) + self._skin
        return 2 * self._farthest + self.strain_walked * reach > self._skin - self._margin

    @property
    def _skin(self) -> float:
        return self.solver.skin * self.scales.diameter

    @property
    def _margin(self) -> float:
        return ACTIVE_MARGIN * self.scales.diameter

    def search(self) -> None:
        """Find the candidate pairs afresh; gaps are measured separately."""
        shorten_cell(self.matrix, self.periodic, self.remap, self.candidates.shear_images)
        cell = (self.matrix, self.origin, self.periodic)
        friction = (self.material.friction, self.material.wall_friction)
        self.candidates.search(self.position, self.radius, cell, self._skin, friction)
        self.contact_solver.arrange(self.position, self.matrix, self.origin)
        self.walked[:] = 0.0
        self.strain_walked = 0.0
        self._farthest = 0.0
        self.searches += 1
        self._buffers = Buffers.of(self.candidates.count, self.dimension)

    def measure_gaps(self) -> None:
        """Normals, lengths and gaps of the candidates at the present positions."""
        self.candidates.measure(self.position, self.radius, self.matrix, self.origin, self.like)

    def _select(self) -> None:
        touching = 1e-10 * self.scales.diameter
        margin = -1.0 if self.material.restitution > 0 else self._margin
        limits = (margin, self.step_size, float(np.linalg.norm(self.rate)), touching)
        c = self.candidates
        select_active(c.pairs, c.gap, c.impulse_n, self.motion, limits, c.active, self.like)

    def _free_velocities(self, rate_before: Array) -> None:
        self.free_motion[:] = self.motion
        rows = self.free_motion[: self.grain_count, : self.dimension]
        rows += self.step_size * self.gravity
        if self.damping:
            self.free_motion[: self.grain_count, : -1 if self.dimension == 2 else -2] *= (
                1 - self.damping
            )
        free = self._free_part(rate_before - self.loading.rate, self.loading)
        free = free * (1 - self.damping)
        push = self.step_size * self.volume / self.cell_inertia
        if self.loading.dilation:
            pressure = np.trace(self.loading.stress) / self.dimension
            free = free - np.eye(self.dimension) * (push * pressure)
        else:
            free = free - np.where(self.loading.free, push * self.loading.stress, 0.0)
        self.free_rate = free

    @property
    def volume(self) -> float:
        """Cell volume now [m^D]."""
        return float(np.linalg.det(self.matrix))

    def _solve(self, rate_before: Array) -> StepReport:
        """Solve, and again while a pair left out of the solve would overlap by its end."""
        sweeps, resolves = 0, 0
        law = self._law()
        self.candidates.remember_tangents()
        while True:
            problem, chosen = assemble(
                self.candidates, self._buffers, law, (self._start_motion(), rate_before), self.like
            )
            found = self._iterate(problem)
            sweeps += found.sweeps
            self.contact_updates += found.sweeps * len(chosen)
            self._store(problem, chosen)
            if self.material.restitution > 0 or resolves == RESOLVES or not self._missed():
                break
            resolves += 1
        overlap = max(0.0, -float(self.candidates.gap.min(initial=0.0))) / self.scales.diameter
        return StepReport(
            sweeps=sweeps,
            residual=found.residual,
            residual_contact=found.residual_contact,
            violation=found.violation * self.step_size / self.scales.diameter,
            overlap=overlap,
            converged=found.residual <= self.solver.tolerance,
            contacts=len(chosen),
            resolves=resolves,
        )

    def _missed(self) -> int:
        c = self.candidates
        tolerance = MISSED_TOLERANCE * self.scales.diameter
        return find_missed(
            c.pairs, c.normal, c.length, c.gap, c.active,
            self.motion, self.rate, self.step_size, tolerance, self.like,
        )  # fmt: skip

    def _law(self) -> StepLaw:
        stiffness = self.solver.stiffness * self.scales.force / self.scales.diameter
        soft = np.isfinite(stiffness) and self.material.restitution == 0
        return StepLaw(
            step=self.step_size,
            softness=1 / (stiffness * self.step_size**2) if soft else 0.0,
            overlap_correction=self.solver.overlap_correction,
            restitution=self.material.restitution,
            spin_factor=self.spin_factor,
            coupled=self.coupled,
            dilation_weight=self.dilation_weight,
            weight=self.weight,
            imposed=self.loading.rate,
        )

    def _start_motion(self) -> Array:
        """Motion at the start of the step: free velocities before gravity acted."""
        if not self.gravity.any():
            return self.free_motion
        start = self.free_motion.copy()
        start[: self.grain_count, : self.dimension] -= self.step_size * self.gravity
        return start

    def _iterate(self, problem: Problem) -> Solution:
        impulse_n, impulse_t = impulses(self._buffers, len(problem.length))
        self.motion[:] = self.free_motion
        state = State(self.motion, self.free_rate.copy(), impulse_n, impulse_t)
        apply_impulses(problem, state, self.like)
        cap = MOMENTUM_CAP if self.solver.momentum else 0.0
        floor = self.scales.force * self.step_size
        settings = (self.solver.tolerance, self.solver.max_sweeps, cap, floor)
        return self.contact_solver.solve(problem, state, settings)

    def _store(self, problem: Problem, chosen: IntArray) -> None:
        """Velocities afresh from the impulses (no drift of round-off), impulses to the list."""
        impulse_n, impulse_t = impulses(self._buffers, len(chosen))
        self.motion[:] = self.free_motion
        self.problem = problem
        self.state = State(self.motion, self.free_rate.copy(), impulse_n, impulse_t)
        apply_impulses(problem, self.state, self.like)
        self.rate = self.loading.rate + self.state.rate
        self.candidates.keep_impulses(chosen, impulse_n, impulse_t)

    def _finish(self) -> None:
        push = virial(self.problem, self.state.impulse_n, self.state.impulse_t, self.like)
        self.stress = push / (self.step_size * self.volume)
        if self.rate_cap is not None:
            free = self.rate - self.loading.rate
            largest = float(np.abs(free).max())
            if largest > self.rate_cap:
                self.rate = self.loading.rate + free * (self.rate_cap / largest)
        self._half_drift()
        self.time += self.step_size

    def _check(self, report: StepReport) -> None:
        if not np.isfinite(self.motion).all() or not np.isfinite(self.rate).all():
            bad = np.flatnonzero(~np.isfinite(self.motion).all(axis=1))[:3]
            raise InvalidPacking(
                f"the velocity of grains {bad.tolist()} is not finite after a step"
            )
        if report.overlap > OVERLAP_LIMIT:
            worst = int(np.argmin(self.candidates.gap))
            i, j = self.candidates.pairs[worst]
            raise InvalidPacking(
                f"grains {i} and {j} overlap by {report.overlap:.2g} diameters, limit "
                f"{OVERLAP_LIMIT}; take a smaller time_step"
            )
        if not report.converged and self.solver.strict:
            raise NotConverged(
                f"a step ended at residual {report.residual:.2e} after {report.sweeps} sweeps, "
                f"tolerance {self.solver.tolerance:.1e}; raise solver.max_sweeps or lower stiffness"
            )

    def kinetic_ratio(self) -> float:
        """Kinetic energy of the fluctuations / (p V) [-]."""
        energy = kinetic_energy(self.motion, self.grain_count, self.spin_factor, self.like)
        return energy / (self.scales.pressure * self.volume)
