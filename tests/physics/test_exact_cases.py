"""Contact Dynamics against motions known in closed form; every case runs rigid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics_cases import (
    RIGID,
    downhill,
    fixed_cell,
    floor,
    grains,
    impulses,
    in_open_space,
    on_floor,
    spin,
    velocity,
)

from granufab.simulate import Material, Simulation, Solver

STEP = 1e-2
POSITION = {2: [50.0, 0.5], 3: [50.0, 50.0, 0.5]}
INERTIA = {2: 1 / 2, 3: 2 / 5}  # I / (m R²)


def simulate(packing, gravity=None, *, material=None, step=STEP, rotation=True, solver=RIGID):
    return Simulation(
        packing,
        fixed_cell(packing.dimension),
        material=material or Material(),
        solver=solver,
        gravity=gravity,
        step=step,
        rotation=rotation,
    )


# --- a ball and the floor ---------------------------------------------------------------------


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_resting_ball_pushes_with_its_weight(dimension):
    mass, g = 2.3, 9.81
    ball = grains([POSITION[dimension]], mass=mass)
    simulation = simulate(on_floor(ball), downhill(0.0, g, dimension))
    for _ in range(20):
        simulation.step()
        push = impulses(simulation)[(0, floor(simulation))]
        assert push[-1] == pytest.approx(-mass * g * STEP, rel=1e-12)
        assert np.abs(push[:-1]).max() == 0.0
    assert np.abs(velocity(simulation)).max() < 1e-14
    assert simulation.position[0] == pytest.approx(POSITION[dimension], rel=1e-14)


@pytest.mark.parametrize("restitution", [0.3, 0.9, 1.0])
def test_each_impact_reverses_the_normal_velocity_by_e(restitution):
    ball = grains([[50.0, 3.0]])
    simulation = simulate(
        on_floor(ball), downhill(0.0), material=Material(restitution=restitution), step=3e-3
    )
    impacts = 0
    while impacts < 4:
        before = velocity(simulation)[0, 1]
        simulation.step()
        after = velocity(simulation)[0, 1]
        if before < 0 < after:
            impacts += 1
            assert after == pytest.approx(-restitution * before, rel=1e-13)
        else:
            assert after == pytest.approx(before - 3e-3, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("step", [4e-3, 1e-3])
def test_impact_speeds_fall_as_powers_of_e(step):
    """The k-th impact comes at e^k v_0 up to a share O(g h/v)."""
    e = 0.8
    simulation = simulate(
        on_floor(grains([[50.0, 2.5]])),
        downhill(0.0),
        material=Material(restitution=e),
        step=step,
    )
    speeds = []
    while len(speeds) < 8:
        before = velocity(simulation)[0, 1]
        simulation.step()
        if velocity(simulation)[0, 1] > 0 > before:
            speeds.append(-before)
    expected = 2.0 * e ** np.arange(8)
    assert np.all(np.abs(speeds - expected) < 4 * step)


def test_without_restitution_a_falling_ball_lands_and_stays():
    simulation = simulate(on_floor(grains([[50.0, 1.0]])), downhill(0.0))
    for _ in range(400):
        simulation.step()
    assert abs(velocity(simulation)).max() < 1e-14
    assert simulation.position[0, 1] == pytest.approx(0.5, abs=1e-14)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_ball_that_leaves_the_floor_is_left_alone(friction):
    """Within reach of the floor, but parting: solved before the first sweep."""
    leaving = grains([[50.0, 0.5005]], velocity=[[0.0, 0.5]])
    simulation = simulate(on_floor(leaving), material=Material(wall_friction=friction), step=1e-3)
    report = simulation.step()
    assert report.contacts == 1
    assert report.converged
    assert report.sweeps == 0
    assert velocity(simulation)[0].tolist() == [0.0, 0.5]


# --- an inclined plane ------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.5, 1 - 1e-9])
def test_a_slider_sticks_below_the_friction_angle(share):
    friction = 0.4
    simulation = simulate(
        on_floor(grains([POSITION[2]])),
        downhill(math.atan(share * friction)),
        material=Material(wall_friction=friction),
        rotation=False,
    )
    for _ in range(50):
        simulation.step()
    assert np.abs(velocity(simulation)).max() < 1e-14


@pytest.mark.parametrize("share", [1 + 1e-6, 2.0])
def test_a_slider_accelerates_above_the_friction_angle(share):
    friction, g, slope = 0.4, 3.0, math.atan(share * 0.4)
    simulation = simulate(
        on_floor(grains([POSITION[2]])),
        downhill(slope, g),
        material=Material(wall_friction=friction),
        rotation=False,
    )
    for _ in range(50):
        simulation.step()
    expected = g * (math.sin(slope) - friction * math.cos(slope)) * simulation.time
    assert velocity(simulation)[0, 0] == pytest.approx(expected, rel=1e-9, abs=1e-14)
    assert np.all(spin(simulation) == 0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_springs_hold_a_static_load(dimension):
    """Compliant contacts: at rest the overlap is N/k and the sideways displacement T/k."""
    stiffness, slope = 1e3, 0.2
    simulation = simulate(
        on_floor(grains([POSITION[dimension]])),
        downhill(slope, 1.0, dimension),
        material=Material(wall_friction=0.5),
        solver=Solver(stiffness=stiffness, tolerance=1e-13, max_sweeps=10_000),
        rotation=False,
        step=0.05,
    )
    for _ in range(200):
        simulation.step()
    moved = simulation.position[0] - POSITION[dimension]
    assert np.abs(velocity(simulation)).max() < 1e-9
    assert moved[-1] == pytest.approx(-math.cos(slope) / stiffness, rel=1e-6)
    assert moved[0] == pytest.approx(math.sin(slope) / stiffness, rel=1e-6)
    assert moved[1:-1] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("share", [0.3, 1 - 1e-6])
def test_a_grain_rolls_without_slip_below_the_rolling_limit(dimension, share):
    """a = g sinα/(1 + I/mR²) where tanα ≤ µ(1 + mR²/I): 2/3 and 3µ, 5/7 and 7µ/2."""
    friction, inertia = 0.2, INERTIA[dimension]
    slope = math.atan(share * friction * (1 + 1 / inertia))
    simulation = _rolled(dimension, slope, friction)
    speed = math.sin(slope) / (1 + inertia) * simulation.time
    assert velocity(simulation)[0, 0] == pytest.approx(speed, rel=1e-12)
    assert abs(spin(simulation)[0]).max() * 0.5 == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("share", [1 + 1e-3, 1.5])
def test_a_grain_slips_above_the_rolling_limit(dimension, share):
    friction, inertia = 0.2, INERTIA[dimension]
    slope = math.atan(share * friction * (1 + 1 / inertia))
    simulation = _rolled(dimension, slope, friction)
    speed = (math.sin(slope) - friction * math.cos(slope)) * simulation.time
    surface = friction * math.cos(slope) / inertia * simulation.time
    assert velocity(simulation)[0, 0] == pytest.approx(speed, rel=1e-12)
    assert abs(spin(simulation)[0]).max() * 0.5 == pytest.approx(surface, rel=1e-12)
    assert surface < speed


def _rolled(dimension, slope, friction):
    simulation = simulate(
        on_floor(grains([POSITION[dimension]])),
        downhill(slope, 1.0, dimension),
        material=Material(wall_friction=friction),
    )
    for _ in range(40):
        simulation.step()
    return simulation


@pytest.mark.parametrize("dimension", [2, 3])
def test_skidding_turns_into_rolling(dimension):
    """Rolls from t = v_0/(µ g (1 + mR²/I)) on, with v = v_0/(1 + I/mR²)."""
    start, friction, inertia = 1.0, 0.1, INERTIA[dimension]
    moving = np.zeros((1, dimension))
    moving[0, 0] = start
    simulation = simulate(
        on_floor(grains([POSITION[dimension]], velocity=moving)),
        downhill(0.0, 1.0, dimension),
        material=Material(wall_friction=friction),
    )
    rolls_at = start / (friction * (1 + 1 / inertia))
    final = start / (1 + inertia)
    while simulation.time < rolls_at + 0.2:
        simulation.step()
        slip = velocity(simulation)[0, 0] - 0.5 * abs(spin(simulation)[0]).max()
        expected = start - friction * simulation.time * (1 + 1 / inertia)
        assert slip == pytest.approx(max(expected, 0.0), abs=1e-12)
    assert velocity(simulation)[0, 0] == pytest.approx(final, rel=1e-12)


# --- several grains ---------------------------------------------------------------------------


def test_a_column_adds_up_its_weight():
    count, mass, g = 8, 0.7, 2.0
    column = grains([[50.0, 0.5 + k] for k in range(count)], mass=mass)
    simulation = simulate(on_floor(column), downhill(0.0, g))
    for _ in range(3):
        simulation.step()
    pushes = impulses(simulation)
    for below in range(count - 1):
        carried = count - 1 - below
        push = pushes[(below, below + 1)]
        assert push[1] == pytest.approx(carried * mass * g * STEP, rel=1e-10)
    assert pushes[(0, floor(simulation))][1] == pytest.approx(-count * mass * g * STEP, rel=1e-10)
    assert np.abs(velocity(simulation)).max() < 1e-11


TOP_NEEDS = math.tan(math.radians(15))
FLOOR_NEEDS = TOP_NEEDS / 3


def _pyramid(between, below):
    bottom = 50.0 + np.array([-0.5, 0.5])
    stack = grains([[bottom[0], 0.5], [bottom[1], 0.5], [50.0, 0.5 + math.sqrt(0.75)]])
    simulation = simulate(
        on_floor(stack),
        downhill(0.0),
        material=Material(friction=between, wall_friction=below),
    )
    for _ in range(100):
        simulation.step()
    return simulation


def test_a_three_disk_pyramid_stands_just_above_its_friction_limits():
    """tan 15° between the disks; one third of it, 0.0893, on the floor."""
    assert pytest.approx(0.0893, abs=5e-5) == FLOOR_NEEDS
    simulation = _pyramid(TOP_NEEDS * (1 + 1e-4), FLOOR_NEEDS * (1 + 1e-4))
    assert np.abs(velocity(simulation)).max() < 1e-10


@pytest.mark.parametrize("shares", [(1 - 1e-3, 1.5), (1.5, 1 - 1e-3)])
def test_a_three_disk_pyramid_collapses_just_below_its_friction_limits(shares):
    simulation = _pyramid(TOP_NEEDS * shares[0], FLOOR_NEEDS * shares[1])
    left, right, top = velocity(simulation)
    assert left[0] < -1e-5
    assert right[0] > 1e-5
    assert top[1] < -1e-5


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("count", [2, 5])
def test_a_struck_chain_of_touching_balls_moves_on_as_one(count, restitution):
    """One u⁻ for the whole solve: v_1 = 1 − (1+e)(n−1)/n, all others (1+e)/n."""
    moving = np.zeros((count, 2))
    moving[0, 0] = 1.0
    chain = grains([[20.0 + k, 50.0] for k in range(count)], velocity=moving)
    simulation = simulate(
        in_open_space(chain),
        material=Material(restitution=restitution),
        solver=RIGID.model_copy(update={"overlap_correction": 0.0}),
    )
    simulation.step()
    speed = velocity(simulation)[:, 0]
    assert speed[0] == pytest.approx(1 - (1 + restitution) * (count - 1) / count, abs=1e-11)
    assert speed[1:] == pytest.approx((1 + restitution) / count, abs=1e-11)
