"""Memory of a series, block length, and the coverage of intervals that follow."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from granufab.errors import InvalidSettings, MissingData
from granufab.states import Bootstrap, autocorrelation_time, critical_state, paired_difference
from granufab.states.bootstrap import block_length, resamples


def correlated(count: int, memory: float, random: np.random.Generator) -> np.ndarray:
    """Stationary AR(1) series of unit variance."""
    noise = random.standard_normal(count + 400) * np.sqrt(1 - memory**2)
    return lfilter([1.0], [1.0, -memory], noise)[400:]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.8, 0.9])
def test_autocorrelation_time_of_an_autoregressive_series(memory: float) -> None:
    random = np.random.default_rng(3)
    times = [autocorrelation_time(correlated(4000, memory, random)) for _ in range(20)]
    assert np.mean(times) == pytest.approx((1 + memory) / (1 - memory), rel=0.1)


def test_white_noise_needs_blocks_of_one_state() -> None:
    random = np.random.default_rng(4)
    times = [autocorrelation_time(random.standard_normal(2000)) for _ in range(21)]
    assert np.median([block_length(time, 2000) for time in times]) <= 2
    assert block_length(1.0, 2000) == 1


def test_block_length_of_an_autoregressive_series() -> None:
    """The known optimum (3/2)^{1/3} (2φ/(1 − φ²))^{2/3} n^{1/3} for the variance of the mean."""
    random = np.random.default_rng(5)
    memory, count = 0.8, 4000
    expected = 1.5 ** (1 / 3) * (2 * memory / (1 - memory**2)) ** (2 / 3) * count ** (1 / 3)
    found = [
        block_length(autocorrelation_time(correlated(count, memory, random)), count)
        for _ in range(20)
    ]
    assert np.mean(found) == pytest.approx(expected, rel=0.1)


def test_constant_series_has_no_memory_and_short_ones_are_refused() -> None:
    assert autocorrelation_time(np.full(50, 3.3)) == 1.0
    with pytest.raises(MissingData, match="at least 4 states, got 3"):
        autocorrelation_time([1.0, 2.0, 3.0])


def test_resamples_are_runs_of_consecutive_rows_and_whole_seeds() -> None:
    seeds = ["x", "x", "y", "z"]
    for draw in resamples([20, 30, 25, 40], 5, Bootstrap(samples=50), seeds):
        for k, rows in draw:
            assert len(rows) == [20, 30, 25, 40][k]
            assert (np.diff(rows).reshape(-1)[np.arange(len(rows) - 1) % 5 != 4] == 1).all()
        chosen = [k for k, _ in draw]
        assert chosen.count(0) == chosen.count(1)
        assert len({seeds[k] for k in chosen}) <= 3


def plateau_path(memory: float, random: np.random.Generator) -> tuple[np.ndarray, ...]:
    strain = np.linspace(0.0, 0.3, 301)
    z = 3.35 + 0.05 * correlated(301, memory, random)
    a = 0.24 + 0.03 * correlated(301, memory, random)
    return strain, z, a


def test_interval_of_the_mean_covers_the_truth_despite_memory() -> None:
    random = np.random.default_rng(6)
    hits = np.zeros(2)
    replicas = 100
    for _ in range(replicas):
        found = critical_state(*plateau_path(0.8, random), bootstrap=Bootstrap(samples=150))
        hits += [
            found.z_star.low <= 3.35 <= found.z_star.high,
            found.a_star.low <= 0.24 <= found.a_star.high,
        ]
    assert (hits / replicas >= 0.88).all()
    assert (hits / replicas < 1.0).any()


def test_critical_state_averages_other_series_and_honours_the_window() -> None:
    strain = np.linspace(0.0, 0.3, 61)
    z, a = 3.0 + strain, 0.2 + strain
    found = critical_state(strain, z, -a, others={"q_over_p": 2 * strain}, plateau=(0.1, 0.2))
    assert found.z_star.value == pytest.approx(3.15)
    assert found.a_star.value == pytest.approx(0.35)
    assert found.others["q_over_p"].value == pytest.approx(0.3)
    assert found.plateau == ((pytest.approx(0.1), pytest.approx(0.2)),)
    last_third = critical_state(strain, z, a)
    assert last_third.z_star.value == pytest.approx(3.25)


def test_drift_tells_a_plateau_from_a_slope() -> None:
    random = np.random.default_rng(7)
    drifts = np.array([critical_state(*plateau_path(0.5, random)).drift["z"] for _ in range(20)])
    assert np.mean(np.abs(drifts) < 3) >= 0.9
    strain, z, a = plateau_path(0.5, random)
    assert critical_state(strain, z + 2 * strain, a).drift["z"] > 3
    assert critical_state(strain, z - 8 * strain, a).drift["z"] < -10


def test_between_seed_scatter_widens_the_interval() -> None:
    random = np.random.default_rng(8)
    shift = [-0.15, -0.05, 0.0, 0.06, 0.14]
    paths = [plateau_path(0.5, random) for _ in shift]
    strains, zs, anisotropies = zip(*paths, strict=True)
    zs = [z + s for z, s in zip(zs, shift, strict=True)]
    alone = critical_state(strains, zs, anisotropies)
    seeded = critical_state(strains, zs, anisotropies, seeds=range(5))
    assert alone.between_seeds is None
    assert seeded.between_seeds is not None
    assert seeded.z_star.value == alone.z_star.value
    assert seeded.z_star.half_width > 2 * alone.z_star.half_width
    spread = np.std([z[200:].mean() for z in zs], ddof=1) / np.sqrt(5)
    assert seeded.between_seeds["z"].half_width == pytest.approx(2.776 * spread, rel=1e-3)


def test_paired_difference_sees_through_what_both_runs_share() -> None:
    random = np.random.default_rng(9)
    shared = correlated(400, 0.95, random)
    x = 3.30 + 0.1 * shared + 0.01 * correlated(400, 0.5, random)
    y = 3.25 + 0.1 * shared + 0.01 * correlated(400, 0.5, random)
    found = paired_difference(x, y)
    assert found.value == pytest.approx(0.05, abs=4 * found.standard_error)
    assert found.standard_error < 0.003
    assert found.low < 0.05 < found.high
    assert found.between is None


def test_paired_error_is_honest_over_samples() -> None:
    """The stated standard error is the scatter of the value over repetitions."""
    random = np.random.default_rng(10)
    values, errors = [], []
    for _ in range(60):
        d = [0.02 * random.standard_normal() + 0.1 * correlated(150, 0.8, random) for _ in range(6)]
        found = paired_difference(d, [np.zeros(150)] * 6)
        values.append(found.value)
        errors.append(found.standard_error)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(values), rel=0.25)


def test_paired_difference_matches_different_recordings_by_strain() -> None:
    coarse, fine = np.linspace(0, 0.3, 61), np.linspace(0, 0.3, 1501)
    found = paired_difference(
        3.0 + coarse, 2.9 + fine, strain_x=coarse, strain_y=fine, window=(0.1, 0.3), windows=20
    )
    assert found.value == pytest.approx(0.1, abs=1e-10)
    with pytest.raises(MissingData, match=r"window 0\.1\.\.0\.4 is not covered"):
        paired_difference(coarse, fine, strain_x=coarse, strain_y=fine, window=(0.1, 0.4))
    with pytest.raises(InvalidSettings, match="x has 61 states, y has 1501"):
        paired_difference(coarse, fine)


@pytest.mark.parametrize(
    "wrong", [{"samples": 3}, {"level": 1.0}, {"block_length": 0}], ids=lambda w: next(iter(w))
)
def test_wrong_bootstrap_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidSettings, match=next(iter(wrong))):
        Bootstrap(**wrong)  # type: ignore[arg-type]
