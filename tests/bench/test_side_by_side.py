"""Ratios of pairs, on made-up timings."""

from __future__ import annotations

import pytest

from granufab.bench.convergence import compare_solvers, profile_steps
from granufab.bench.problems import tile
from granufab.bench.side_by_side import ratio_of, take_turns
from granufab.packing import Packing
from granufab.simulate import Isotropic


def test_a_common_disturbance_leaves_the_ratio_alone() -> None:
    ratio = ratio_of([2.0, 20.0, 2.0, 6.0], [1.0, 10.0, 1.0, 3.0])
    assert ratio is not None
    assert (ratio.low, ratio.median, ratio.high, ratio.pairs) == (2.0, 2.0, 2.0, 4)


def test_what_is_missing_has_no_ratio() -> None:
    assert ratio_of([None, None], [1.0, 2.0]) is None
    assert ratio_of([], []) is None


def test_timings_take_turns_after_one_round_that_does_not_count() -> None:
    called: list[str] = []

    def timing(name: str) -> float:
        called.append(name)
        return float(len(called))

    first, second = take_turns([lambda: timing("a"), lambda: timing("b")], 2)
    assert called == ["a", "b", "a", "b", "a", "b"]
    assert (first, second) == ([3.0, 5.0], [4.0, 6.0])


def test_both_solvers_meet_the_tolerance_from_the_same_state(packed: Packing) -> None:
    state, loading = tile(packed, 2, shake=1.0), Isotropic(dimension=packed.dimension)
    row = compare_solvers(state, loading, friction=0.3, tolerance=1e-5, steps=2)
    assert row["grains"] == state.grains.count
    for name in ("plain", "accelerated"):
        assert row[name]["stopped"] == 0
        assert row[name]["residual_max"] <= 1e-5
    ratio = row["plain"]["sweeps_mean"] / row["accelerated"]["sweeps_mean"]
    assert row["sweeps_ratio"] == pytest.approx(ratio)


def test_a_plain_step_stopped_by_its_cap_counts_at_the_cap(packed: Packing) -> None:
    state, loading = tile(packed, 2, shake=1.0), Isotropic(dimension=packed.dimension)
    row = compare_solvers(state, loading, friction=0.3, tolerance=1e-9, steps=1, cap=3)
    assert row["plain"]["stopped"] == 1
    assert row["plain"]["sweeps_mean"] == 3


def test_the_stages_of_a_step_fit_into_its_time(packed: Packing) -> None:
    loading = Isotropic(dimension=packed.dimension)
    row = profile_steps(packed, loading, friction=0.3, tolerance=1e-4, steps=3)
    stages = row["ms_by_stage"]
    assert set(stages) == {"sweeps", "rest of the solve", "search", "geometry", "rest"}
    assert min(stages.values()) >= 0
    assert sum(stages.values()) <= row["ms_per_step"] * (1 + 1e-9)
    assert 0 < row["outside_sweeps_fraction"] < 1
