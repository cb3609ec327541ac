import numpy as np
import pytest
from fabric_cases import (
    body_centred,
    contacts_of,
    draw_plane,
    draw_sphere,
    face_centred,
    hexagonal,
    lattice,
    square,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from granufab.errors import MissingData
from granufab.fabric import (
    anisotropy,
    anisotropy_bias,
    anisotropy_noise,
    deviatoric_part,
    enriched_tensor,
    fabric_tensor,
    fourth_order_tensor,
    intermediate_ratio,
    major_angle,
    major_direction,
    mean_part,
    measure,
    neighbours_within,
    principal_values,
    signed_anisotropy,
)


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize(
    ("packing", "z"),
    [
        (hexagonal(), 6),
        (square(), 4),
        (face_centred(), 12),
        (body_centred(), 8),
        (lattice(np.eye(3)), 6),
    ],
)
def test_lattices_have_their_z_and_are_isotropic_at_second_order(packing, z):
    values = measure(packing, criterion="gap:0.01")
    dimension = packing.dimension
    assert values["z"] == values["z_backbone"] == values["z_mechanical"] == z
    assert values["rattler_fraction"] == 0
    assert abs(values["a"]) < 1e-12
    assert values["p_g"] == pytest.approx(z / (2 * dimension), abs=1e-12)
    assert values["f_xx"] == pytest.approx(1 / dimension, abs=1e-12)


def test_the_fourth_order_tensor_tells_a_square_lattice_from_an_isotropic_state():
    # Isotropic in 2D: <cos⁴> = 3/8, <cos² sin²> = 1/8. Square: 1/2 and 0. Hexagonal is isotropic.
    four = fourth_order_tensor(neighbours_within(square(), 0.01))
    six = fourth_order_tensor(neighbours_within(hexagonal(), 0.01))
    np.testing.assert_allclose([four[0, 0, 0, 0], four[0, 0, 1, 1]], [0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose([six[0, 0, 0, 0], six[0, 0, 1, 1]], [3 / 8, 1 / 8], atol=1e-12)


def test_the_fourth_order_tensor_of_cubic_lattices():
    # Simple cubic: <n_x⁴> = 1/3; FCC normals (±1,±1,0)/√2: <n_x⁴> = (8/12)/4 = 1/6.
    cubic = fourth_order_tensor(neighbours_within(lattice(np.eye(3)), 0.01))
    faces = fourth_order_tensor(neighbours_within(face_centred(), 0.01))
    assert cubic[0, 0, 0, 0] == pytest.approx(1 / 3)
    assert faces[0, 0, 0, 0] == pytest.approx(1 / 6)
    assert faces[0, 0, 1, 1] == pytest.approx(1 / 12)
    assert np.einsum("iijj", faces) == pytest.approx(1.0)
    np.testing.assert_allclose(np.einsum("ijkk", faces), np.eye(3) / 3, atol=1e-12)


STARS = {
    "square": (square(), np.eye(2)),
    "hexagonal": (hexagonal(), [[1, 0], [0.5, np.sqrt(0.75)], [-0.5, np.sqrt(0.75)]]),
    "SC": (lattice(np.eye(3), 3), np.eye(3)),
    "BCC": (body_centred(), [[1, s, t] for s in (1, -1) for t in (1, -1)]),
    "FCC": (face_centred(), [np.roll([1, s, 0], k) for s in (1, -1) for k in range(3)]),
}


@pytest.mark.parametrize("name", STARS)
def test_lattices_have_exactly_the_tensors_of_their_star(name):
    packing, star = STARS[name]
    star = np.array(star, dtype=float)
    star /= np.linalg.norm(star, axis=1)[:, None]
    contacts = neighbours_within(packing, 0.01)
    assert contacts.count == len(star) * packing.grains.count
    dimension = packing.dimension
    np.testing.assert_allclose(fabric_tensor(contacts), np.eye(dimension) / dimension, atol=1e-12)
    wanted = np.mean([np.multiply.outer(np.outer(n, n), np.outer(n, n)) for n in star], axis=0)
    np.testing.assert_allclose(fourth_order_tensor(contacts), wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("dimension", "a"), [(2, 0.0), (2, 0.4), (2, 0.9), (3, -0.4), (3, 0.0), (3, 0.6)]
)
def test_many_draws_scatter_about_their_anisotropy_by_the_noise_floor(dimension, a):
    generator, draws, count = np.random.default_rng(11), 500, 200
    axis = np.array([np.cos(0.7), np.sin(0.7)] if dimension == 2 else [0.6, 0.0, 0.8])
    normal = (
        draw_plane(draws * count, a, 0.7, generator)
        if dimension == 2
        else draw_sphere(draws * count, a, axis, generator)
    )
    found = [
        signed_anisotropy(fabric_tensor(n), axis) for n in normal.reshape(draws, count, dimension)
    ]
    pull = (np.array(found) - a) / anisotropy_noise(count, dimension, a)
    assert abs(pull.mean()) < 3.5 / np.sqrt(draws)
    # χ² of 500 degrees of freedom has the spread √1000.
    assert abs((pull**2).sum() - draws) < 4 * np.sqrt(2 * draws)
    assert (np.abs(pull) > 3).mean() < 0.015


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30)
def test_two_axes_give_the_unsigned_anisotropy_of_a_true_triaxial_state(seed):
    generator = np.random.default_rng(seed)
    for dimension in (2, 3):
        values = np.sort(generator.dirichlet(np.ones(dimension)))[::-1]
        turn = np.linalg.qr(generator.normal(size=(dimension, dimension)))[0]
        fabric = turn @ np.diag(values) @ turn.T
        major, minor = 3.0 * turn[:, 0], -0.5 * turn[:, -1]
        signed = signed_anisotropy(fabric, major, minor=minor)
        assert signed == pytest.approx(anisotropy(fabric), abs=1e-12)
        assert signed_anisotropy(fabric, minor, minor=major) == pytest.approx(-signed, abs=1e-12)
    # About an axis of symmetry one axis says the same as two.
    round_ = turn @ np.diag([values[0], *[(1 - values[0]) / 2] * 2]) @ turn.T
    assert signed_anisotropy(round_, turn[:, 0], minor=turn[:, 1]) == pytest.approx(
        signed_anisotropy(round_, turn[:, 0]), abs=1e-12
    )


@pytest.mark.parametrize(("a", "degrees"), [(0.3, 72.0), (0.8, 170.0), (0.05, 5.0)])
def test_drawn_plane_contacts_give_back_their_anisotropy(a, degrees):
    count, theta = 40_000, np.radians(degrees)
    normal = draw_plane(count, a, theta, np.random.default_rng(1))
    fabric = fabric_tensor(contacts_of(normal))
    noise = anisotropy_noise(count, 2, a)
    assert signed_anisotropy(fabric, np.array([np.cos(theta), np.sin(theta)])) == pytest.approx(
        a, abs=3 * noise
    )
    assert signed_anisotropy(fabric, np.array([-np.sin(theta), np.cos(theta)])) == pytest.approx(
        -a, abs=3 * noise
    )
    assert anisotropy(fabric) == pytest.approx(a, abs=3 * noise + np.pi / (2 * count * a))
    turn = (major_angle(fabric) - degrees + 90) % 180 - 90
    assert abs(np.radians(turn)) < 3 * np.sqrt(2 / count) / (2 * a)


@pytest.mark.parametrize(("a", "axis"), [(0.4, [1, 2, 2]), (-0.3, [0, 1, 1]), (0.0, [0, 0, 1])])
def test_drawn_sphere_contacts_give_back_their_signed_anisotropy(a, axis):
    count = 40_000
    fabric = fabric_tensor(draw_sphere(count, a, axis, np.random.default_rng(2)))
    noise = anisotropy_noise(count, 3, a)
    assert signed_anisotropy(fabric, np.array(axis)) == pytest.approx(a, abs=3 * noise)
    if a > 0:
        # F1 − F3 exceeds the axial value by the spread of the two minor directions.
        assert anisotropy(fabric) == pytest.approx(a, abs=6 * noise)
        alignment = abs(major_direction(fabric) @ np.array(axis)) / np.linalg.norm(axis)
        assert alignment == pytest.approx(1.0, abs=1e-3)


def test_the_noise_floor_is_the_spread_of_independent_draws():
    generator = np.random.default_rng(3)
    for dimension, a in ((2, 0.4), (3, 0.3)):
        axis = np.eye(dimension)[0]
        draws = [
            draw_plane(200, a, 0.0, generator)
            if dimension == 2
            else draw_sphere(200, a, axis, generator)
            for _ in range(600)
        ]
        spread = np.std([signed_anisotropy(fabric_tensor(n), axis) for n in draws])
        # The standard deviation of 600 draws is known to 3 %.
        assert spread == pytest.approx(anisotropy_noise(200, dimension, a), rel=0.1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_unsigned_anisotropy_of_isotropic_draws_is_its_bias(dimension):
    generator = np.random.default_rng(4)
    normal = generator.normal(size=(600, 400, dimension))
    normal /= np.linalg.norm(normal, axis=2)[:, :, None]
    mean = np.mean([anisotropy(fabric_tensor(n)) for n in normal])
    assert mean == pytest.approx(anisotropy_bias(400, dimension), rel=0.06)
    assert anisotropy_bias(400, dimension) > anisotropy_noise(400, dimension)


@given(angle=st.floats(0, 2 * np.pi), seed=st.integers(0, 10**6))
def test_rotation_and_mirror_leave_the_invariants(angle, seed):
    generator = np.random.default_rng(seed)
    phi = generator.uniform(0, np.pi, 25)
    normal = np.column_stack([np.cos(phi), np.sin(phi)])
    before = enriched_tensor(fabric_tensor(normal), 3.3)
    after = enriched_tensor(fabric_tensor(normal @ rotation(angle).T), 3.3)
    np.testing.assert_allclose(principal_values(after), principal_values(before), atol=1e-12)
    mirrored = fabric_tensor(normal * [1, -1])
    theta = major_angle(before)
    assert (major_angle(mirrored) + theta + 1e-9) % 180 == pytest.approx(0, abs=1e-6)
    turned = (major_angle(after) - theta - np.degrees(angle) + 90) % 180 - 90
    assert turned == pytest.approx(0, abs=1e-6 / max(anisotropy(fabric_tensor(normal)), 1e-3))
    np.testing.assert_allclose(fabric_tensor(-normal), fabric_tensor(normal), atol=0)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30)
def test_rotation_in_space_leaves_the_principal_values(seed):
    generator = np.random.default_rng(seed)
    normal = generator.normal(size=(30, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    before, after = fabric_tensor(normal), fabric_tensor(normal @ turn.T)
    np.testing.assert_allclose(principal_values(after), principal_values(before), atol=1e-12)
    assert intermediate_ratio(after) == pytest.approx(intermediate_ratio(before), abs=1e-9)
    np.testing.assert_allclose(
        np.abs(turn @ major_direction(before) @ major_direction(after)), 1.0, atol=1e-6
    )


def test_invariants_of_the_enriched_tensor_follow_the_paper():
    # 2D: p_G = z/4, q_G = z a/8; 3D axisymmetric: p_G = z/6, q_G = z a/15.
    plane = np.diag([0.56, 0.44])
    enriched = enriched_tensor(plane, 3.6)
    assert anisotropy(plane) == pytest.approx(0.24)
    assert mean_part(enriched) == pytest.approx(3.6 / 4)
    assert deviatoric_part(enriched) == pytest.approx(3.6 * 0.24 / 8)
    space = np.diag([0.3, 0.4, 0.3])
    enriched = enriched_tensor(space, 4.5)
    assert anisotropy(space) == pytest.approx(0.25)
    assert signed_anisotropy(space, np.array([0, 2.0, 0])) == pytest.approx(0.25)
    assert mean_part(enriched) == pytest.approx(4.5 / 6)
    assert deviatoric_part(enriched) == pytest.approx(4.5 * 0.25 / 15)
    assert intermediate_ratio(enriched) == pytest.approx(0.0)
    assert intermediate_ratio(np.diag([0.4, 0.2, 0.4])) == pytest.approx(1.0)


def test_the_major_angle_lies_in_its_half_open_range():
    assert major_angle(np.diag([0.6, 0.4])) == 0.0
    assert major_angle(np.diag([0.4, 0.6])) == pytest.approx(90.0)
    assert 0.0 <= major_angle(np.array([[0.6, -1e-18], [-1e-18, 0.4]])) < 180.0


def test_no_contacts_is_said_in_one_line():
    for function in (fabric_tensor, fourth_order_tensor):
        with pytest.raises(MissingData, match="no contacts"):
            function(np.zeros((0, 2)))
    with pytest.raises(MissingData, match="b_G"):
        intermediate_ratio(np.eye(3) / 3)
