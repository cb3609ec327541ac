"""Fits of synthetic paths whose limits are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.signal import lfilter

from granufab.errors import InvalidSettings, MissingData
from granufab.states import AccessibleDomain, Bootstrap, fit_accessible_states, saturation_slopes

Z_MIN, Z_MAX = 2.948, 3.752
METHODS: tuple[Any, ...] = ("critical", "envelope", "lines")
QUICK = Bootstrap(samples=200)


def correlated(count: int, memory: float, random: np.random.Generator) -> np.ndarray:
    """Stationary AR(1) series of unit variance."""
    noise = random.standard_normal(count + 400) * np.sqrt(1 - memory**2)
    return lfilter([1.0], [1.0, -memory], noise)[400:]


def relaxing(
    z_0: float,
    random: np.random.Generator,
    *,
    count: int = 301,
    noise: float = 0.02,
    memory: float = 0.7,
    limits: tuple[float, float] = (Z_MIN, Z_MAX),
    **case: Any,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """From isotropic z_0 both extreme principal values relax to their limits; noise in z and a."""
    loss, gain = saturation_slopes(**case)
    strain = np.linspace(0.0, 0.3, count)
    decay = np.exp(-strain / 0.02)
    low = limits[0] + (z_0 - limits[0]) * decay
    high = limits[1] + (z_0 - limits[1]) * decay
    z = (loss * low + gain * high) / (loss + gain)
    a = (high - low) / (1 / loss + 1 / gain) / z
    return (
        strain,
        z + noise * correlated(count, memory, random),
        a + noise * correlated(count, memory, random),
    )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("z_0", [3.1, 3.7], ids=["loose", "dense"])
def test_noiseless_path_gives_its_limits(method: Any, z_0: float) -> None:
    path = relaxing(z_0, np.random.default_rng(0), noise=0.0)
    fit = fit_accessible_states(*path, method=method, plateau=0.2)
    assert fit.z_min.value == pytest.approx(Z_MIN, abs=2e-3)
    assert fit.z_max.value == pytest.approx(Z_MAX, abs=2e-3)
    assert fit.domain.z_star == pytest.approx(fit.z_star.value)
    assert fit.domain.a_star == pytest.approx(fit.a_star.value)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "case",
    [{"dimension": 3}, {"dimension": 3, "mode": "extension"}, {"dimension": 3, "b": 0.4}],
    ids=["compression", "extension", "b"],
)
def test_spheres_are_fitted_in_every_loading(method: Any, case: dict[str, Any]) -> None:
    random = np.random.default_rng(1)
    strain, z, a = relaxing(4.6, random, noise=0.005, limits=(4.0, 6.0), **case)
    sign = -1.0 if case.get("mode") == "extension" else 1.0
    fit = fit_accessible_states(strain, z, sign * a, method=method, **case)
    assert fit.z_min.value == pytest.approx(4.0, abs=0.03)
    assert fit.z_max.value == pytest.approx(6.0, abs=0.03)
    assert fit.domain.slopes == saturation_slopes(**case)
    assert fit.a_star.value > 0


@pytest.mark.parametrize("method", METHODS)
def test_interval_covers_the_truth(method: Any) -> None:
    random = np.random.default_rng(11)
    replicas, hits = 60, np.zeros(2)
    for k in range(replicas):
        path = relaxing(3.1 if k % 2 else 3.7, random)
        fit = fit_accessible_states(*path, method=method, bootstrap=Bootstrap(samples=100))
        hits += [
            fit.z_min.low <= Z_MIN <= fit.z_min.high,
            fit.z_max.low <= Z_MAX <= fit.z_max.high,
        ]
    assert (hits / replicas >= 0.85).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_dense_start_beyond_the_domain_does_not_set_z_max(method: Any) -> None:
    path = relaxing(4.2, np.random.default_rng(12))
    fit = fit_accessible_states(*path, method=method)
    assert path[1][0] > Z_MAX + 0.3
    assert fit.z_max.value == pytest.approx(Z_MAX, abs=0.05)
    assert fit.outside_worst > 0.3


@pytest.mark.parametrize("count", [301, 3001])
def test_envelope_does_not_grow_with_the_number_of_states(count: int) -> None:
    random = np.random.default_rng(13)
    fits = [
        fit_accessible_states(
            *relaxing(3.1, random, count=count, noise=0.04, memory=0.0),
            method="envelope",
            bootstrap=Bootstrap(samples=20),
        )
        for _ in range(10)
    ]
    assert np.mean([fit.z_max.value for fit in fits]) == pytest.approx(Z_MAX, abs=0.02)
    assert np.mean([fit.z_min.value for fit in fits]) == pytest.approx(Z_MIN, abs=0.02)


def test_envelope_keeps_a_true_excursion_that_the_critical_state_does_not_show() -> None:
    """A peak in G_1 inside the strain path is a state that the domain must admit."""
    strain, z, a = relaxing(3.3, np.random.default_rng(14), noise=0.005, memory=0.3)
    peak = 0.15 * np.exp(-(((strain - 0.1) / 0.04) ** 2))  # raises G_1, leaves G_2
    high, low = z * (1 + a / 2) + peak, z * (1 - a / 2)
    z, a = (high + low) / 2, 2 * (high - low) / (high + low)
    critical = fit_accessible_states(strain, z, a)
    envelope = fit_accessible_states(strain, z, a, method="envelope")
    assert critical.z_max.value == pytest.approx(Z_MAX, abs=0.02)
    assert envelope.z_max.value == pytest.approx(Z_MAX + 0.15, abs=0.03)
    assert envelope.z_min.value == pytest.approx(Z_MIN, abs=0.02)
    assert envelope.outside_significant < critical.outside_significant


def test_lines_use_more_states_and_so_know_more() -> None:
    path = relaxing(3.3, np.random.default_rng(15))
    critical = fit_accessible_states(*path)
    lines = fit_accessible_states(*path, method="lines")
    assert lines.z_max.half_width < critical.z_max.half_width


@pytest.mark.parametrize("method", METHODS)
def test_sign_of_a_and_direction_of_strain_do_not_matter_in_2d(method: Any) -> None:
    strain, z, a = relaxing(3.1, np.random.default_rng(16))
    one = fit_accessible_states(strain, z, a, method=method)
    two = fit_accessible_states(-strain, z, -a, method=method)
    assert one.z_max == two.z_max and one.z_min == two.z_min
    again = fit_accessible_states(strain, z, a, method=method)
    assert again == one


def test_a_table_of_paths_and_labelled_arrays_are_the_same_as_lists() -> None:
    random = np.random.default_rng(21)
    table = np.stack([np.stack(relaxing(z_0, random)) for z_0 in (3.1, 3.7)], axis=1)
    listed = fit_accessible_states(*[list(column) for column in table])
    labelled = fit_accessible_states(*[xr.DataArray(c, dims=("path", "record")) for c in table])
    assert fit_accessible_states(*table) == listed == labelled


def test_paths_of_unequal_length_and_several_seeds() -> None:
    random = np.random.default_rng(17)
    paths = [relaxing(z_0, random, count=n) for z_0 in (3.1, 3.7) for n in (151, 301, 226)]
    columns = [list(column) for column in zip(*paths, strict=True)]
    seeds = [1, 2, 3, 1, 2, 3]
    for method in METHODS:
        fit = fit_accessible_states(*columns, method=method, seeds=seeds, bootstrap=QUICK)
        assert fit.z_max.value == pytest.approx(Z_MAX, abs=0.03)
        assert fit.between_seeds is not None
        assert fit.between_seeds["z_max"].low < Z_MAX < fit.between_seeds["z_max"].high
        assert len(fit.plateau) == 6


def test_seeds_that_differ_widen_the_interval() -> None:
    random = np.random.default_rng(18)
    shift = [-0.1, -0.04, 0.0, 0.05, 0.09]
    paths = [relaxing(3.3, random, noise=0.01) for _ in shift]
    strains = [path[0] for path in paths]
    zs = [path[1] + s for path, s in zip(paths, shift, strict=True)]
    anisotropies = [path[2] for path in paths]
    for method in METHODS:
        alone = fit_accessible_states(strains, zs, anisotropies, method=method, bootstrap=QUICK)
        seeded = fit_accessible_states(
            strains, zs, anisotropies, method=method, seeds=range(5), bootstrap=QUICK
        )
        assert seeded.z_min.half_width > 1.5 * alone.z_min.half_width


def test_outside_states_are_counted_and_measured() -> None:
    strain, z, a = relaxing(3.3, np.random.default_rng(19), noise=0.0, count=301)
    z[:3] = 4.5
    a[:3] = 0.0
    fit = fit_accessible_states(strain, z, a)
    domain = AccessibleDomain(z_min=fit.z_min.value, z_max=fit.z_max.value)
    assert fit.outside_worst == pytest.approx(4.5 - fit.z_max.value)
    assert fit.outside_fraction == pytest.approx(1 - domain.contains(z, a).mean(), abs=0.01)
    assert fit.outside_significant >= 3 / 301


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"method": "best"}, "must be one of critical, envelope, lines"),
        ({"dimension": 5}, "must be 2 or 3"),
        ({"z": np.ones(10)}, "eps_q has 301 states, z has 10"),
        ({"eps_q": np.r_[np.linspace(0, 0.2, 200), np.linspace(0.2, 0.1, 101)]}, "turns back"),
        ({"z": np.full(301, np.nan)}, "must be finite"),
        ({"z": np.zeros(301)}, "must be > 0"),
        ({"plateau": 0.299}, "widen the plateau"),
        ({"plateau": (0.2, 0.1)}, "first < last"),
        ({"a": np.zeros(301)}, "span no domain"),
        ({"seeds": [1, 2]}, "there are 1 paths"),
        ({"dimension": 3, "a": np.full(301, -0.2)}, "mode='extension'"),
        ({"z": ["x"] * 301}, "not numeric"),
        ({"z": 3.3}, "z has shape ()"),
        ({"z": []}, "z has shape (0,)"),
        ({"a": [np.zeros(301), np.zeros(301)]}, "eps_q holds 1 paths, a holds 2"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_bad_input_is_one_clear_line(change: dict[str, Any], says: str) -> None:
    strain, z, a = relaxing(3.3, np.random.default_rng(20))
    arguments: dict[str, Any] = {"eps_q": strain, "z": z, "a": a, **change}
    with pytest.raises((InvalidSettings, MissingData)) as caught:
        fit_accessible_states(**arguments)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", METHODS)
def test_blocks_follow_the_memory_unless_they_are_given(method: Any) -> None:
    random = np.random.default_rng(22)
    short = fit_accessible_states(*relaxing(3.3, random, memory=0.0), method=method)
    long = fit_accessible_states(*relaxing(3.3, random, memory=0.85), method=method)
    assert short.block_length <= 4 < 10 <= long.block_length
    given = Bootstrap(samples=50, block_length=7)
    assert (
        fit_accessible_states(*relaxing(3.3, random), method=method, bootstrap=given).block_length
        == 7
    )
