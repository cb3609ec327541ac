"""One Contact Dynamics step, as a list of named stages on a private mutable workspace.

Moreau–Jean midpoint: half drift, contacts and normals there, v_free, solve, half drift. The cell
is one more body in the solve, so stress-driven components need no controller.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from granufab.errors import InvalidPacking, NotConverged
from granufab.kernels.motion import (
    accumulate_drift,
    drift,
    find_missed,
    kinetic_energy,
    measure_gaps,
    relative_velocity,
    set_offsets,
    turn_tangents,
    virial,
)
from granufab.kernels.problem import Problem, State
from granufab.kernels.select import select_active
from granufab.kernels.solve import solve
from granufab.kernels.sweep import apply_impulses
from granufab.packing import Array, Packing, require
from granufab.simulate.candidates import Candidates
from granufab.simulate.loading import Loading
from granufab.simulate.settings import Material, Solver

__all__ = ["Scales", "Simulation", "StepReport"]

MOMENTUM_CAP = 0.9
ACTIVE_MARGIN = 2e-3
MISSED_TOLERANCE = 1e-6
RESOLVES = 3
OVERLAP_LIMIT = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Reference scales of a packing under pressure p.

    Attributes:
        diameter: mean diameter d [m].
        mass: mean mass m [kg].
        pressure: p [N/m^(D−1)].
        time: √(m/p) in 2D, √(m/(p d)) in 3D [s].
        inertial_time: I = ε̇_q · this; √(m/p) in 2D, d √(ρ/p) in 3D [s].
        force: p d^{D−1} [N].
    """

    diameter: float
    mass: float
    pressure: float
    time: float
    inertial_time: float
    force: float

    @classmethod
    def of(cls, packing: Packing, pressure: float) -> Scales:
        """Scales of the grains of ``packing``; they need masses."""
        grains = packing.grains
        diameter = float(2 * grains.radius.mean())
        mass = float(require(grains.mass, "grain masses").mean())
        time_scale = float(np.sqrt(mass / (pressure * diameter ** (grains.dimension - 2))))
        inertial = time_scale
        if grains.dimension == 3:
            volume = float((4 / 3 * np.pi * grains.radius**3).mean())
            inertial = diameter * float(np.sqrt(mass / volume / pressure))
        return cls(
            diameter=diameter,
            mass=mass,
            pressure=pressure,
            time=time_scale,
            inertial_time=inertial,
            force=pressure * diameter ** (grains.dimension - 1),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReport:
    """How one step went (see :class:`granufab.history.StepStatistics` for the names)."""

    sweeps: int
    residual: float
    residual_contact: float
    violation: float
    overlap: float
    converged: bool
    contacts: int
    resolves: int


def _matrix_exponential(matrix: Array) -> Array:
    """exp of a small matrix of norm ≪ 1 by its series to fourth order (error ~ |A|⁵/120)."""
    square = matrix @ matrix
    return np.eye(len(matrix)) + matrix + square / 2 + square @ matrix / 6 + square @ square / 24


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
        self.matrix, self.origin = cell.matrix.copy(), cell.origin.copy()
        self.periodic = np.array(cell.periodic)
        self.rate = cell.rate.copy()
        self.time = packing.time or 0.0
        self.strain = np.zeros((self.dimension, self.dimension))
        self.remap = np.eye(self.dimension, dtype=np.int64)
        self.gravity = np.zeros(self.dimension) if gravity is None else np.asarray(gravity, float)
        self.rotation = rotation
        self.rate_cap, self.damping = rate_cap, damping
        self.like = (0.0,) * self.dimension
        self.spin_factor = (2.0 if self.dimension == 2 else 2.5) if rotation else 0.0
        self._make_motion(packing)
        self.candidates = Candidates(self.grain_count, self.dimension)
        self.stress = np.zeros((self.dimension, self.dimension))
        self.step_size = 0.0
        self.contact_updates = 0
        self.searches = 0
        self.seconds = {"search": 0.0, "geometry": 0.0, "solve": 0.0, "rest": 0.0}
        self.set_loading(loading, step=step)
        self._search()
        self._measure_gaps()
        self.candidates.seed_impulses(packing.contacts, packing.wall_contacts, self.step_size)

    # --- setting up -----------------------------------------------------------------------

    def _make_motion(self, packing: Packing) -> None:
        grains, dimension = packing.grains, self.dimension
        spins = 1 if dimension == 2 else 3
        width = 4 if dimension == 2 else 8
        self.motion = np.zeros((self.grain_count + 2 * dimension, width))
        rows = self.motion[: self.grain_count]
        if grains.velocity is not None:
            rows[:, :dimension] = grains.velocity
        if grains.spin is not None:
            rows[:, dimension : dimension + spins] = grains.spin * self.radius[:, None]
        rows[:, dimension + spins] = 1.0 / self.mass
        self.free_motion = self.motion.copy()
        self._before_motion = self.motion.copy()
        self.walked = np.zeros((self.grain_count, dimension))
        self.strain_walked = 0.0

    def set_loading(self, loading: Loading, *, step: float | None = None) -> None:
        """Change what drives the cell; impulses are rescaled to the new time step."""
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
        rate = abs(loading.deviatoric_rate)
        return min(step, self.solver.step_strain / rate) if rate > 0 else step

    def step_size_limit(self, strain: float, rate: float) -> None:
        """Shorten the step so that a whole number of them makes ``strain`` at ``rate``."""
        steps = max(1, int(np.ceil(strain / (rate * self.step_size) - 1e-9)))
        self.set_loading(self.loading, step=strain / rate / steps)

    def virial_of_impulses(self) -> None:
        """Stress of the impulses that the candidates hold now, before any solve."""
        c = self.candidates
        force = c.normal * c.impulse_n[:, None]
        if self.dimension == 2:
            tangent = np.stack([-c.normal[:, 1], c.normal[:, 0]], axis=1)
            force = force + tangent * c.impulse_t
        else:
            force = force + c.impulse_t
        branch = c.normal * c.length[:, None]
        self.stress = force.T @ branch / (self.step_size * self.volume)

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
            rows = self.motion[: self.grain_count, : self.dimension]
            rows -= (self.mass @ rows) / self.mass.sum()

    # --- one step -------------------------------------------------------------------------

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
            self._search()
        clock = self._tick("search", clock)
        self._measure_gaps()
        self._select()
        self._free_velocities(rate_before)
        clock = self._tick("geometry", clock)
        report = self._solve(rate_before)
        clock = self._tick("solve", clock)
        self._finish(rate_before)
        self._check(report)
        self.last_report = report
        self._tick("rest", clock)
        return report

    def _tick(self, name: str, since: float) -> float:
        now = time.perf_counter()
        self.seconds[name] += now - since
        return now

    def _half_drift(self) -> None:
        half = 0.5 * self.step_size
        affine = _matrix_exponential(half * self.rate)
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

    def _search(self) -> None:
        self._remap()
        self.candidates.search(
            self.position,
            self.radius,
            (self.matrix, self.origin, self.periodic),
            self._skin,
            (self.material.friction, self.material.wall_friction),
        )
        self.walked[:] = 0.0
        self.strain_walked = 0.0
        self._farthest = 0.0
        self.searches += 1
        self._resize(self.candidates.count)

    def _remap(self) -> None:
        """Replace a lattice vector tilted beyond 1/2 by its shorter equivalent."""
        for axis in range(self.dimension):
            for flow in range(self.dimension):
                if axis == flow or not (self.periodic[axis] and self.periodic[flow]):
                    continue
                turns = round(self.matrix[flow, axis] / self.matrix[flow, flow])
                if abs(self.matrix[flow, axis]) > 0.5001 * self.matrix[flow, flow] and turns:
                    self.matrix[:, axis] -= turns * self.matrix[:, flow]
                    self.candidates.shear_images(flow, axis, turns)
                    self.remap[:, axis] -= turns * self.remap[:, flow]

    def _resize(self, count: int) -> None:
        tangents = self.candidates.tangents
        self._normal = np.empty((count, self.dimension))
        self._length, self._offset_n, self._bounce = np.empty((3, count))
        self._offset_t, self._impulse_t, self._old_t, self._slip = np.empty((4, count, tangents))
        self._impulse_n, self._before_n = np.empty((2, count))
        self._before_t = np.empty((count, tangents))

    def _measure_gaps(self) -> None:
        c = self.candidates
        measure_gaps(
            self.position,
            self.radius,
            self.matrix,
            self.origin,
            c.pairs,
            c.images,
            self.grain_count,
            c.normal,
            c.length,
            c.gap,
        )
        if self.dimension == 3:
            turn_tangents(c.impulse_t, c.normal, self.like)

    def _select(self) -> None:
        c = self.candidates
        margin = -1.0 if self.material.restitution > 0 else self._margin
        select_active(
            c.pairs,
            c.gap,
            c.impulse_n,
            self.motion,
            (margin, self.step_size, float(np.linalg.norm(self.rate)), 1e-10 * self.scales.diameter),
            c.active,
            self.like,
        )

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
        sweeps, resolves = 0, 0
        while True:
            problem, state, before = self._assemble(rate_before)
            count, residual, share, violation = self._iterate(problem, state, before)
            sweeps += count
            self.contact_updates += count * len(problem.length)
            self._store(problem, state)
            missed = 0
            if self.material.restitution == 0 and resolves < RESOLVES:
                c = self.candidates
                missed = find_missed(
                    c.pairs,
                    c.normal,
                    c.length,
                    c.gap,
                    c.active,
                    self.motion,
                    self.rate,
                    self.step_size,
                    MISSED_TOLERANCE * self.scales.diameter,
                    self.like,
                )
            if not missed:
                break
            resolves += 1
        overlap = max(0.0, -float(self.candidates.gap.min(initial=0.0))) / self.scales.diameter
        return StepReport(
            sweeps=sweeps,
            residual=residual,
            residual_contact=share,
            violation=violation * self.step_size / self.scales.diameter,
            overlap=overlap,
            converged=residual <= self.solver.tolerance,
            contacts=len(problem.length),
            resolves=resolves,
        )

    def _assemble(self, rate_before: Array) -> tuple[Problem, State, State]:
        c = self.candidates
        chosen = np.flatnonzero(c.active)
        count = len(chosen)
        self._chosen = chosen
        pairs = c.pairs[chosen]
        np.take(c.normal, chosen, axis=0, out=self._normal[:count])
        np.take(c.length, chosen, out=self._length[:count])
        np.take(c.impulse_n, chosen, out=self._impulse_n[:count])
        np.take(c.impulse_t, chosen, axis=0, out=self._impulse_t[:count])
        self._old_t[:count] = self._impulse_t[:count]
        stiffness = self.solver.stiffness * self.scales.force / self.scales.diameter
        softness = 0.0
        if np.isfinite(stiffness) and self.material.restitution == 0:
            softness = 1 / (stiffness * self.step_size**2)
        problem = Problem(
            first=np.ascontiguousarray(pairs[:, 0]),
            second=np.ascontiguousarray(pairs[:, 1]),
            normal=self._normal[:count],
            length=self._length[:count],
            offset_n=self._offset_n[:count],
            offset_t=self._offset_t[:count],
            mu=c.friction[chosen],
            softness=softness,
            spin_factor=self.spin_factor,
            coupled=self.coupled,
            dilation_weight=self.dilation_weight,
            weight=self.weight,
        )
        bounce = self._bounce[:count]
        bounce[:] = 0.0
        restitution = self.material.restitution
        if restitution > 0:
            relative_velocity(
                problem, self._step_start_motion(), rate_before, self.like, bounce,
                self._slip[:count],
            )
            bounce *= restitution
        set_offsets(
            problem,
            c.gap[chosen],
            self.loading.rate,
            bounce,
            (self.step_size, self.solver.overlap_correction, restitution),
            self._old_t[:count],
            self.like,
        )
        self.motion[:] = self.free_motion
        state = State(
            self.motion, self.free_rate.copy(), self._impulse_n[:count], self._impulse_t[:count]
        )
        apply_impulses(problem, state, self.like)
        before = State(
            self._before_motion,
            np.empty_like(self.free_rate),
            self._before_n[:count],
            self._before_t[:count],
        )
        return problem, state, before

    def _step_start_motion(self) -> Array:
        """Motion at the start of the step (free velocities before gravity acted)."""
        start = self.free_motion.copy()
        start[: self.grain_count, : self.dimension] -= self.step_size * self.gravity
        return start

    def _iterate(self, problem: Problem, state: State, before: State):
        cap = MOMENTUM_CAP if self.solver.momentum else 0.0
        floor = self.scales.force * self.step_size
        lag = min(64, max(1, len(problem.length) // 50))
        settings = (self.solver.tolerance, self.solver.max_sweeps, cap, floor, lag)
        return solve(problem, state, before, self.like, settings)

    def _store(self, problem: Problem, state: State) -> None:
        """Velocities afresh from the impulses (no drift of round-off), impulses to the list."""
        self.motion[:] = self.free_motion
        rate = self.free_rate.copy()
        final = State(self.motion, rate, state.impulse_n, state.impulse_t)
        apply_impulses(problem, final, self.like)
        c = self.candidates
        c.impulse_n[:] = 0.0
        c.impulse_t[:] = 0.0
        c.impulse_n[self._chosen] = state.impulse_n
        c.impulse_t[self._chosen] = state.impulse_t
        self.rate = self.loading.rate + rate
        self.problem, self.state = problem, final

    def _finish(self, rate_before: Array) -> None:
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
            raise InvalidPacking(f"the velocity of grains {bad.tolist()} is not finite after a step")
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
