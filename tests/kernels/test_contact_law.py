"""The exact local solution against the words of the law: Signorini and Coulomb."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numba import njit

from granufab.kernels import contact_law

numbers = st.floats(-5, 5, allow_nan=False).map(lambda x: 0.0 if abs(x) < 1e-6 else x)
positive = st.floats(0.05, 5)
frictions = st.one_of(st.just(0.0), st.floats(0.0, 1.5))
impulses = st.floats(0, 5).map(lambda x: 0.0 if x < 1e-6 else x)


@njit
def separate_law(*arguments):
    return contact_law.separate_law(*arguments)


@njit
def slide_or_stick(*arguments):
    return contact_law.slide_or_stick(*arguments)


@njit
def cone_defect(*arguments):
    return contact_law.cone_defect(*arguments)


TOLERANCE = 1e-9
EXAMPLES = settings(deadline=None, derandomize=True, max_examples=300)  # the first compiles


def assert_law(p_n, p_t, u_n, u_t, mu):
    """0 ≤ u_n ⟂ P_n ≥ 0, |P_t| ≤ µ P_n, stick or slip against P_t; arrays P_t, u_t."""
    p_t, u_t = np.atleast_1d(p_t), np.atleast_1d(u_t)
    assert p_n >= 0
    assert u_n >= -TOLERANCE
    assert p_n * u_n <= TOLERANCE * max(1.0, p_n)
    size, slip = np.linalg.norm(p_t), np.linalg.norm(u_t)
    assert size <= mu * p_n + TOLERANCE
    if size < mu * p_n - TOLERANCE:
        assert slip <= TOLERANCE
    if p_n > 0:
        assert p_t @ u_t <= TOLERANCE
        assert abs(p_t @ u_t + size * slip) <= TOLERANCE * max(1.0, size * slip)


@EXAMPLES
@given(impulses, numbers, numbers, numbers, positive, positive, frictions)
def test_uncoupled_disks(p_n, p_t, u_n, u_t, w_n, w_t, mu):
    new_n, (new_t,) = separate_law(p_n, (p_t,), u_n, (u_t,), 1 / w_n, 1 / w_t, mu)
    after_n, after_t = u_n + w_n * (new_n - p_n), u_t + w_t * (new_t - p_t)
    assert_law(new_n, new_t, after_n, after_t, mu)


@EXAMPLES
@given(
    impulses,
    st.tuples(numbers, numbers),
    numbers,
    st.tuples(numbers, numbers),
    positive,
    positive,
    frictions,
    st.floats(0, 2 * math.pi),
)
def test_uncoupled_spheres(p_n, p_t, u_n, u_t, w_n, w_t, mu, turn):
    """In a plane of any orientation in space."""
    axis = np.array([math.cos(turn), math.sin(turn), 0.0])
    other = np.array([0.0, 0.0, 1.0])
    p = p_t[0] * axis + p_t[1] * other
    u = u_t[0] * axis + u_t[1] * other
    now, speed = tuple(map(float, p)), tuple(map(float, u))
    new_n, new_t = separate_law(p_n, now, u_n, speed, 1 / w_n, 1 / w_t, mu)
    after_n, after_t = u_n + w_n * (new_n - p_n), u + w_t * (np.array(new_t) - p)
    assert_law(new_n, new_t, after_n, after_t, mu)


@EXAMPLES
@given(impulses, numbers, numbers, numbers, positive, positive, st.floats(-0.95, 0.95), frictions)
def test_coupled_disks(p_n, p_t, u_n, u_t, w_nn, w_tt, share, mu):
    w_nt = share * math.sqrt(w_nn * w_tt)
    assume(w_nn > 1.05 * mu * abs(w_nt))
    new_n, new_t = slide_or_stick(p_n, p_t, u_n, u_t, w_nn, w_nt, w_tt, mu)
    after_n = u_n + w_nn * (new_n - p_n) + w_nt * (new_t - p_t)
    after_t = u_t + w_nt * (new_n - p_n) + w_tt * (new_t - p_t)
    assert_law(new_n, new_t, after_n, after_t, mu)


@EXAMPLES
@given(numbers, numbers, positive, positive, st.floats(-0.9, 0.9), st.floats(0.01, 1.0))
def test_coupled_disks_against_all_four_cases(b_n, b_t, w_nn, w_tt, share, mu):
    """Separation, stick and the two slips tried in turn: the one that fits is returned."""
    w_nt = share * math.sqrt(w_nn * w_tt)
    assume(w_nn > 1.1 * mu * abs(w_nt))
    matrix, free = np.array([[w_nn, w_nt], [w_nt, w_tt]]), np.array([b_n, b_t])
    candidates = [np.zeros(2), np.linalg.solve(matrix, -free)]
    candidates += [-b_n / (w_nn + s * mu * w_nt) * np.array([1, s * mu]) for s in (1, -1)]
    fitting = []
    for k, p in enumerate(candidates):
        u = matrix @ p + free
        inside = p[0] >= -1e-12 and abs(p[1]) <= mu * p[0] + 1e-12 and u[0] >= -1e-9
        if inside and (k < 2 or p[1] * u[1] <= 1e-12):
            fitting.append(p)
    found = slide_or_stick(0.0, 0.0, b_n, b_t, w_nn, w_nt, w_tt, mu)
    assert fitting
    assert min(np.abs(np.array(found) - p).max() for p in fitting) < 1e-8


@EXAMPLES
@given(impulses, numbers, numbers, numbers, positive, positive, frictions)
def test_the_result_does_not_depend_on_the_impulse_it_starts_from(p_n, p_t, b_n, b_t, w_n, w_t, mu):
    """u is affine in P, so only b = u − W P matters."""
    cold = separate_law(0.0, (0.0,), b_n, (b_t,), 1 / w_n, 1 / w_t, mu)
    warm = separate_law(p_n, (p_t,), b_n + w_n * p_n, (b_t + w_t * p_t,), 1 / w_n, 1 / w_t, mu)
    assert warm[0] == pytest.approx(cold[0], abs=1e-9)
    assert warm[1][0] == pytest.approx(cold[1][0], abs=1e-9)


# --- the measure of distance from the law -----------------------------------------------------


@EXAMPLES
@given(impulses, numbers, numbers, numbers, positive, positive, frictions, positive)
@example(0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0)
def test_the_defect_vanishes_at_solutions(p_n, p_t, u_n, u_t, w_n, w_t, mu, rho):
    new_n, (new_t,) = separate_law(p_n, (p_t,), u_n, (u_t,), 1 / w_n, 1 / w_t, mu)
    after_n, after_t = u_n + w_n * (new_n - p_n), u_t + w_t * (new_t - p_t)
    size = 1 + new_n + rho * (abs(after_n) + abs(after_t))
    assert cone_defect(new_n, (new_t,), after_n, (after_t,), rho, mu) <= (1e-9 * size) ** 2


@pytest.mark.parametrize(
    ("p_n", "p_t", "u_n", "u_t"),
    [
        (1.0, 0.0, 0.1, 0.0),  # pushes though it parts
        (0.0, 0.0, -0.1, 0.0),  # penetrates
        (1.0, 0.5, 0.0, 0.0),  # outside the cone
        (1.0, 0.1, 0.0, 0.2),  # slips inside the cone
        (1.0, 0.3, 0.0, 0.2),  # slips along its friction
    ],
)
def test_the_defect_sees_every_way_of_breaking_the_law(p_n, p_t, u_n, u_t):
    assert cone_defect(p_n, (p_t,), u_n, (u_t,), 1.0, 0.3) > 1e-4


def test_friction_against_slip_is_no_defect():
    assert cone_defect(1.0, (0.3,), 0.0, (-0.2,), 1.0, 0.3) == pytest.approx(0.0, abs=1e-30)
    assert cone_defect(1.0, (0.0, -0.3, 0.0), 0.0, (0.0, 0.7, 0.0), 0.4, 0.3) == pytest.approx(
        0.0, abs=1e-30
    )


@EXAMPLES
@given(impulses, numbers, numbers, numbers, positive, st.floats(0.05, 1.5))
def test_the_defect_is_the_distance_to_the_nearest_point_of_the_cone(p_n, p_t, u_n, u_t, rho, mu):
    """No other point of the cone lies nearer to P − ρ(u + µ|u_t| n) than the projection."""
    trial = np.array([p_n - rho * (u_n + mu * abs(u_t)), p_t - rho * u_t])
    edges = [np.array([1.0, s * mu]) / math.hypot(1.0, mu) for s in (1, -1)]
    points = [max(0.0, trial @ edge) * edge for edge in edges]
    if abs(trial[1]) <= mu * trial[0]:
        points.append(trial)
    nearest = min(points, key=lambda point: np.linalg.norm(trial - point))
    expected = np.sum((np.array([p_n, p_t]) - nearest) ** 2)
    assert cone_defect(p_n, (p_t,), u_n, (u_t,), rho, mu) == pytest.approx(expected, abs=1e-9)
