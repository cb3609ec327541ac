"""Mohr circles against the tensor they stand for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from granufab.errors import InvalidSettings
from granufab.states import (
    AccessibleDomain,
    MohrCircle,
    critical_circle,
    limit_circles,
    mohr,
    tangent_line,
)

THETA = np.linspace(0.0, math.pi, 37)


def project(values: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """G m·m and G m·t of diag(values), m from the first axis towards the last, t clockwise."""
    tensor = np.diag(values)
    m = np.zeros((len(THETA), len(values)))
    t = np.zeros_like(m)
    m[:, 0], m[:, -1] = np.cos(THETA), np.sin(THETA)
    t[:, 0], t[:, -1] = np.sin(THETA), -np.cos(THETA)
    along = m @ tensor
    return (along * m).sum(axis=1), (along * t).sum(axis=1)


@given(z=st.floats(0.5, 8.0), a=st.floats(-2.0, 2.0))
def test_2d_points_are_projections_of_the_tensor(z: float, a: float) -> None:
    fabric = [0.5 + a / 4, 0.5 - a / 4]  # a = 2(F1 − F2), trace 1
    expected = project([0.5 * z * value for value in fabric])
    points = mohr(z, a).points(THETA)
    assert np.allclose(points, expected, atol=1e-12)


@given(z=st.floats(0.5, 8.0), a=st.floats(-1.25, 2.5))
def test_3d_points_are_projections_of_the_tensor(z: float, a: float) -> None:
    axial = (0.8 * a + 1.0) / 3.0  # a = (5/4)(3 F_axial − 1)
    fabric = [axial, 0.5 * (1 - axial), 0.5 * (1 - axial)]
    expected = project([0.5 * z * value for value in fabric])
    circle = mohr(z, a, dimension=3)
    assert np.allclose(circle.points(THETA), expected, atol=1e-12)
    assert pytest.approx(0.5 * z * max(fabric), abs=1e-12) == circle.G_1
    assert pytest.approx(0.5 * z * min(fabric), abs=1e-12) == circle.G_D


@given(z=st.floats(0.5, 8.0), a=st.floats(0.0, 1.2), b=st.floats(0.0, 1.0))
def test_general_3d_circle_spans_the_extreme_principal_values(z: float, a: float, b: float) -> None:
    g_3 = (0.5 * z - (1 + b) * z * a / 5) / 3
    g_1 = g_3 + z * a / 5
    circle = mohr(z, a, dimension=3, b=b)
    assert pytest.approx((g_1, g_3), abs=1e-12) == (circle.G_1, circle.G_D)
    expected = project([g_1, g_3 + b * (g_1 - g_3), g_3])
    assert np.allclose(circle.points(THETA), expected, atol=1e-12)


@pytest.mark.parametrize(
    "case",
    [
        {"dimension": 2},
        {"dimension": 3},
        {"dimension": 3, "mode": "extension"},
        {"dimension": 3, "b": 0.6},
    ],
)
def test_critical_circle_spans_the_limits_and_touches_the_line(case: dict[str, Any]) -> None:
    domain = AccessibleDomain(z_min=3.0, z_max=4.4, **case)
    circle = critical_circle(domain)
    loosest, densest = limit_circles(domain)
    assert pytest.approx(loosest.p_G) == circle.G_D
    assert pytest.approx(densest.p_G) == circle.G_1
    assert loosest.radius == densest.radius == 0.0

    slope, point = tangent_line(domain)
    distance = abs(slope * circle.centre) / math.hypot(slope, 1.0)
    assert distance == pytest.approx(circle.radius)
    assert point[1] == pytest.approx(slope * point[0])
    assert math.hypot(point[0] - circle.centre, point[1]) == pytest.approx(circle.radius)
    normal, tangential = circle.points(np.linspace(0, math.pi, 2000))
    assert np.max(np.abs(tangential) / normal) == pytest.approx(slope, rel=1e-5)


def test_tangent_angle_in_terms_of_the_critical_anisotropy() -> None:
    disks = AccessibleDomain(z_min=3.0, z_max=4.4)
    assert math.sin(disks.tangent_angle) == pytest.approx(disks.a_star / 2)
    spheres = AccessibleDomain(z_min=3.0, z_max=4.4, dimension=3)
    a = spheres.a_star
    assert math.sin(spheres.tangent_angle) == pytest.approx(3 * a / (5 + a))


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((3.5, 2.1), "negative principal value"),
        ((3.5, -1.3, 3), "negative principal value"),
        ((0.0, 0.1), "z is 0.0"),
        ((3.5, math.nan), "finite"),
        ((3.5, 0.1, 5), "must be 2 or 3"),
        ((3.5, 0.1, 2, 0.5), "used in 3D"),
    ],
)
def test_impossible_state_is_refused(arguments: tuple[Any, ...], says: str) -> None:
    with pytest.raises(InvalidSettings, match=says):
        mohr(*arguments)


@given(z=st.floats(0.5, 8.0), a=st.floats(-1.25, 2.5))
def test_the_axisymmetric_points_are_the_formula(z: float, a: float) -> None:
    p, q = z / 6, z * a / 15
    normal, tangential = mohr(z, a, dimension=3).points(THETA)
    assert np.allclose(normal, p + q * (3 * np.cos(THETA) ** 2 - 1), atol=1e-12)
    assert np.allclose(tangential, 1.5 * q * np.sin(2 * THETA), atol=1e-12)


@given(seed=st.integers(0, 10**6))
def test_a_tensor_in_any_frame_gives_back_its_state(seed: int) -> None:
    generator = np.random.default_rng(seed)
    for dimension in (2, 3):
        values = np.sort(generator.uniform(0.1, 1.5, dimension))[::-1]
        turn = np.linalg.qr(generator.normal(size=(dimension, dimension)))[0]
        circle = MohrCircle.from_tensor(turn @ np.diag(values) @ turn.T)
        assert circle.principal == pytest.approx(values, abs=1e-12)
        assert circle.z == pytest.approx(2 * values.sum(), abs=1e-12)
        assert circle.p_G == pytest.approx(values.mean(), abs=1e-12)
        assert circle.q_G == pytest.approx((values[0] - values[-1]) / dimension, abs=1e-12)
        if dimension == 3:
            b = (values[1] - values[2]) / (values[0] - values[2])
            assert circle.b == pytest.approx(b, abs=1e-9)


@given(seed=st.integers(0, 10**6))
def test_projections_on_all_planes_lie_between_the_three_circles(seed: int) -> None:
    generator = np.random.default_rng(seed)
    values = generator.uniform(0.1, 1.5, 3)
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    tensor = turn @ np.diag(values) @ turn.T
    outer, first, second = MohrCircle.from_tensor(tensor).circles
    m = generator.normal(size=(200, 3))
    m /= np.linalg.norm(m, axis=1)[:, None]
    normal = np.einsum("ci,ij,cj->c", m, tensor, m)
    tangential = np.sqrt(np.maximum(((m @ tensor) ** 2).sum(axis=1) - normal**2, 0))
    assert (np.hypot(normal - outer[0], tangential) <= outer[1] + 1e-9).all()
    for centre, radius in (first, second):
        assert (np.hypot(normal - centre, tangential) >= radius - 1e-9).all()


def test_axisymmetric_states_have_one_circle_and_a_point() -> None:
    for circle, point in ((mohr(4.6, 0.3, 3), 2), (mohr(5.0, -0.2, 3), 1)):
        (_, outer), *inner = circle.circles
        assert inner[point - 1][1] == pytest.approx(0.0, abs=1e-12)
        assert inner[2 - point][1] == pytest.approx(outer)
    assert mohr(3.4, 0.2).circles == ((pytest.approx(0.85), pytest.approx(0.085)),)


@pytest.mark.parametrize(
    ("tensor", "says"),
    [
        (np.eye(4), "symmetric, 2×2 or 3×3"),
        ([[1.0, 0.2], [0.1, 1.0]], "symmetric, 2×2 or 3×3"),
        (np.diag([1.0, -0.1]), "none may be negative"),
        (np.zeros((3, 3)), "none may be negative"),
    ],
)
def test_a_tensor_that_is_no_fabric_is_refused(tensor: Any, says: str) -> None:
    with pytest.raises(InvalidSettings, match=says):
        MohrCircle.from_tensor(tensor)
