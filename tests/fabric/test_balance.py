"""The balance of contacts closes in whole numbers, and each term is what was done to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from balance_cases import all_pairs, at_angles, residue, rotation_2d, state, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from granufab.errors import InvalidPacking, InvalidSettings, MissingData
from granufab.fabric import affine_turning, balance
from granufab.packing import Cell, Contacts


def listed(before, after, **options):
    return balance(before, after, criterion="listed", **options)


def unit(generator, count, dimension):
    vector = generator.normal(size=(count, dimension))
    return vector / np.linalg.norm(vector, axis=1)[:, None]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), dimension=st.sampled_from([2, 3]), bins=st.integers(2, 30))
def test_any_two_sets_of_contacts_close(seed: int, dimension: int, bins: int) -> None:
    generator = np.random.default_rng(seed)
    pairs = all_pairs(9, 36)
    chosen = [np.flatnonzero(generator.random(36) < generator.random()) for _ in range(2)]
    states = [
        state(pairs[rows], unit(generator, len(rows), dimension).reshape(-1, dimension),
              grain_count=9)
        for rows in chosen
    ]  # fmt: skip
    data = listed(*states, bins=bins, direction=unit(generator, 1, dimension)[0])
    assert not residue(data).any()
    old, new = (set(rows.tolist()) for rows in chosen)
    assert int(data["gained"]) == int(data["gain"].sum()) == len(new - old)
    assert int(data["lost"]) == int(data["loss"].sum()) == len(old - new)
    assert int(data["persistent"]) == len(old & new)
    current = data["current"].to_numpy()
    assert current[0] == current[-1]
    if dimension == 3:
        assert current[0] == 0
    for quantity in ("z", "az"):
        parts = sum(float(data[f"{quantity}_{part}"]) for part in ("gain", "loss", "rotation"))
        change = float(data[f"{quantity}_after"] - data[f"{quantity}_before"])
        assert parts == pytest.approx(change, abs=1e-13)


@pytest.mark.parametrize("angle", [10.0, 30.0, 7.3, -10.0, -41.9, 88.0])
def test_a_rigid_rotation_has_the_exact_current(angle: float) -> None:
    degrees = np.random.default_rng(1).random(400) * 180
    before = state(all_pairs(40, 400), at_angles(degrees))
    data = listed(before, turned(before, rotation_2d(np.radians(angle))), bins=18)
    assert int(data["gained"]) == int(data["lost"]) == 0
    assert not residue(data).any()
    for edge, current in zip(range(0, 181, 10), data["current"].to_numpy(), strict=True):
        ahead = (degrees - edge) % 180 if angle < 0 else (edge - degrees) % 180
        crossing = np.count_nonzero(ahead <= abs(angle))
        assert current == np.sign(angle) * crossing
    # All contacts turn alike, so that none crosses an edge backwards.
    np.testing.assert_array_equal(data["crossings"], np.abs(data["current"]))


@pytest.mark.parametrize("axis", ["around", "across"])
def test_a_rigid_rotation_of_spheres(axis: str) -> None:
    before = state(all_pairs(40, 500), unit(np.random.default_rng(2), 500, 3))
    turn = {"around": [0, 0, 0.7], "across": [0.35, 0, 0]}[axis]
    after = turned(before, Rotation.from_rotvec(turn).as_matrix())
    data = listed(before, after, bins=10, direction=np.array([0, 0, 2.0]))
    assert int(data["gained"]) == int(data["lost"]) == 0
    assert not residue(data).any()
    heights = [np.abs(s.contacts.normal[:, 2]) for s in (before, after)]
    for edge, current in enumerate(data["current"].to_numpy()[:-1]):
        above = [int(np.count_nonzero(height > 1 - edge / 10)) for height in heights]
        assert current == above[0] - above[1]  # of those above the edge, so many went below
    assert (data["current"] != 0).any() == (axis == "across")


def test_a_contact_crosses_every_edge_on_its_way() -> None:
    data = listed(state([[0, 1]], at_angles([12])), state([[0, 1]], at_angles([47])), bins=18)
    np.testing.assert_array_equal(np.flatnonzero(data["current"]), [2, 3, 4])
    assert int(data["current"].sum()) == 3
    np.testing.assert_array_equal(np.flatnonzero(data["current_in"]), [2, 3, 4])
    np.testing.assert_array_equal(np.flatnonzero(data["current_out"]), [1, 2, 3])


def test_the_shorter_way_round() -> None:
    data = listed(state([[0, 1]], at_angles([175])), state([[0, 1]], at_angles([5])), bins=18)
    np.testing.assert_array_equal(np.flatnonzero(data["current"]), [0, 18])  # one and the same edge
    assert int(data["current"][0]) == 1
    back = listed(state([[0, 1]], at_angles([5])), state([[0, 1]], at_angles([175])), bins=18)
    assert int(back["current"][0]) == -1


def test_a_normal_through_the_equator_is_reflected() -> None:
    def tilted(degrees):
        angle = np.radians(degrees)
        return state([[0, 1]], [[np.sin(angle), 0, np.cos(angle)]])

    data = listed(tilted(88), tilted(92), bins=20)
    assert not data["current"].any()
    assert int(data["before"][-1]) == int(data["after"][-1]) == 1


def test_names_of_grains_and_order_of_pairs_do_not_matter() -> None:
    generator = np.random.default_rng(3)
    pairs = all_pairs(30, 300)
    normals = [unit(generator, 300, 2) for _ in range(2)]
    image = generator.integers(-1, 2, size=(300, 2))
    first, second = (generator.random(300) < 0.7 for _ in range(2))
    before = state(pairs[first], normals[0][first], grain_count=30, image=image[first])
    after = state(pairs[second], normals[1][second], grain_count=30, image=image[second])
    other = _relabelled(after, generator)
    one, two = listed(before, after), listed(before, other)
    for name in one.data_vars:
        np.testing.assert_allclose(one[name], two[name], atol=1e-14, err_msg=str(name))
    assert 0 < int(one["persistent"]) < 300


def _relabelled(packing, generator):
    """Grains in another order with their numbers, pairs in another order, half of them turned."""
    order = generator.permutation(packing.grains.count)
    contacts = packing.contacts
    rows = generator.permutation(contacts.count)
    swap = generator.random(contacts.count) < 0.5
    pair = np.argsort(order)[contacts.pair[rows]]
    sign = np.where(swap, -1, 1)[:, None]
    moved = Contacts(
        pair=np.where(swap[:, None], pair[:, ::-1], pair),
        normal=contacts.normal[rows] * sign,
        image=contacts.image[rows] * sign,
    )
    grains = replace(
        packing.grains,
        position=packing.grains.position[order],
        radius=packing.grains.radius[order],
        number=packing.grains.number[order],
    )
    return replace(packing, grains=grains, contacts=moved)


def test_another_image_of_a_grain_is_another_contact() -> None:
    here = state([[0, 1]], at_angles([20]))
    there = state([[0, 1]], at_angles([20]), image=np.array([[1, 0]]))
    data = listed(here, there)
    assert (int(data["gained"]), int(data["lost"]), int(data["persistent"])) == (1, 1, 0)


def test_a_remapped_cell_holds_the_same_contacts() -> None:
    # b → b − a describes the same lattice; a contact with image (m, n) then has (m + n, n).
    cell = Cell(matrix=np.array([[10.0, 5.1], [0.0, 10.0]]))
    shorter = Cell(matrix=np.array([[10.0, -4.9], [0.0, 10.0]]))
    image = np.array([[0, 1], [1, 0], [0, 0]])
    moved = np.array([[1, 1], [1, 0], [0, 0]])
    pairs, normals = [[0, 1], [1, 2], [0, 2]], at_angles([10, 20, 30])
    before = state(pairs, normals, image=image, cell=cell)
    data = listed(before, state(pairs, normals, image=moved, cell=shorter))
    assert int(data["persistent"]) == 3
    assert np.abs(data["current_affine"]).max() < 1e-12  # nothing moved


@pytest.mark.parametrize(("dimension", "along", "across"), [(2, 2.0, -2.0), (3, 2.5, -1.25)])
def test_what_a_gained_and_a_lost_contact_change(dimension, along, across) -> None:
    axes = np.eye(dimension)
    d = axes[0]
    before = state([[0, 1], [1, 2]], [axes[1], d], grain_count=5)
    after = state([[0, 1], [2, 3]], [d, d], grain_count=5)
    data = listed(before, after, direction=d)
    assert float(data["z_gain"]) == float(-data["z_loss"]) == pytest.approx(2 / 5)
    assert float(data["az_gain"]) == pytest.approx(2 / 5 * along)
    assert float(data["az_loss"]) == pytest.approx(-2 / 5 * along)
    assert float(data["az_rotation"]) == pytest.approx(2 / 5 * (along - across))


def test_normals_turn_from_contraction_towards_extension() -> None:
    theta = np.linspace(0, np.pi, 50)
    normal = np.column_stack([np.cos(theta), np.sin(theta)])
    turning = affine_turning(normal, np.diag([-0.5, 0.5]))  # contraction along x, ε̇_q = 1
    across = np.column_stack([-normal[:, 1], normal[:, 0]])
    np.testing.assert_allclose(
        np.einsum("ci,ci->c", turning, across), 0.5 * np.sin(2 * theta), atol=1e-14
    )
    np.testing.assert_allclose(np.einsum("ci,ci->c", turning, normal), 0, atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_contacts_that_move_with_the_mean_flow_carry_the_affine_current(dimension: int) -> None:
    normal = unit(np.random.default_rng(4), 60_000, dimension)
    gradient = 0.06 * np.eye(dimension) / dimension
    gradient[0, 0] -= 0.06  # contraction along x, Δε_q = 0.06
    deformation = np.diag(np.exp(np.diag(gradient)))
    moved = normal @ deformation.T
    moved /= np.linalg.norm(moved, axis=1)[:, None]
    pairs = all_pairs(400, 60_000)
    before = state(pairs, normal)
    after = state(pairs, moved, cell=Cell(matrix=deformation @ before.cell.matrix))
    data = listed(before, after, bins=12, direction=np.eye(dimension)[0])
    error = np.sqrt(np.maximum(data["crossings"], 1))
    assert (np.abs(data["current"] - data["current_affine"]) < 4 * error).all()
    if dimension == 2:
        exact = 60_000 / np.pi * 0.03 * np.sin(2 * data["theta_edge"].to_numpy())
        np.testing.assert_allclose(data["current_affine"], exact, atol=30)
    # Advection alone takes 1 per ε_q from a' of an isotropic state, in 2D and in 3D.
    z = float(data["z_before"])
    assert float(data["az_rotation"]) == pytest.approx(-0.06 * z, rel=0.03)
    assert float(data["az_rotation_affine"]) == pytest.approx(float(data["az_rotation"]), rel=0.01)


def test_the_affine_current_of_a_rotation_is_the_density_times_the_angle() -> None:
    degrees = (np.arange(3600) + 0.5) / 20
    before = state(all_pairs(90, 3600), at_angles(degrees))
    data = listed(before, turned(before, rotation_2d(0.3)), bins=18)
    np.testing.assert_allclose(data["current_affine"], 3600 / np.pi * 0.3, rtol=1e-5)
    np.testing.assert_allclose(data["current"], 3600 / np.pi * 0.3, atol=1)


def test_without_a_cell_there_is_no_mean_flow() -> None:
    packing = replace(state([[0, 1]], at_angles([20])), cell=None)
    data = listed(packing, packing)
    assert np.isnan(data["current_affine"]).all()
    assert int(data["persistent"]) == 1


def test_directions_are_counted_from_the_loading() -> None:
    packing = state([[0, 1]], at_angles([95]))
    data = listed(packing, packing, bins=18, direction=np.array([0.0, 3.0]))
    assert int(np.flatnonzero(data["before"])[0]) == 0
    np.testing.assert_allclose(data.attrs["direction"], [0, 1])


def test_what_cannot_be_compared_is_said() -> None:
    packing = state([[0, 1], [1, 2]], at_angles([20, 30]))
    with pytest.raises(InvalidPacking, match="different grains"):
        listed(packing, state([[0, 1]], at_angles([20]), grain_count=7))
    twice = state([[0, 1], [1, 0]], np.concatenate([at_angles([20]), -at_angles([20])]))
    with pytest.raises(InvalidPacking, match=r"grains 0 and 1 .* listed twice"):
        listed(packing, twice)
    with pytest.raises(InvalidPacking, match="not unique"):
        listed(packing, state([[0, 1]], at_angles([20]), number=np.array([4, 4])))
    with pytest.raises(InvalidPacking, match="2D"):
        listed(packing, state([[0, 1]], [[1.0, 0, 0]]))
    with pytest.raises(MissingData, match="contact forces"):
        balance(packing, packing)
    for wrong in ({"bins": 1}, {"direction": np.zeros(2)}, {"direction": np.ones(3)}):
        with pytest.raises(InvalidSettings):
            listed(packing, packing, **wrong)
    with pytest.raises(InvalidSettings, match="keep"):
        balance(packing, packing, criterion="gap:0.1", keep=0.05)
