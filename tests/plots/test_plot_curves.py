"""Running means, reversals and labels of the curves that figures show."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from granufab.errors import MissingData
from granufab.plots.curves import collect, mean_curve, running_mean, stages


def _series(eps: np.ndarray, **columns: np.ndarray) -> xr.Dataset:
    total = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(eps)))])
    data = {"eps_q": eps, "eps_q_total": total, **columns}
    return xr.Dataset({name: ("record", value) for name, value in data.items()})


def test_running_mean_keeps_a_straight_line_and_both_ends() -> None:
    strain = np.linspace(0, 0.3, 301)
    line = 4.0 - 2.0 * strain
    mean, spread = running_mean(strain, line, 0.02)
    np.testing.assert_allclose(mean, line, atol=1e-12)
    assert spread.max() < 0.02  # a slope of 2 over half a window of 0.01
    noisy = line + np.random.default_rng(1).normal(0, 0.1, len(line))
    mean, _ = running_mean(strain, noisy, 0.02)
    assert mean[0] == noisy[0]
    assert mean[-1] == noisy[-1]


def test_running_mean_of_white_noise_shrinks_as_the_root_of_the_window() -> None:
    strain = np.arange(20_001) * 1e-3
    noise = np.random.default_rng(2).normal(0, 1, len(strain))
    mean, spread = running_mean(strain, noise, 0.02)  # 21 records
    inner = slice(50, -50)
    assert mean[inner].std() == pytest.approx(1 / np.sqrt(21), rel=0.03)
    assert spread[inner].mean() == pytest.approx(1.0, rel=0.06)


def test_running_mean_steps_over_unknown_records() -> None:
    strain = np.linspace(0, 0.1, 101)
    value = np.full(101, 3.0)
    value[50] = np.nan
    mean, _ = running_mean(strain, value, 0.01)
    np.testing.assert_allclose(mean, 3.0)


def test_stages_split_at_each_reversal_and_share_the_turning_record() -> None:
    eps = np.concatenate([np.linspace(0, 0.3, 31), np.linspace(0.29, 0.0, 30), [0.01, 0.02]])
    parts = stages(_series(eps))
    assert [(part.start, part.stop) for part in parts] == [(0, 31), (30, 61), (60, 63)]


def test_the_mean_does_not_run_across_a_reversal() -> None:
    eps = np.concatenate([np.linspace(0, 0.1, 101), np.linspace(0.099, 0, 100)])
    z = np.where(np.arange(201) <= 100, 3.5, 3.0)
    before, after = mean_curve([_series(eps, z=z)], "z", against="eps_q_total", window=0.02)
    np.testing.assert_allclose(before.mean, 3.5)
    np.testing.assert_allclose(after.mean[11:], 3.0)  # the turning record leaves the window


def test_the_band_of_repeats_is_their_standard_deviation() -> None:
    eps = np.linspace(0, 0.1, 101)
    repeats = [_series(eps, z=np.full(101, z)) for z in (3.3, 3.4, 3.5)]
    (curve,) = mean_curve(repeats, "z", against="eps_q", window=0.01)
    np.testing.assert_allclose(curve.mean, 3.4)
    np.testing.assert_allclose(curve.spread, 0.1)


def test_labels_stay_apart_and_repeats_together() -> None:
    one = _series(np.linspace(0, 1, 3))
    assert list(collect(one, one, [one])) == ["path", "path (2)", "path (3)"]
    grouped = collect({"dense": [one, one], "loose": one})
    assert {label: len(repeats) for label, repeats in grouped.items()} == {"dense": 2, "loose": 1}


@pytest.mark.parametrize("nothing", [[], {}, xr.Dataset({"eps_q": ("record", [])})])
def test_nothing_to_draw_is_said(nothing: object) -> None:
    with pytest.raises(MissingData, match="at least one series"):
        collect(nothing)  # type: ignore[arg-type]
