"""What must not be felt by the contacts (rigid motions), and crystals with known fabric."""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics_cases import RIGID, grains

from granufab.fabric import fourth_order_tensor, measure, select_contacts
from granufab.kernels.geometry import measure_gaps
from granufab.kernels.motion import relative_velocity
from granufab.kernels.neighbours import find_pairs
from granufab.kernels.problem import Problem
from granufab.packing import Cell, Packing
from granufab.simulate import Isotropic, Material, Simulation, Solver
from granufab.simulate.capture import capture_packing

HEXAGONAL = np.array([[1.0, 0.0], [0.5, math.sqrt(0.75)]])
FACE_CENTRED = np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0]]) / math.sqrt(2)


def _crystal(dimension, repeats=3):
    """Touching unit grains: hexagonal in the plane, face-centred cubic in space."""
    vectors = HEXAGONAL if dimension == 2 else FACE_CENTRED
    steps = np.stack(np.meshgrid(*[np.arange(repeats)] * dimension), axis=-1)
    return steps.reshape(-1, dimension) @ vectors


def _touching(position):
    """The contact geometry of unit grains, as a Problem without offsets."""
    count, dimension = position.shape
    matrix = np.eye(dimension) * 100.0
    radius = np.full(count, 0.5)
    cell = (matrix, np.full(dimension, -50.0), np.ones(dimension, dtype=bool))
    pairs, images = find_pairs(position, radius, cell, 1e-9)
    found = len(pairs)
    normal, length, gap = np.empty((found, dimension)), np.empty(found), np.empty(found)
    measure_gaps(
        position,
        radius,
        matrix,
        np.full(dimension, -50.0),
        pairs,
        images,
        normal,
        length,
        gap,
        (0, found),
        (0.0,) * dimension,
    )
    assert np.abs(gap).max() < 1e-14
    return Problem(
        first=np.ascontiguousarray(pairs[:, 0]),
        second=np.ascontiguousarray(pairs[:, 1]),
        normal=normal,
        length=length,
        offset_n=np.zeros(found),
        offset_t=np.zeros((found, 1 if dimension == 2 else 3)),
        mu=np.full(found, 0.5),
        softness=0.0,
        spin_factor=2.0 if dimension == 2 else 2.5,
        coupled=True,
        dilation_weight=0.0,
        weight=np.zeros((dimension, dimension)),
    )


@pytest.mark.parametrize(("dimension", "rotation"), [(2, [0.7]), (3, [0.3, -0.5, 0.9])])
def test_a_rigid_motion_moves_no_contact(dimension, rotation):
    """v = v_0 + Ω×r with every ω = Ω and touching grains: u = 0 at each contact."""
    position = _crystal(dimension)
    omega = np.array(rotation)
    moving = np.zeros((len(position) + 2 * dimension, 4 if dimension == 2 else 8))
    if dimension == 2:
        turning = omega * np.column_stack([-position[:, 1], position[:, 0]])
    else:
        turning = np.cross(omega, position)
    rows = moving[: len(position)]
    rows[:, :dimension] = turning + np.arange(1, dimension + 1)
    rows[:, dimension : dimension + len(omega)] = 0.5 * omega
    problem = _touching(position)
    count = len(problem.length)
    normal, slip = np.empty(count), np.empty_like(problem.offset_t)
    still = np.zeros((dimension, dimension))
    like = (0.0,) * dimension
    relative_velocity(problem, moving, still, like, normal, slip)
    assert count == {2: 16, 3: 90}[dimension]
    assert np.abs(normal).max() < 1e-14
    assert np.abs(slip).max() < 1e-14
    rows[:, dimension : dimension + len(omega)] *= 1.5
    relative_velocity(problem, moving, still, like, normal, slip)
    assert np.abs(normal).max() < 1e-14
    assert np.abs(slip).max() > 0.1


@pytest.mark.parametrize(("dimension", "rate"), [(2, 0.3), (3, -0.2)])
def test_a_homogeneous_flow_moves_contacts_by_the_gradient_of_its_velocity(dimension, rate):
    """Grains at rest in a cell with L: u = L ℓ."""
    position = _crystal(dimension)
    generator = np.random.default_rng(4)
    flow = rate * generator.standard_normal((dimension, dimension))
    problem = _touching(position)
    count = len(problem.length)
    normal, slip = np.empty(count), np.empty_like(problem.offset_t)
    resting = np.zeros((len(position) + 2 * dimension, 4 if dimension == 2 else 8))
    relative_velocity(problem, resting, flow, (0.0,) * dimension, normal, slip)
    branch = problem.normal * problem.length[:, None]
    expected = branch @ flow.T
    along = np.einsum("ck,ck->c", expected, problem.normal)
    assert normal == pytest.approx(along, abs=1e-15)
    across = np.linalg.norm(expected - along[:, None] * problem.normal, axis=1)
    assert np.linalg.norm(slip, axis=1) == pytest.approx(across, abs=1e-14)


def _pressed(position, matrix, solver):
    """A crystal after one step under p = 1."""
    made = Packing(grains=grains(position), cell=Cell(matrix=matrix))
    simulation = Simulation(
        made, Isotropic(pressure=1.0), material=Material(friction=0.0), solver=solver
    )
    simulation.step()
    assert simulation.last_report.converged
    return simulation


def _hexagonal(side=4):
    position = _crystal(2, side)
    return position, side * np.array([[1.0, 0.5], [0.0, math.sqrt(0.75)]])


def _square(side=4):
    steps = np.stack(np.meshgrid(*[np.arange(side)] * 2), axis=-1).reshape(-1, 2)
    return steps.astype(float), side * np.eye(2)


@pytest.mark.parametrize(
    ("lattice", "z", "force"), [(_hexagonal, 6, 1 / math.sqrt(3)), (_square, 4, 1.0)]
)
def test_crystals_under_pressure(lattice, z, force):
    """Hexagonal: z = 6, f = p d/√3; square: z = 4, f = p d; a = 0 in both.

    The springs of the first step carry 1/(1 + 2mε/z) of the pressure, ε = 1/(k h²).
    """
    position, matrix = lattice()
    compliant = Solver(tolerance=1e-12, max_sweeps=50_000)
    simulation = _pressed(position, matrix, compliant)
    packing = capture_packing(simulation)
    for criterion in ("force", "gap:1e-3"):
        values = measure(packing, criterion=criterion)
        assert values["z"] == values["z_backbone"] == z
        assert values["a"] == pytest.approx(0.0, abs=1e-12)
    contacts = select_contacts(packing, "force")
    assert contacts.force is not None
    size = np.linalg.norm(contacts.force, axis=1)
    pressure = np.trace(simulation.stress) / 2
    assert size == pytest.approx(force * pressure, rel=1e-8)
    softness = 1 / (compliant.stiffness * simulation.step_size**2)
    assert pressure == pytest.approx(1 / (1 + 2 * softness / z), rel=1e-9)


def test_the_fourth_order_fabric_tells_the_square_crystal_from_an_isotropic_state():
    position, matrix = _square()
    contacts = select_contacts(capture_packing(_pressed(position, matrix, RIGID)), "force")
    fourth = fourth_order_tensor(contacts)
    assert fourth[0, 0, 0, 0] == pytest.approx(1 / 2)
    assert fourth[0, 0, 1, 1] == pytest.approx(0.0, abs=1e-15)
    position, matrix = _hexagonal()
    contacts = select_contacts(capture_packing(_pressed(position, matrix, RIGID)), "gap:1e-3")
    assert fourth_order_tensor(contacts)[0, 0, 0, 0] == pytest.approx(3 / 8)
