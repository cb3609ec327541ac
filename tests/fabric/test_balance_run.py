"""The balance along runs: real shear across a remap, stages, hysteresis, sampling, averages."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from balance_cases import all_pairs, at_angles, residue, rotation_2d, run_of, state, turned

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import (
    average_balance,
    balance,
    balance_run,
    rates_by_sampling,
    select_contacts,
)
from granufab.fabric.affine import mean_gradient
from granufab.fabric.contact_identity import ContactRule, follow_contacts
from granufab.fabric.criterion import Criterion
from granufab.fabric.lattice import lattice_change
from granufab.history import Frame, Run
from granufab.packing import Cell, Grains, Packing
from granufab.simulate import Record, Solver, compress, random_sample, shear


@pytest.fixture(scope="module", params=[2, 3], ids=["disks", "spheres"])
def sheared(request: pytest.FixtureRequest) -> Run:
    """Sixty grains in simple shear, until the cell has been remapped."""
    sample = compress(random_sample(60, dimension=request.param, seed=3), friction=0.3)
    return shear(
        sample,
        strain=0.6,
        loading="simple-shear",
        inertial_number=2e-2,
        solver=Solver(tolerance=1e-2, max_sweeps=200),
        record_settings=Record(frame_interval=0.05, series_interval=0.05),
    )


def test_every_pair_of_frames_closes(sheared: Run) -> None:
    for first, second in combinations(sheared.frames, 2):
        data = balance(first, second, bins=12)
        assert not residue(data).any()
        assert int(data["before"].sum()) == select_contacts(first.packing).count
        assert int(data["after"].sum()) == select_contacts(second.packing).count
        for quantity in ("z", "az"):
            parts = sum(data[f"{quantity}_{part}"] for part in ("gain", "loss", "rotation"))
            change = data[f"{quantity}_after"] - data[f"{quantity}_before"]
            assert float(parts) == pytest.approx(float(change), abs=1e-12)


def test_contacts_are_found_again_across_a_remap(sheared: Run) -> None:
    remapped = 0
    for first, second in pairwise(sheared.frames):
        data = balance(first, second)
        pairs = [
            {tuple(sorted(pair)) for pair in select_contacts(frame.packing).pair.tolist()}
            for frame in (first, second)
        ]
        # No two grains touch through two images here, and none changes its image in 0.05.
        assert int(data["persistent"]) == len(pairs[0] & pairs[1])
        alone = balance(first.packing, second.packing, direction=first.direction)
        np.testing.assert_array_equal(alone["current"], data["current"])
        if not np.array_equal(first.remap, second.remap):
            remapped += 1
            blind = balance(replace(first, remap=None), replace(second, remap=None))
            assert int(blind["persistent"]) < int(data["persistent"])
    assert remapped == 1


def test_images_follow_from_the_branches_where_they_are_not_listed(sheared: Run) -> None:
    first, second = sheared.frames[9:11]
    bare = []
    for frame in (first, second):
        contacts = frame.packing.contacts
        assert contacts is not None
        without = replace(frame.packing, contacts=replace(contacts, image=None))
        bare.append(replace(frame, packing=without))
    data, same = balance(first, second), balance(*bare)
    for name in ("gain", "loss", "current"):
        np.testing.assert_array_equal(data[name], same[name])


def test_the_mean_flow_does_not_see_the_remap(sheared: Run) -> None:
    for first, second in pairwise(sheared.frames):
        gradient = _mean_gradient(first, second)
        cells = first.packing.cell, second.packing.cell
        assert cells[0] is not None
        assert cells[1] is not None
        elapsed = (second.packing.time or 0.0) - (first.packing.time or 0.0)
        imposed = elapsed * 0.5 * (cells[0].rate + cells[1].rate)
        # The shear is imposed; the dilation follows the stress and fluctuates in between.
        assert gradient[0, 1] == pytest.approx(imposed[0, 1], rel=0.02)
        assert np.abs(gradient - imposed).max() < 0.02


def _mean_gradient(first: Frame, second: Frame) -> np.ndarray:
    rule = ContactRule(criterion=Criterion("force"))
    states = [(frame.packing, lattice_change(frame)) for frame in (first, second)]
    gradient = mean_gradient(*follow_contacts(states, rule))
    assert gradient is not None
    return gradient


def test_rates_are_counts_per_grain_and_strain(sheared: Run) -> None:
    data = balance_run(sheared, bins=6)
    sizes = {2: np.pi / 6, 3: 2 * np.pi / 6}[sheared.dimension]
    total = (data["gain_rate"] * sizes).sum("bin")
    np.testing.assert_allclose(total, data["gained"] / 60 / data["strain"])
    np.testing.assert_allclose(data["current_rate"], data["current"] / 60 / data["strain"])
    relative = data["gain_rate_error"] / data["gain_rate"]
    expected = 1 / np.sqrt(data["gain"].where(data["gain"] > 0))
    np.testing.assert_allclose(relative.where(data["gain"] > 0), expected)


def test_the_mean_over_a_window_balances(sheared: Run) -> None:
    mean = average_balance(balance_run(sheared, bins=6), window=(0.2, 0.6))
    assert mean.attrs["intervals"] == 8
    left = mean["net_rate"] - mean["divergence"] - mean["storage_rate"]
    np.testing.assert_allclose(left, 0, atol=1e-10)
    whole = {2: np.pi, 3: 2 * np.pi}[sheared.dimension]
    z = 2 * float(mean["E"].mean()) * whole
    data = balance_run(sheared).isel(interval=slice(4, 12))
    assert z == pytest.approx(float((0.5 * (data["z_before"] + data["z_after"])).mean()))


def test_keeping_contacts_removes_flicker(sheared: Run) -> None:
    plain, kept = (balance_run(sheared, keep=keep) for keep in (None, 0.03))
    assert not residue(kept).any()
    assert int(kept["lost"].sum()) < int(plain["lost"].sum())
    assert (kept["persistent"] >= plain["persistent"]).all()
    assert kept.attrs["keep"] == "gap:0.03"


def _three_disks(gap: float) -> Packing:
    position = np.array([[1.0, 1.0], [2.0 + gap, 1.0], [5.0, 5.0]])
    grains = Grains(position=position, radius=np.full(3, 0.5))
    return Packing(grains=grains, cell=Cell(matrix=10 * np.eye(2)))


def test_a_kept_contact_opens_later_and_is_not_made_earlier() -> None:
    run = run_of([_three_disks(gap) for gap in (0.0, 0.01, 0.03, 0.01, 0.0)])
    plain = balance_run(run, criterion="gap:0.005")
    np.testing.assert_array_equal(plain["lost"], [1, 0, 0, 0])
    np.testing.assert_array_equal(plain["gained"], [0, 0, 0, 1])
    kept = balance_run(run, criterion="gap:0.005", keep=0.02)
    np.testing.assert_array_equal(kept["lost"], [0, 1, 0, 0])
    np.testing.assert_array_equal(kept["gained"], [0, 0, 0, 1])
    # The state at 0.01 depends on what came before it, also where it is skipped.
    both = balance_run(run, criterion="gap:0.005", keep=0.02, every=3)
    np.testing.assert_array_equal(both["lost"], [1])


def test_intervals_respect_stages() -> None:
    packing = state([[0, 1]], at_angles([20]))
    run = run_of([packing] * 8, stages=[0, 0, 0, 0, 1, 1, 1, 1])
    data = balance_run(run, criterion="listed", every=2)
    assert list(zip(data["frame_before"].values, data["frame_after"].values, strict=True)) == [
        (0, 2),
        (3, 5),
        (5, 7),
    ]
    np.testing.assert_array_equal(data["stage"], [0, 1, 1])
    np.testing.assert_allclose(data["strain"], 0.02)


def test_intervals_that_do_not_fit_are_said() -> None:
    packing = state([[0, 1]], at_angles([20]))
    run = run_of([packing] * 3)
    with pytest.raises(MissingData, match="no interval of 3 frames"):
        balance_run(run, criterion="listed", every=3)
    with pytest.raises(InvalidSettings, match="at least 1"):
        balance_run(run, criterion="listed", every=0)
    with pytest.raises(MissingData, match="no recorded frames"):
        balance_run(replace(run, frames=[]))
    with pytest.raises(MissingData, match=r"0\.5\.\.0\.6"):
        average_balance(balance_run(run, criterion="listed"), window=(0.5, 0.6))


def test_without_strain_there_are_counts_but_no_rates() -> None:
    packing = state([[0, 1]], at_angles([20]))
    data = balance_run(run_of([packing] * 2, strains=[0.0, 0.0]), criterion="listed")
    np.testing.assert_array_equal(data["persistent"], [1])
    assert np.isnan(data["gain_rate"]).all()
    with pytest.raises(MissingData):
        average_balance(data)


def test_flicker_is_not_seen_by_slower_sampling() -> None:
    pairs = all_pairs(20, 100)
    normal = at_angles(np.linspace(0, 179, 100))
    states = [
        state(pairs[: 100 - 30 * (k % 2)], normal[: 100 - 30 * (k % 2)], grain_count=20)
        for k in range(9)
    ]
    rates = rates_by_sampling(
        run_of(states), multiples=(2, 1, 100), criterion="listed", window=(0.0, 0.08)
    )
    np.testing.assert_array_equal(rates["frames"], [1, 2])  # 100 frames do not fit
    # 30 contacts flicker: gained in every second interval of 0.01, by 20 grains.
    np.testing.assert_allclose(rates["gain_rate"], [0.5 * 30 / 20 / 0.01, 0.0])
    np.testing.assert_allclose(rates["persistent_fraction"], [560 / 680, 1])


def test_a_steady_rotation_has_a_steady_current() -> None:
    first = state(all_pairs(61, 1800), at_angles((np.arange(1800) + 0.5) / 10))
    states = [turned(first, rotation_2d(0.1 * k)) for k in range(10)]
    mean = average_balance(balance_run(run_of(states), criterion="listed"), window=(0, 1))
    # 0.1 rad per 0.01 of strain of 1800 contacts over π, 61 grains.
    np.testing.assert_allclose(mean["current_rate"], 10 * 1800 / np.pi / 61, rtol=0.01)
    np.testing.assert_allclose(mean["current_rate_affine"], 10 * 1800 / np.pi / 61, rtol=1e-6)
    assert not mean["net_rate"].any()
    assert float(mean["gain_rate_total"]) == 0.0
