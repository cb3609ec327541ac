import numpy as np
import pytest
from fabric_cases import contacts_of, draw_plane, draw_sphere, hexagonal

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import (
    anisotropy_noise,
    neighbours_within,
    orientation,
    select_network,
    symmetry_axis,
)


def test_plane_histogram_integrates_to_half_the_coordination():
    normal = draw_plane(5000, 0.4, 1.0, np.random.default_rng(1))
    data = orientation(contacts_of(normal), z=3.7, bins=36)
    assert data.E.sum() * np.pi / 36 == pytest.approx(3.7 / 2)
    assert data["count"].sum() == 5000
    assert data.attrs["z"] == 3.7


def test_space_histogram_integrates_to_half_the_coordination():
    normal = draw_sphere(5000, 0.4, [0, 0, 1], np.random.default_rng(1))
    data = orientation(contacts_of(normal), z=4.9, bins=20, axis=np.array([0, 0, 1.0]))
    # Equal solid angles of 2π/20 each.
    assert data.E.sum() * 2 * np.pi / 20 == pytest.approx(4.9 / 2)
    np.testing.assert_allclose(np.diff(np.cos(data.theta)), -1 / 20)


def test_plane_harmonics_come_back_with_their_phases():
    count, modes = 60_000, ((4, 0.2, 0.4), (6, 0.1, 0.9))
    normal = draw_plane(count, 0.3, 1.2, np.random.default_rng(2), modes)
    data = orientation(contacts_of(normal), z=4.0)
    wanted = {2: (0.3, 1.2), 4: (0.2, 0.4), 6: (0.1, 0.9)}
    for mode, (amplitude, phase) in wanted.items():
        at = data.sel(mode=mode)
        assert float(at.amplitude) == pytest.approx(amplitude, abs=3 * float(at.amplitude_error))
        # √(2/N) is the spread of an independent amplitude.
        assert float(at.amplitude_error) == pytest.approx(np.sqrt(2 / count), rel=0.15)
        period = 360 / mode
        turn = (float(at.phase) - np.degrees(phase) + period / 2) % period - period / 2
        assert abs(turn) < 3 * float(at.phase_error)
        assert 0 <= float(at.phase) < period
    share = (0.2**2 + 0.1**2) / (0.3**2 + 0.2**2 + 0.1**2)
    assert float(data.share_above_2) == pytest.approx(share, abs=0.05)
    assert float(data.misfit) > 10


def test_a_second_order_state_needs_no_higher_mode():
    normal = draw_plane(30_000, 0.3, 0.5, np.random.default_rng(3))
    data = orientation(contacts_of(normal), z=4.0)
    assert float(data.a) == pytest.approx(0.3, abs=3 * anisotropy_noise(30_000, 2, 0.3))
    assert float(data.share_above_2_corrected) < 0.005
    assert 0.4 < float(data.misfit) < 1.8
    pull = (data.E - data.E_fit) / data.E_error
    assert 0.7 < float(pull.std()) < 1.3


def test_noise_is_taken_off_the_share_of_higher_modes():
    generator = np.random.default_rng(4)
    raw, corrected = [], []
    for _ in range(40):
        data = orientation(contacts_of(draw_plane(500, 0.3, 0.0, generator)), z=4.0)
        raw.append(float(data.share_above_2))
        corrected.append(float(data.share_above_2_corrected))
    assert np.median(corrected) < 0.6 * np.median(raw)


@pytest.mark.parametrize("a", [0.5, 0.2, -0.3])
def test_space_distribution_gives_back_its_anisotropy(a):
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    normal = draw_sphere(30_000, a, axis, np.random.default_rng(5))
    data = orientation(contacts_of(normal), z=5.0, axis=axis)
    assert float(data.a) == pytest.approx(a, abs=3 * anisotropy_noise(30_000, 3, a))
    assert float(data.a_error) == pytest.approx(anisotropy_noise(30_000, 3, a), rel=0.05)
    for mode in (4, 6):
        at = data.sel(mode=mode)
        assert abs(float(at.amplitude)) < 3.5 * float(at.amplitude_error)
    expected = 5 / (4 * np.pi) * (1 + a * (3 * np.cos(data.theta) ** 2 - 1))
    pull = (data.E - expected) / data.E_error
    assert np.abs(pull).max() < 4
    assert 0.6 < float(pull.std()) < 1.4
    assert 0.4 < float(data.misfit) < 2.0
    assert abs(symmetry_axis(normal) @ axis) > 0.99


def test_error_bars_are_the_spread_between_draws():
    generator = np.random.default_rng(6)
    states = [
        orientation(contacts_of(draw_plane(400, 0.3, 0.0, generator)), z=4.0, bins=9)
        for _ in range(300)
    ]
    spread = np.std([state.E for state in states], axis=0)
    stated = np.mean([state.E_error for state in states], axis=0)
    np.testing.assert_allclose(stated, spread, rtol=0.2)


def test_a_hexagonal_lattice_has_only_the_sixth_mode():
    packing = hexagonal()
    data = orientation(neighbours_within(packing, 0.01), z=6.0, bins=12)
    np.testing.assert_allclose(data.amplitude, [0, 0, 2], atol=1e-12)
    assert float(data.share_above_2) == pytest.approx(1.0)


def test_orientation_of_a_network_uses_its_contacts():
    network = select_network(hexagonal(), criterion="gap:0.01")
    data = orientation(network.contacts, z=network.z, criterion=network.criterion.text)
    assert data.attrs["criterion"] == "gap:0.01"
    assert data.attrs["contact_count"] == 108


def test_bad_requests_are_refused():
    normal = draw_plane(10, 0.0, 0.0, np.random.default_rng(0))
    with pytest.raises(InvalidSettings, match="at least 3 bins, got 2"):
        orientation(contacts_of(normal), z=1.0, bins=2)
    with pytest.raises(MissingData, match="no contacts"):
        orientation(contacts_of(normal).select(np.zeros(10, dtype=bool)), z=1.0)
