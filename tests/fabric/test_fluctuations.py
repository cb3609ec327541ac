from dataclasses import replace

import numpy as np
import pytest
from moving_states import BIAXIAL, SIMPLE, SIMPLE_3D, TRIAXIAL, frames

from granufab.errors import InvalidPacking, InvalidSettings, MissingData
from granufab.fabric import fluctuation_spectrum, fluctuations, nonaffine_displacement
from granufab.packing import Cell, Grains, Packing


def drawn(seed, size=0.05, kind="normal"):
    generator = np.random.default_rng(seed)
    return lambda k, position: size * getattr(generator, kind)(size=position.shape)


def constant(seed, size=0.05):
    velocity = {}

    def step(k, position):
        return velocity.setdefault(
            0, size * np.random.default_rng(seed).normal(size=position.shape)
        )

    return step


@pytest.mark.parametrize("rate", [SIMPLE, BIAXIAL, SIMPLE_3D, TRIAXIAL])
@pytest.mark.parametrize("wrapped", [False, True])
def test_affine_motion_leaves_nothing(rate, wrapped):
    states = frames(rate, count=216, number=30, interval=0.05, wrapped=wrapped)
    if rate[0, 1]:
        assert states[-1].remap[0, 1] == -1  # total strain 1.45
    for end in (1, 15, 29):
        moved = nonaffine_displacement(states[0], states[end])
        np.testing.assert_allclose(moved, 0, atol=1e-12)
    data = fluctuations(states)
    assert float(data["msd"].max()) < 1e-24
    packings = fluctuations([state.packing for state in states])  # remap found by rounding
    assert float(packings["msd"].max()) < 1e-24
    np.testing.assert_allclose(packings["strain"], data["strain"], rtol=0.02)


@pytest.mark.parametrize("degrees", [20, 50, 90])
def test_a_rigid_rotation_of_bare_packings_leaves_nothing(degrees):
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[cosine, -sine], [sine, cosine]])
    position = 4 * np.random.default_rng(1).random((50, 2))
    before, after = (
        Packing(
            grains=Grains(position=position @ q.T, radius=np.full(50, 0.1)), cell=Cell(matrix=4 * q)
        )
        for q in (np.eye(2), turn)
    )
    np.testing.assert_allclose(nonaffine_displacement(before, after), 0, atol=1e-12)


def test_displacements_are_those_put_in():
    step = drawn(1)(0, np.zeros((100, 2)))
    before, after = frames(
        SIMPLE, count=100, number=2, steps=lambda k, r: step, wrapped=True, first=0.48
    )
    moved = nonaffine_displacement(before, after)
    np.testing.assert_allclose(moved, step - step.mean(axis=0), atol=1e-12)


def test_independent_steps_diffuse_and_stay_gaussian():
    states = frames(SIMPLE, count=900, number=33, interval=0.01, steps=drawn(2))
    data = fluctuations(states)
    assert data["window"].to_numpy().tolist() == [1, 2, 4, 8, 16]
    assert abs(float(data["exponent"]) - 1.0) < 4 * float(data["exponent_error"]) < 0.1
    np.testing.assert_allclose(data["msd"][0], 2 * 0.05**2, rtol=0.02)
    pull = (data["kurtosis"] / data["kurtosis_error"]).to_numpy()
    assert np.abs(pull).max() < 4
    assert float(data["kurtosis_error"][0].max()) < 0.05
    width = float(np.diff(data["value"]).mean())
    np.testing.assert_allclose(data["pdf"].sum("value") * width, 1.0, atol=1e-3)
    gauss = np.exp(-0.5 * data["value"] ** 2) / np.sqrt(2 * np.pi)
    middle = np.abs(data["value"]) < 2.5
    pull = ((data["pdf"] - gauss) / data["pdf_error"]).to_numpy()[:, middle]
    assert pull.std() == pytest.approx(1.0, abs=0.3)


def test_broad_steps_become_gaussian_with_the_window():
    """Independent Laplace steps: excess kurtosis 3/m after m of them."""
    states = frames(SIMPLE, count=1600, number=33, interval=0.01, steps=drawn(3, kind="laplace"))
    data = fluctuations(states, windows=[1, 4, 16])
    value, error = data["kurtosis"].mean("component"), data["kurtosis_error"].max("component")
    assert float(error[0]) < 0.2
    for row, expected in enumerate((3.0, 0.75, 0.1875)):
        assert abs(float(value[row]) - expected) < 4 * float(error[row])


@pytest.mark.parametrize("dimension", [2, 3])
def test_straight_motion_is_ballistic(dimension):
    states = frames(np.zeros((dimension, dimension)), count=216, number=9, steps=constant(4))
    data = fluctuations(states)
    assert float(data["exponent"]) == pytest.approx(2.0, abs=1e-9)
    assert float(data["exponent_error"]) < 1e-9
    np.testing.assert_allclose(data["local_exponent"][:-1], 2.0, atol=1e-9)
    np.testing.assert_allclose(data["relative_rms"], data["relative_rms"][0])


def test_window_zero_is_that_of_the_velocities():
    uniform = drawn(5, size=2.0, kind="random")
    states = frames(
        SIMPLE, count=900, number=5, velocities=lambda k, r: uniform(k, r), steps=drawn(6)
    )
    data = fluctuations(states)
    assert data["window"].to_numpy().tolist() == [0, 1, 2]
    np.testing.assert_allclose(data["kurtosis"].sel(window=0), -1.2, atol=0.05)
    # Uniform over 2 has the deviation 1/√3; ε̇_q = 1, d = 1.
    assert float(data["relative_rms"].sel(window=0)) == pytest.approx(1 / np.sqrt(3), rel=0.02)
    assert np.isnan(float(data["msd"].sel(window=0)))
    with pytest.raises(MissingData, match="window 0"):
        fluctuations(frames(SIMPLE, number=3), windows=[0])


def swirling(seed):
    """One wave through the whole sample, another amplitude at every step."""
    generator = np.random.default_rng(seed)

    def step(k, position):
        wave = np.cos(2 * np.pi * position[:, 1] / 20 + generator.uniform(0, 6))
        return 0.05 * generator.normal(size=2) * wave[:, None]

    return step


@pytest.mark.parametrize("motion", [drawn, swirling])
def test_jackknife_errors_match_the_scatter_between_samples(motion):
    results = []
    for seed in range(24):
        generator = np.random.default_rng(seed)
        states = frames(
            BIAXIAL, number=21, interval=0.01, steps=motion(300 + seed), generator=generator
        )
        data = fluctuations(states, windows=[1, 2])
        names = ("exponent", "exponent_error", "kurtosis", "kurtosis_error", "msd", "msd_error")
        results.append([float(data[name].to_numpy().ravel()[0]) for name in names])
    value = np.array(results)
    for k in (0, 2, 4):
        ratio = value[:, k].std(ddof=1) / np.sqrt(np.mean(value[:, k + 1] ** 2))
        assert 0.4 < ratio < 1.5, names[k]  # the larger of two: rather too large


@pytest.mark.parametrize("rate", [SIMPLE, TRIAXIAL])
def test_independent_motion_has_a_flat_spectrum(rate):
    count = 900 if len(rate) == 2 else 1000
    states = frames(rate, count=count, number=9, interval=0.02, steps=drawn(7))
    data = fluctuation_spectrum(states, fit=(2.0, 20.0), bins=8)
    assert abs(float(data["slope"])) < 4 * float(data["slope_error"]) < 0.4
    pull = ((data["S"] - 1.0) / data["S_error"]).to_numpy()
    assert np.abs(pull).max() < 4
    assert pull.std() > 0.2
    pull = ((data["longitudinal"] - 1.0) / data["longitudinal_error"]).to_numpy()
    assert np.nanmax(np.abs(pull)) < 5


@pytest.mark.parametrize(
    ("rate", "mode", "along"),
    [(SIMPLE, (2, -3), True), (SIMPLE, (3, 1), False), (TRIAXIAL, (1, 2, 1), True)],
)
def test_one_wave_puts_its_power_where_it_must(rate, mode, along):
    dimension = len(rate)
    side = 20 if dimension == 2 else 8
    lattice = side * np.eye(dimension)
    lattice[0, 1] = 0.45 * side  # a tilted cell: k is not along m
    wave = 2 * np.pi * np.linalg.inv(lattice).T @ np.array(mode)
    polar = wave / np.linalg.norm(wave)
    if not along:
        polar = np.array([-polar[1], polar[0]])

    def step(k, position):
        # On the reference lattice: a wave of the cell itself, whatever its shape.
        place = np.linalg.solve(growth[0] @ lattice, position.T).T
        return 0.02 * np.cos(2 * np.pi * place @ np.array(mode))[:, None] * polar

    growth = [np.eye(dimension) + 1e-9 * rate]
    states = frames(
        1e-6 * rate, count=side**dimension, number=2, interval=1e-3, steps=step, first=0.45
    )
    data = fluctuation_spectrum(states, bins=10, shortest=2.0)
    power = data["S"] * data["modes"]
    row = int(np.argmax(power.to_numpy()))
    # Sum over ±k of all modes is N; half of it lies on one side, most of it on this wave.
    assert float(power[row]) == pytest.approx(0.5 * side**dimension, rel=0.12)
    edges = np.geomspace(0.9 * 2 * np.pi / np.hypot(side, 0.45 * side), np.pi, 11)
    shell = np.searchsorted(edges, np.linalg.norm(wave)) - 1
    own = np.searchsorted(edges, data["k"].to_numpy()) - 1
    assert own[row] == shell
    expected = dimension if along else 0.0
    assert float(data["longitudinal"][row]) == pytest.approx(expected, abs=0.1)


def test_a_power_law_comes_back():
    """A field built from waves whose power falls as k⁻²·⁵."""
    generator = np.random.default_rng(8)
    side, most = 40, 10
    axes = np.arange(-most, most + 1)
    modes = np.stack(np.meshgrid(axes, axes), axis=-1).reshape(-1, 2)
    modes = modes[(modes**2).sum(axis=1) > 0]
    length = 2 * np.pi * np.linalg.norm(modes, axis=1) / side

    def step(k, position):
        phase = 2 * np.pi * (position @ modes.T / side + generator.random(len(modes)))
        amplitude = 1e-3 * length**-1.25 * generator.normal(size=(2, len(modes)))
        return np.cos(phase) @ amplitude.T

    states = frames(np.zeros((2, 2)), count=side**2, number=7, steps=step)
    data = fluctuation_spectrum(states, fit=(5.0, 40.0))
    assert float(data["slope_error"]) < 0.15
    assert abs(float(data["slope"]) - 2.5) < 3 * float(data["slope_error"])
    assert float(data["line_slope"]) == pytest.approx(float(data["slope"]) - 1.0)


def test_refusals():
    states = frames(SIMPLE, count=100, number=5)
    with pytest.raises(InvalidSettings, match="at least two states"):
        fluctuations(states[0])
    with pytest.raises(InvalidSettings, match="between 0 and 4"):
        fluctuations(states, windows=[9])
    with pytest.raises(InvalidSettings, match="equal intervals"):
        fluctuations([states[k] for k in (0, 2, 3)])
    assert fluctuations([states[k] for k in (0, 1, 2, 4)]).attrs["states"] == 3  # the last left out
    other = frames(SIMPLE, count=81, number=2)
    with pytest.raises(InvalidPacking, match="different grains"):
        nonaffine_displacement(states[0], other[1])
    with pytest.raises(MissingData, match="cell"):
        nonaffine_displacement(states[0], replace(states[1].packing, cell=None))
    with pytest.raises(InvalidSettings, match="no state"):
        fluctuations(states, stage=3)
    walls = Cell(matrix=10 * np.eye(2), periodic=(True, False))
    boxed = Packing(grains=Grains(position=np.ones((1, 2)), radius=np.ones(1)), cell=walls)
    moved = replace(boxed, cell=replace(walls, matrix=np.diag([10.1, 9.9])))
    with pytest.raises(InvalidSettings, match="periodic along every axis"):
        fluctuation_spectrum([boxed, moved])
