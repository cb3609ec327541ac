from dataclasses import replace

import numpy as np
import pytest
from moving_states import BIAXIAL, SIMPLE, SIMPLE_3D, TRIAXIAL, frames

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import mean_motion, velocity_field
from granufab.packing import Cell, Contacts, Grains, Packing

LISTED = {"criterion": "gap:0.3"}


def still(k, position):
    return np.zeros_like(position)


def noise(seed, size=0.3):
    generator = np.random.default_rng(seed)
    return lambda k, position: size * generator.normal(size=position.shape)


def affine_of(data, rate):
    """L·r in the coordinates of the section, from the mean places."""
    place = data["position"].to_numpy()
    basis = data.attrs["basis"].reshape(-1, len(rate))
    if data.attrs["section"] == "axisymmetric":
        axis = basis[0]
        across = np.linalg.svd(axis[None])[2][1]
        return np.stack([(across @ rate @ across) * place[0], (axis @ rate @ axis) * place[1]])
    return np.einsum("ij,jyx->iyx", basis @ rate @ basis.T, place)


@pytest.mark.parametrize(
    ("rate", "count", "kind"),
    [
        (SIMPLE, 625, "plane"),
        (BIAXIAL, 625, "plane"),
        (TRIAXIAL, 512, "axisymmetric"),
        (SIMPLE_3D, 512, "slab"),
    ],
)
def test_affine_motion_comes_back_exactly(rate, count, kind):
    # First tilt 0.4: simple shear remaps its cell on the way.
    states = frames(rate, count=count, number=4, velocities=still, wrapped=True, first=0.4)
    data = velocity_field(iter(states), **LISTED)
    assert data.attrs["section"] == kind
    assert data.attrs["states"] == 4
    seen = data["count"].to_numpy() > 0
    assert seen.mean() > 0.6
    np.testing.assert_allclose(data["difference"].to_numpy()[:, seen], 0, atol=1e-12)
    if kind != "slab":
        # The mean over a slab also moves along z, which is not shown.
        expected = affine_of(data, rate)
        np.testing.assert_allclose(
            data["velocity"].to_numpy()[:, seen], expected[:, seen], atol=1e-12
        )
    np.testing.assert_allclose(data["rate"], rate, atol=1e-12)
    np.testing.assert_allclose(data["rate_far"], rate, atol=1e-12)
    for name in ("normal_share", "tangential_share"):
        share = data[name].to_numpy()
        np.testing.assert_allclose(share[np.isfinite(share)], 1.0, atol=1e-9)


@pytest.mark.parametrize("rate", [SIMPLE, BIAXIAL, TRIAXIAL, SIMPLE_3D])
def test_velocities_over_a_window_of_affine_motion(rate):
    count = 625 if len(rate) == 2 else 512
    states = frames(rate, count=count, number=5, interval=0.04, wrapped=True, first=0.45)
    assert len(rate) == 3 or rate is not SIMPLE or states[0].remap[0, 1] != states[-1].remap[0, 1]
    data = velocity_field(states, window=2, **LISTED)
    assert data.attrs["states"] == 2
    difference = data["difference"].to_numpy()
    np.testing.assert_allclose(difference[np.isfinite(difference)], 0, atol=1e-11)
    # tanh of half of the strain over half of it: the mean velocity at the mean place.
    np.testing.assert_allclose(data["rate_far"], rate, atol=2e-3)


def test_mean_motion_is_the_displacement_over_the_interval():
    before, after = frames(
        SIMPLE, count=100, number=2, interval=0.1, steps=noise(3, 0.1), first=0.45
    )
    middle = mean_motion(before, after)
    old, new = before.packing.grains.position, after.packing.grains.position
    np.testing.assert_allclose(middle.grains.position, 0.5 * (old + new), atol=1e-12)
    velocity = middle.grains.velocity + middle.grains.position @ middle.cell.rate.T
    rest = velocity - (new - old) / 0.1
    np.testing.assert_allclose(rest - rest[0], 0, atol=1e-11)
    assert middle.time == pytest.approx(0.05)
    # The middle cell is the mean of the two, in one basis of the same lattice.
    turned = after.packing.cell.matrix @ np.linalg.inv(after.remap)
    expected = 0.5 * (before.packing.cell.matrix + turned)
    change = np.linalg.solve(expected, middle.cell.matrix)
    np.testing.assert_allclose(change, np.rint(change), atol=1e-12)


def test_a_pair_of_grains_shares_as_set():
    """Dimers on a wide grid that approach at half and turn at 3/2 of the affine rate."""
    generator = np.random.default_rng(5)
    rate = np.array([[0.35, 0.5], [0.1, -0.35]])
    side, step = 8, 4.0
    centre = step * np.stack(np.meshgrid(*[np.arange(side)] * 2), axis=-1).reshape(-1, 2)
    angle = generator.uniform(0, np.pi, len(centre))
    branch = np.column_stack([np.cos(angle), np.sin(angle)])
    affine = branch @ rate.T
    along = (affine * branch).sum(axis=1)[:, None] * branch
    velocity = 0.5 * (-0.5 * along + 0.5 * (affine - along))
    packing = Packing(
        grains=Grains(
            position=np.concatenate([centre - 0.5 * branch, centre + 0.5 * branch]),
            radius=np.full(2 * len(centre), 0.49),
            velocity=np.concatenate([-velocity, velocity]),
        ),
        cell=Cell(matrix=side * step * np.eye(2), rate=rate),
    )
    data = velocity_field(packing, reach=2.5, criterion="gap:0.1")
    shell = data.isel(distance=slice(9, 11)).dropna("distance")
    assert data.attrs["length"] == pytest.approx(1.0)
    assert float(shell["pair_count"].sum()) == len(centre)
    np.testing.assert_allclose(shell["normal_share"], 0.5, atol=1e-9)
    np.testing.assert_allclose(shell["tangential_share"], 1.5, atol=1e-9)


def test_boxes_hold_the_mean_over_all_images_both_ways_round():
    (state,) = frames(SIMPLE, count=100, number=1, velocities=noise(2), wrapped=True, first=0.3)
    data = velocity_field(state, reach=3.0, spacing=0.5, **LISTED)
    grains, cell = state.packing.grains, state.packing.cell
    length = data.attrs["length"]
    shifts = np.stack(np.meshgrid(*[np.arange(-9, 10)] * 2), axis=-1).reshape(-1, 2) @ cell.matrix.T
    total, number = np.zeros((2, 12, 12)), np.zeros((12, 12))
    for i in range(100):
        branch = grains.position[None] + shifts[:, None] - grains.position[i]
        velocity = grains.velocity[None] - grains.velocity[i] + branch @ cell.rate.T
        other = np.broadcast_to(np.arange(100) != i, branch.shape[:2])
        column, row = np.floor((branch / length + 3.0) / 0.5).astype(int).transpose(2, 0, 1)
        inside = other & (column >= 0) & (column < 12) & (row >= 0) & (row < 12)
        np.add.at(number, (row[inside], column[inside]), 1)
        for k in range(2):
            np.add.at(total[k], (row[inside], column[inside]), velocity[..., k][inside] / length)
    np.testing.assert_array_equal(data["count"], number)
    seen = number > 0
    np.testing.assert_allclose(
        data["velocity"].to_numpy()[:, seen], (total / np.fmax(number, 1))[:, seen]
    )


def test_the_field_is_odd_and_turns_with_the_frame():
    states = frames(SIMPLE, number=2, velocities=noise(4))
    data = velocity_field(states, **LISTED)
    velocity = np.nan_to_num(data["velocity"].to_numpy())
    np.testing.assert_allclose(velocity, -velocity[:, ::-1, ::-1], atol=1e-12)
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = velocity_field([_turned(state.packing, turn) for state in states], **LISTED)
    # r → Q r moves box (y, x) to (x, −y).
    expected = np.einsum("ij,jyx->iyx", turn, velocity).transpose(0, 2, 1)[:, :, ::-1]
    np.testing.assert_allclose(np.nan_to_num(turned["velocity"].to_numpy()), expected, atol=1e-9)
    np.testing.assert_allclose(turned["rate_far"], turn @ data["rate_far"].to_numpy() @ turn.T)
    np.testing.assert_allclose(turned["normal_share"], data["normal_share"])


def _turned(packing, turn):
    cell = packing.cell
    grains = replace(
        packing.grains,
        position=packing.grains.position @ turn.T,
        velocity=packing.grains.velocity @ turn.T,
    )
    matrix = turn @ cell.matrix
    return replace(packing, grains=grains, cell=Cell(matrix=matrix, rate=turn @ cell.rate @ turn.T))


def test_standard_errors_from_states_match_the_scatter():
    pulls, far = [], []
    for seed in range(4):
        generator = np.random.default_rng(50 + seed)
        states = [
            frames(SIMPLE, number=1, velocities=noise(100 * seed + k), generator=generator)[0]
            for k in range(32)
        ]
        data = velocity_field([s.packing for s in states], reach=3.0, spacing=0.5, **LISTED)
        assert "states" in data.attrs["error_bars"]
        pulls.append((data["difference"] / data["error"]).to_numpy().ravel())
        far.append(((data["rate_far"] - data["rate"]) / data["rate_far_error"]).to_numpy().ravel())
        shares = data["normal_share"] - 1.0
        pulls.append((shares / data["normal_share_error"]).to_numpy()[8:])
    every = np.concatenate(pulls)
    every = every[np.isfinite(every)]
    # 16 groups: Student's t with 15 degrees of freedom has a deviation of 1.07.
    assert every.std() == pytest.approx(1.07, abs=0.12)
    assert np.concatenate(far).std() == pytest.approx(1.07, abs=0.45)


def test_standard_errors_of_one_state_are_not_too_small():
    (state,) = frames(SIMPLE, count=900, number=1, velocities=noise(9))
    data = velocity_field(state, spacing=0.5, **LISTED)
    assert "upper mark" in data.attrs["error_bars"]
    pull = (data["difference"] / data["error"]).to_numpy()
    pull = pull[np.isfinite(pull)]
    assert 0.3 < pull.std() < 1.2
    assert (np.abs((data["rate_far"] - SIMPLE) / data["rate_far_error"]) < 2).all()


def test_refusals():
    states = frames(SIMPLE, number=3, velocities=still)
    with pytest.raises(InvalidSettings, match="half of the cell"):
        velocity_field(states, reach=12.0, **LISTED)
    with pytest.raises(MissingData, match="velocities"):
        velocity_field(frames(SIMPLE, number=1), **LISTED)
    with pytest.raises(InvalidSettings, match="stages 0 and 1"):
        velocity_field([states[0], replace(states[1], stage=1)], **LISTED)
    with pytest.raises(MissingData, match="no 2 states"):
        velocity_field(states[0], window=1, **LISTED)
    with pytest.raises(InvalidSettings, match="does not shear"):
        velocity_field(frames(0 * SIMPLE, number=1, velocities=still), **LISTED)
    with pytest.raises(InvalidSettings, match="packings know neither"):
        velocity_field(states[0].packing, stage=0, **LISTED)
    with pytest.raises(InvalidSettings, match="far field"):
        velocity_field(states, far=7.0, **LISTED)
    empty = Contacts(pair=np.zeros((0, 2), int), normal=np.zeros((0, 2)), force=np.zeros((0, 2)))
    with pytest.raises(MissingData, match="<ℓ>"):
        velocity_field(replace(states[0].packing, contacts=empty))


def test_frames_are_read_one_at_a_time():
    class Counting:
        def __init__(self, states):
            self.states, self.read = states, []

        def __len__(self):
            return len(self.states)

        def __getitem__(self, index):
            self.read.append(index)
            return self.states[index]

    source = Counting(frames(SIMPLE, number=4, velocities=still))
    data = velocity_field(source, strain=(0.05, 0.1), **LISTED)
    assert data.attrs["states"] == 2
    assert source.read == [0, 1, 2, 3]
