"""The accessible domain: worked numbers, inverse relations, steric bound."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from granufab.errors import InvalidSettings
from granufab.states import (
    AccessibleDomain,
    exclusion_angle,
    steric_anisotropy,
    steric_coordination,
)

CASES: list[dict[str, Any]] = [
    {"dimension": 2},
    {"dimension": 3},
    {"dimension": 3, "mode": "extension"},
    {"dimension": 3, "b": 0.37},
]
limits = st.tuples(st.floats(1.0, 6.0), st.floats(0.05, 4.0)).map(lambda p: (p[0], p[0] + p[1]))


def test_worked_numbers_in_3d_compression() -> None:
    domain = AccessibleDomain(z_min=4, z_max=6, dimension=3)
    assert domain.z_star == pytest.approx(14 / 3)
    assert domain.a_star == pytest.approx(5 / 14)


@pytest.mark.parametrize(
    ("critical", "expected"),
    [((3.65, 0.20), (3.285, 4.015)), ((3.35, 0.24), (2.948, 3.752))],
    ids=["Fig. 5", "Fig. 7"],
)
def test_limits_behind_the_critical_states_of_the_paper(
    critical: tuple[float, float], expected: tuple[float, float]
) -> None:
    domain = AccessibleDomain.from_critical(*critical)
    assert (domain.z_min, domain.z_max) == pytest.approx(expected, abs=5e-4)


@pytest.mark.parametrize(
    ("case", "z_star", "a_star"),
    [
        ({"dimension": 2}, lambda n, x: (n + x) / 2, lambda n, x: 2 * (x - n) / (x + n)),
        ({"dimension": 3}, lambda n, x: (x + 2 * n) / 3, lambda n, x: 2.5 * (x - n) / (x + 2 * n)),
        (
            {"dimension": 3, "mode": "extension"},
            lambda n, x: (2 * x + n) / 3,
            lambda n, x: 2.5 * (x - n) / (2 * x + n),
        ),
        (
            {"dimension": 3, "b": 0.3},
            lambda n, x: (x + 2 * n + 0.3 * (x - n)) / 3,
            lambda n, x: 2.5 * (x - n) / (x + 2 * n + 0.3 * (x - n)),
        ),
    ],
)
def test_critical_state_is_the_closed_form_of_its_loading(case: Any, z_star: Any, a_star: Any):
    domain = AccessibleDomain(z_min=3.1, z_max=4.9, **case)
    assert domain.z_star == pytest.approx(z_star(3.1, 4.9))
    assert domain.a_star == pytest.approx(a_star(3.1, 4.9))


@pytest.mark.parametrize("case", CASES)
@given(pair=limits)
def test_inverse_undoes_forward(case: dict[str, Any], pair: tuple[float, float]) -> None:
    domain = AccessibleDomain(z_min=pair[0], z_max=pair[1], **case)
    back = AccessibleDomain.from_critical(domain.z_star, domain.a_star, **case)
    assert (back.z_min, back.z_max) == pytest.approx(pair, rel=1e-10)


@pytest.mark.parametrize("case", CASES)
@given(pair=limits)
def test_critical_state_is_the_apex(case: dict[str, Any], pair: tuple[float, float]) -> None:
    domain = AccessibleDomain(z_min=pair[0], z_max=pair[1], **case)
    z, a = domain.z_star, domain.a_star
    assert float(domain.loss_saturation(z)) == pytest.approx(a)
    assert float(domain.gain_saturation(z)) == pytest.approx(a)
    grid = np.linspace(pair[0], pair[1], 301)
    assert np.nanmax(domain.a_max(grid)) <= a * (1 + 1e-12)
    assert domain.contains(z, a)
    assert not domain.contains(z, a * 1.001)


@given(pair=limits)
def test_general_b_ends_at_compression_and_extension(pair: tuple[float, float]) -> None:
    for b, mode in ((0.0, "compression"), (1.0, "extension")):
        general: Any = AccessibleDomain(z_min=pair[0], z_max=pair[1], dimension=3, b=b)
        named: Any = AccessibleDomain(z_min=pair[0], z_max=pair[1], dimension=3, mode=mode)
        assert general.slopes == pytest.approx(named.slopes)
        assert general.z_star == pytest.approx(named.z_star)


@given(
    pair=limits,
    z=st.floats(1.0, 10.0),
    f=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3).map(sorted),
)
def test_3d_domain_is_the_condition_on_the_principal_values(
    pair: tuple[float, float], z: float, f: list[float]
) -> None:
    """Build a tensor G, take a and b from it: inside if and only if its values are."""
    assume(sum(f) > 0.1 and f[2] - f[0] > 1e-3)
    g_3, g_2, g_1 = (0.5 * z * value / sum(f) for value in f)
    anisotropy = 5.0 * (g_1 - g_3) / z
    domain = AccessibleDomain(
        z_min=pair[0], z_max=pair[1], dimension=3, b=min((g_2 - g_3) / (g_1 - g_3), 1.0)
    )
    margin = max(pair[0] - 6 * g_3, 6 * g_1 - pair[1], 0.0)
    assert float(domain.excess(z, anisotropy)) == pytest.approx(margin, abs=1e-9)


def test_lines_in_z_az_are_the_limits_times_z() -> None:
    domain = AccessibleDomain(z_min=3.0, z_max=3.8)
    z = np.linspace(3.0, 3.8, 9)
    assert domain.loss_line(z) == pytest.approx(z * domain.loss_saturation(z))
    assert domain.gain_line(z) == pytest.approx(z * domain.gain_saturation(z))
    assert np.polyfit(z, domain.loss_line(z), 1)[0] == pytest.approx(2.0)
    assert np.polyfit(z, domain.gain_line(z), 1)[0] == pytest.approx(-2.0)


def test_sign_of_a_is_free_in_2d_and_chooses_the_limits_in_3d() -> None:
    disks = AccessibleDomain(z_min=3.0, z_max=4.0)
    assert disks.contains(3.5, -0.25) and disks.contains(3.5, 0.25)
    spheres = AccessibleDomain(z_min=4.0, z_max=6.0, dimension=3)
    turned = AccessibleDomain(z_min=4.0, z_max=6.0, dimension=3, mode="extension")
    assert spheres.contains(turned.z_star, -turned.a_star)
    assert turned.contains(turned.z_star, -turned.a_star)
    assert not spheres.contains(turned.z_star, turned.a_star)


def test_excess_is_the_shift_of_a_limit_that_admits_the_state() -> None:
    domain = AccessibleDomain(z_min=3.0, z_max=3.8)
    state = (3.7, 0.2)
    missing = float(domain.excess(*state))
    assert missing == pytest.approx(3.7 * 1.1 - 3.8)
    assert AccessibleDomain(z_min=3.0, z_max=3.8 + missing).contains(*state)
    assert not AccessibleDomain(z_min=3.0, z_max=3.8 + 0.99 * missing).contains(*state)


def test_no_state_is_accessible_outside_the_isotropic_limits() -> None:
    domain = AccessibleDomain(z_min=3.0, z_max=3.8)
    assert np.isnan(domain.a_max([2.9, 3.9])).all()
    assert domain.a_max([3.0, 3.8]) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert domain.excess([2.9, 3.9], [0.0, 0.0]) == pytest.approx([0.1, 0.1])


def test_steric_line_with_the_fitted_z_max_excludes_the_critical_state_of_the_paper() -> None:
    z_max = AccessibleDomain.from_critical(3.65, 0.20).z_max
    bound = float(steric_anisotropy(3.65, 2 * math.pi / z_max))
    assert bound == pytest.approx(0.156, abs=5e-4)
    assert bound < 0.20


def test_equal_disks_leave_room_for_six() -> None:
    angle = exclusion_angle()
    assert angle == pytest.approx(math.pi / 3)
    assert steric_coordination(angle) == pytest.approx(6.0)
    assert float(steric_anisotropy(6.0, angle)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("z", "angle"), [(3.0, 1.0), (4.2, math.pi / 3)])
def test_steric_bound_fills_the_sector_with_one_contact(z: float, angle: float) -> None:
    a = float(steric_anisotropy(z, angle))
    theta = np.linspace(-angle / 2, angle / 2, 20001)
    density = z / (2 * math.pi) * (1 + a * np.cos(2 * theta))
    assert np.trapezoid(density, theta) == pytest.approx(1.0, abs=1e-8)


def test_exclusion_angle_closes_the_triangle_of_three_disks() -> None:
    radius, first, second = 0.7, 1.3, 0.4
    angle = exclusion_angle(radius, first, second)
    one = (radius + first) * np.array([1.0, 0.0])
    two = (radius + second) * np.array([math.cos(angle), math.sin(angle)])
    assert np.linalg.norm(one - two) == pytest.approx(first + second)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"z_min": 4.0, "z_max": 3.0}, "0 < z_min < z_max"),
        ({"z_min": 0.0, "z_max": 3.0}, "0 < z_min < z_max"),
        ({"z_min": 3.0, "z_max": float("nan")}, "0 < z_min < z_max"),
        ({"z_min": "x", "z_max": 3.0}, "must be a number"),
        ({"z_min": 3.0, "z_max": 4.0, "dimension": 4}, "must be 2 or 3"),
        ({"z_min": 3.0, "z_max": 4.0, "mode": "pull"}, "'compression' or 'extension'"),
        ({"z_min": 3.0, "z_max": 4.0, "b": 0.2}, "b exists only in 3D"),
        ({"z_min": 3.0, "z_max": 4.0, "dimension": 3, "b": 1.2}, "must lie in 0..1"),
    ],
)
def test_wrong_domain_is_one_clear_line(wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidSettings) as caught:
        AccessibleDomain(**wrong)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_critical_state_coordination_and_angle_are_refused() -> None:
    with pytest.raises(InvalidSettings, match="a_star"):
        AccessibleDomain.from_critical(3.5, 2.1)
    with pytest.raises(InvalidSettings, match="a_star"):
        AccessibleDomain.from_critical(3.5, 0.0)
    with pytest.raises(InvalidSettings, match="z_star"):
        AccessibleDomain.from_critical(-1.0, 0.2)
    with pytest.raises(InvalidSettings, match="z holds 0"):
        AccessibleDomain(z_min=3, z_max=4).a_max([3.5, 0.0])
    with pytest.raises(InvalidSettings, match="between 0 and π"):
        steric_coordination(0.0)
    with pytest.raises(InvalidSettings, match="radius"):
        exclusion_angle(radius=-1.0)


def test_domain_is_frozen() -> None:
    domain: Any = AccessibleDomain(z_min=3, z_max=4)
    with pytest.raises(FrozenInstanceError):
        domain.z_min = 2.0


@pytest.mark.parametrize(
    ("case", "z_star", "a_star", "slopes"),
    [
        ({"dimension": 2}, 5.0, 2 / 5, (2, 2)),
        ({"dimension": 3}, 14 / 3, 5 / 14, (5 / 2, 5 / 4)),
        ({"dimension": 3, "mode": "extension"}, 16 / 3, 5 / 16, (5 / 4, 5 / 2)),
        ({"dimension": 3, "b": 0.5}, 5.0, 1 / 3, (5 / 3, 5 / 3)),
    ],
    ids=["2D", "compression", "extension", "b = 1/2"],
)
def test_every_row_of_the_table_between_four_and_six(
    case: dict[str, Any], z_star: float, a_star: float, slopes: tuple[float, float]
) -> None:
    domain = AccessibleDomain(z_min=4, z_max=6, **case)
    assert (domain.z_star, domain.a_star) == pytest.approx((z_star, a_star), rel=1e-12)
    assert domain.slopes == pytest.approx(slopes, rel=1e-12)
    z = np.array([4.2, 5.0, 5.7])
    assert domain.loss_saturation(z) == pytest.approx(slopes[0] * (1 - 4 / z), rel=1e-12)
    assert domain.gain_saturation(z) == pytest.approx(slopes[1] * (6 / z - 1), rel=1e-12)
    # In (z, az): straight, rising from z_min with the one slope, falling to z_max with the other.
    assert domain.loss_line(z) == pytest.approx(slopes[0] * (z - 4), rel=1e-12)
    assert domain.gain_line(z) == pytest.approx(slopes[1] * (6 - z), rel=1e-12)


@given(z=st.floats(2.0, 8.0), a=st.floats(0.01, 1.0))
def test_the_inverse_is_the_closed_form_of_its_loading(z: float, a: float) -> None:
    for case, low, high in (
        ({"dimension": 2}, z * (1 - a / 2), z * (1 + a / 2)),
        ({"dimension": 3}, z * (1 - 2 * a / 5), z * (1 + 4 * a / 5)),
        ({"dimension": 3, "mode": "extension"}, z * (1 - 4 * a / 5), z * (1 + 2 * a / 5)),
    ):
        keywords: dict[str, Any] = case
        domain = AccessibleDomain.from_critical(z, a, **keywords)
        assert (domain.z_min, domain.z_max) == pytest.approx((low, high), rel=1e-12)
        # The sign of a' does not matter to the inverse.
        assert AccessibleDomain.from_critical(z, -a, **keywords) == domain
