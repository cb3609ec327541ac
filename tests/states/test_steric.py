"""Excluded volume around one grain: windows integrate the second-order E."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from granufab.errors import InvalidSettings
from granufab.states import (
    steric_anisotropy,
    steric_coordination,
    steric_margin,
    window_occupation,
)


@pytest.mark.parametrize("centre", [0.0, 0.4, 1.3])
def test_plane_window_is_the_integral_of_e(centre) -> None:
    z, a, width = 3.7, 0.3, 0.95
    value = quad(
        lambda t: z / (2 * np.pi) * (1 + a * np.cos(2 * t)), centre - width / 2, centre + width / 2
    )[0]
    assert float(window_occupation(z, a, width, centre)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("centre", [0.0, 0.7, np.pi / 2])
@pytest.mark.parametrize("a", [0.4, -0.3])
def test_cap_is_the_integral_of_e(centre, a) -> None:
    z, width = 4.6, 1.0
    cosine, weight = np.polynomial.legendre.leggauss(20)
    edge = np.cos(width / 2)
    u = 0.5 * (1 - edge) * cosine + 0.5 * (1 + edge)
    turn = np.arange(12) * np.pi / 6
    polar = np.cos(centre) * u[:, None] + np.sin(centre) * np.sqrt(1 - u**2)[:, None] * np.cos(turn)
    density = z / (4 * np.pi) * (1 + a * (3 * polar**2 - 1))
    value = 0.5 * (1 - edge) * float(weight @ density.sum(axis=1)) * np.pi / 6
    assert float(window_occupation(z, a, width, centre, 3)) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_bound_is_where_the_margin_vanishes(dimension) -> None:
    z, width = np.array([2.5, 3.0, 4.0]), 0.9
    limit = steric_anisotropy(z, width, dimension)
    np.testing.assert_allclose(steric_margin(z, limit, width, dimension), 0.0, atol=1e-12)
    assert (steric_margin(z, limit + 0.01, width, dimension) < 0).all()
    assert (steric_margin(z, limit - 0.01, width, dimension) > 0).all()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("a", [0.5, -0.4, 0.0])
def test_margin_is_the_worst_of_all_windows(dimension, a) -> None:
    centres = np.linspace(0, np.pi, 721)
    worst = window_occupation(3.5, a, 1.0, centres, dimension).max()
    assert float(steric_margin(3.5, a, 1.0, dimension)) == pytest.approx(1 - worst, abs=1e-12)


def test_equal_grains() -> None:
    assert steric_coordination(np.pi / 3) == pytest.approx(6.0)
    assert steric_coordination(np.pi / 3, 3) == pytest.approx(2 / (1 - np.sqrt(3) / 2))
    assert float(steric_margin(6.0, 0.0, np.pi / 3)) == pytest.approx(0.0, abs=1e-12)
    # With z_steric at the fitted z_max the paper's own critical state would not fit.
    assert float(steric_anisotropy(3.65, 2 * np.pi / 4.015)) == pytest.approx(0.156, abs=5e-4)


def test_bad_values_are_named() -> None:
    with pytest.raises(InvalidSettings, match="exclusion angle"):
        steric_margin(3.0, 0.1, 4.0)
    with pytest.raises(InvalidSettings, match="z holds -1"):
        window_occupation(-1.0, 0.1, 1.0)
    with pytest.raises(InvalidSettings, match="dimension is 4"):
        steric_coordination(1.0, 4)
