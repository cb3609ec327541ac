"""Momentum, energy, dissipation and stress, step by step in the discrete scheme.

The work theorem of one step holds at the frozen midpoint geometry for any impulses:
ΔK = h Σ m g·c̄ − h V Σ σ_ext·L̄_free − L̄_imposed : Σ P⊗ℓ + Σ P·ū, bars for the mean of
before and after.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics_cases import (
    fixed_cell,
    grains,
    impulse_vectors,
    in_open_space,
    on_floor,
    spin,
    velocity,
)
from scipy.linalg import expm

from granufab.packing import Cell, Packing
from granufab.simulate import (
    Biaxial,
    ConstantMean,
    Isotropic,
    Loading,
    Material,
    SimpleShear,
    Simulation,
    Solver,
)

RIGID_LOOSE = Solver(stiffness=math.inf, tolerance=0.5, max_sweeps=2)
RIGID_TIGHT = Solver(stiffness=math.inf, tolerance=1e-5, max_sweeps=20_000, overlap_correction=0.0)
COMPLIANT = Solver(tolerance=1e-10, max_sweeps=20_000)

LOADINGS = {
    "fixed cell": fixed_cell(),
    "isotropic": Isotropic(),
    "free diagonals": Isotropic(diagonals=True),
    "constant mean": ConstantMean(rate=2e-2),
    "biaxial": Biaxial(axial_rate=2e-2),
    "simple shear": SimpleShear(rate=3e-2),
    "simple shear at constant volume": SimpleShear(rate=3e-2, constant_volume=True),
}


class OneStep:
    """A step, with everything that the balances need before and after it."""

    def __init__(self, simulation: Simulation) -> None:
        s = self.simulation = simulation
        self.free_before, self.rate_before = s.rate - s.loading.rate, s.rate.copy()
        self.motion_before = s.motion.copy()
        kinetic = self._energy()
        volume = np.linalg.det(expm(0.5 * s.step_size * s.rate) @ s.matrix)
        self.report = s.step()
        self.kinetic_change = self._energy() - kinetic
        self.kinetic = self._energy()
        self.volume = float(volume)
        self.free_after = s.rate - s.loading.rate
        self.push = impulse_vectors(s.problem, s.state)
        self.branch = s.problem.normal * s.problem.length[:, None]
        self.virial = self.push.T @ self.branch
        self.contact_velocity = [
            self._relative(self.motion_before, self.rate_before),
            self._relative(s.motion, s.rate),
        ]

    def _energy(self) -> float:
        s = self.simulation
        inertia = s.mass * s.radius**2 * (1 / 2 if s.dimension == 2 else 2 / 5)
        free = s.rate - s.loading.rate
        return float(
            0.5 * (s.mass * (velocity(s) ** 2).sum(axis=1)).sum()
            + 0.5 * (inertia * (spin(s) ** 2).sum(axis=1)).sum()
            + 0.5 * s.cell_inertia * (free**2).sum()
        )

    def _relative(self, motion: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """u in global axes: v_j − v_i + L ℓ − (R_i ω_i + R_j ω_j)×n."""
        problem, dimension = self.simulation.problem, self.simulation.dimension
        n, i, j = problem.normal, problem.first, problem.second
        u = motion[j, :dimension] - motion[i, :dimension] + self.branch @ rate.T
        turning = motion[i] + motion[j]
        if dimension == 2:
            return u - turning[:, 2:3] * np.column_stack([-n[:, 1], n[:, 0]])
        return u - np.cross(turning[:, 3:6], n)

    def work_terms(self) -> list[float]:
        """Gravity, external stress, imposed rates, contacts [J]."""
        s = self.simulation
        mean_velocity = 0.5 * (self.motion_before + s.motion)[: s.grain_count, : s.dimension]
        mean_free = 0.5 * (self.free_before + self.free_after)
        return [
            s.step_size * float((s.mass[:, None] * mean_velocity * s.gravity).sum()),
            -s.step_size * self.volume * float((s.loading.stress * mean_free).sum()),
            -float((s.loading.rate * self.virial).sum()),
            self.contact_work,
        ]

    @property
    def contact_work(self) -> float:
        """Σ P·ū over the contacts, ū the mean of before and after [J]."""
        return 0.5 * float((self.push * sum(self.contact_velocity)).sum())


def _moving(packing: Packing, size: float = 0.1) -> Packing:
    """The packing with random velocities and spins, its centre of mass at rest."""
    generator = np.random.default_rng(11)
    made = packing.grains
    assert made.mass is not None
    v = size * generator.standard_normal((made.count, made.dimension))
    v -= made.mass @ v / made.mass.sum()
    turning = size * generator.standard_normal((made.count, 1 if made.dimension == 2 else 3))
    return Packing(
        grains=grains(made.position, radius=made.radius, mass=made.mass, velocity=v, spin=turning),
        contacts=packing.contacts,
        cell=packing.cell,
    )


def _crystal_3d() -> Packing:
    """27 spheres of three sizes, pressed close, in a periodic cube."""
    steps = np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3)
    radius = np.where(np.arange(27) % 3 == 0, 0.5, 0.46)
    return Packing(
        grains=grains(0.99 * steps + 0.5, radius=radius, mass=radius**3),
        cell=Cell(matrix=np.eye(3) * 0.99 * 3),
    )


@pytest.mark.parametrize("solver", [RIGID_LOOSE, RIGID_TIGHT, COMPLIANT])
@pytest.mark.parametrize("name", LOADINGS)
def test_work_theorem_whatever_the_residual(name, solver, loose):
    packing = _moving(loose)
    simulation = Simulation(
        packing,
        LOADINGS[name],
        material=Material(friction=0.4),
        solver=solver,
        gravity=np.array([0.03, -0.1]),
    )
    for _ in range(4):
        step = OneStep(simulation)
        assert step.report.contacts > 100
        terms = step.work_terms()
        largest = max(abs(term) for term in (*terms, step.kinetic))
        assert abs(step.kinetic_change - sum(terms)) <= 1e-12 * largest
        assert abs(step.contact_work) > 1e-5 * largest


@pytest.mark.parametrize("loading", [Isotropic(dimension=3), Biaxial(axial_rate=0.02, dimension=3)])
def test_work_theorem_of_spheres(loading):
    simulation = Simulation(
        _moving(_crystal_3d()),
        loading,
        material=Material(friction=0.4),
        solver=RIGID_LOOSE,
        gravity=np.array([0.03, -0.1, 0.05]),
    )
    for _ in range(4):
        step = OneStep(simulation)
        assert step.report.contacts > 10
        terms = step.work_terms()
        largest = max(abs(term) for term in (*terms, step.kinetic))
        assert abs(step.kinetic_change - sum(terms)) <= 1e-12 * largest


def test_work_theorem_with_walls_and_gravity():
    stack = grains([[50.0, 0.5], [50.9, 0.98], [50.1, 1.49]], mass=[1.0, 2.0, 0.5])
    simulation = Simulation(
        on_floor(stack),
        fixed_cell(),
        material=Material(friction=0.2, wall_friction=0.1),
        solver=RIGID_TIGHT,
        gravity=np.array([0.2, -1.0]),
        step=1e-2,
    )
    for _ in range(50):
        step = OneStep(simulation)
        terms = step.work_terms()
        largest = max(abs(term) for term in (*terms, step.kinetic))
        assert abs(step.kinetic_change - sum(terms)) <= 1e-12 * largest


@pytest.mark.parametrize("name", LOADINGS)
def test_linear_momentum_is_kept(name, loose):
    simulation = Simulation(
        _moving(loose), LOADINGS[name], material=Material(friction=0.4), solver=RIGID_LOOSE
    )
    for _ in range(10):
        before = simulation.mass @ velocity(simulation)
        simulation.step()
        after = simulation.mass @ velocity(simulation)
        size = (simulation.mass * np.linalg.norm(velocity(simulation), axis=1)).sum()
        assert np.abs(after - before).max() <= 1e-13 * size


def test_spheres_keep_linear_momentum():
    simulation = Simulation(
        _moving(_crystal_3d()), fixed_cell(3), material=Material(friction=0.4), solver=RIGID_LOOSE
    )
    for _ in range(10):
        before = simulation.mass @ velocity(simulation)
        simulation.step()
        change = simulation.mass @ velocity(simulation) - before
        size = (simulation.mass * np.linalg.norm(velocity(simulation), axis=1)).sum()
        assert np.abs(change).max() <= 1e-13 * size


def test_angular_momentum_is_kept_by_touching_grains():
    """At g = 0 the arms R end at the same point, so a collision keeps Σ m r×v + I ω."""
    made = grains(
        [[50.0, 50.0], [50.6, 50.8], [49.0, 50.0]],
        velocity=[[0.3, 0.2], [-0.5, -0.7], [0.9, 0.1]],
        spin=[[0.4], [-0.2], [0.9]],
        mass=[1.0, 1.5, 0.8],
    )
    simulation = Simulation(
        in_open_space(made),
        fixed_cell(),
        material=Material(friction=0.3),
        solver=Solver(stiffness=math.inf, tolerance=1e-12),
        step=1e-9,
    )
    before = _angular_momentum(simulation)
    simulation.step()
    assert len(simulation.problem.length) == 2
    assert np.abs(simulation.state.impulse_t).min() > 0.01
    assert _angular_momentum(simulation) == pytest.approx(before, rel=1e-7)


def _angular_momentum(simulation) -> float:
    r, v = simulation.position, velocity(simulation)
    orbital = r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]
    inertia = simulation.mass * simulation.radius**2 / 2
    return float(simulation.mass @ orbital + inertia @ spin(simulation)[:, 0])


@pytest.mark.parametrize("name", LOADINGS)
def test_contacts_dissipate_and_friction_opposes_slip(name, loose):
    simulation = Simulation(
        _moving(loose), LOADINGS[name], material=Material(friction=0.4), solver=RIGID_TIGHT
    )
    slid = 0
    for _ in range(10):
        step = OneStep(simulation)
        assert step.report.residual <= 1e-3
        normal = simulation.problem.normal
        slip = step.contact_velocity[1]
        slip = slip - np.einsum("ck,ck->c", slip, normal)[:, None] * normal
        power = np.einsum("ck,ck->c", step.push, slip)
        size = np.linalg.norm(step.push, axis=1).max() * np.linalg.norm(slip, axis=1).max()
        assert power.max() <= 10 * step.report.residual * size
        slid += int((power < -1e-3 * size).sum())
        assert step.contact_work <= 0.0
    assert slid > 10


@pytest.mark.parametrize(
    "name", ["isotropic", "free diagonals", "constant mean", "biaxial", "simple shear"]
)
@pytest.mark.parametrize("solver", [RIGID_LOOSE, COMPLIANT])
def test_contact_stress_is_the_external_one_and_the_cells_acceleration(name, solver, loose):
    """V (σ − σ_ext) = M dL/dt on the free components, to round-off at any residual."""
    loading: Loading = LOADINGS[name]
    simulation = Simulation(loose, loading, material=Material(friction=0.4), solver=solver)
    for _ in range(5):
        step = OneStep(simulation)
        rate = (step.free_after - step.free_before) / simulation.step_size
        wanted = loading.stress + simulation.cell_inertia * rate / step.volume
        if loading.dilation:
            found = np.trace(simulation.stress) / 2
            assert found == pytest.approx(np.trace(wanted) / 2, rel=1e-12)
        else:
            free = loading.free
            assert simulation.stress[free] == pytest.approx(wanted[free], rel=1e-12)
        measured = step.virial / (simulation.step_size * step.volume)
        assert simulation.stress == pytest.approx(measured, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("loading", [ConstantMean(rate=1e-3), Biaxial(axial_rate=1e-3)])
def test_momentum_and_plain_sweeps_reach_the_same_velocities(loading, dense):
    """The acceleration changes the way, not the end; judged with springs, where it is unique."""
    reached, sweeps = [], []
    for momentum in (True, False):
        solver = Solver(tolerance=1e-10, max_sweeps=200_000, momentum=momentum)
        simulation = Simulation(dense, loading, material=Material(friction=0.4), solver=solver)
        reports = [simulation.step() for _ in range(5)]
        assert all(report.converged for report in reports)
        reached.append((velocity(simulation), simulation.rate, simulation.stress))
        sweeps.append(sum(report.sweeps for report in reports))
    size = np.abs(reached[0][0]).max()
    assert np.abs(reached[0][0] - reached[1][0]).max() < 2e-5 * size
    assert reached[0][1] == pytest.approx(reached[1][1], abs=1e-9)
    assert reached[0][2] == pytest.approx(reached[1][2], abs=1e-7)
    assert sweeps[0] < sweeps[1] / 3
