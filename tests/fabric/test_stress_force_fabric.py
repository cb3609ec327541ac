"""Anisotropies of forces and branches, and the stress ratio that they make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import draw_plane, hexagonal, square
from synthetic_forces import packing_of, stressed

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import (
    anisotropy_stress_ratio,
    neighbours_within,
    signed_anisotropy,
    stress_force_fabric,
)

CASES = [(0.3, 0.02, 0.25, 0.05), (-0.2, 0.1, -0.35, -0.1), (0.45, -0.1, 0.4, 0.15)]


def _stress_plane(a, a_l, a_n, a_t):
    """Σ f⊗ℓ over the half circle by equally spaced angles, exact for trigonometric sums."""
    psi = np.arange(48) * np.pi / 48
    n = np.array([np.cos(psi), np.sin(psi)])
    t = np.array([-np.sin(psi), np.cos(psi)])
    c = np.cos(2 * psi)
    force = (1 + a_n * c) * n - a_t * np.sin(2 * psi) * t
    return np.einsum("k,ik,jk->ij", (1 + a * c) * (1 + a_l * c), force, n)


def _stress_space(a, a_l, a_n, a_t):
    """The same over the sphere, the axis along z: Gauss points in cos ψ, equal azimuths."""
    cosine, weight = np.polynomial.legendre.leggauss(24)
    turn = np.arange(16) * np.pi / 8
    u, phi = (x.ravel() for x in np.meshgrid(cosine, turn, indexing="ij"))
    w = np.repeat(weight, 16)
    s = np.sqrt(1 - u**2)
    n = np.array([s * np.cos(phi), s * np.sin(phi), u])
    t = np.array([u * np.cos(phi), u * np.sin(phi), -s])
    y = 3 * u**2 - 1
    force = (1 + a_n * y) * n - a_t * 2 * s * u * t
    return np.einsum("k,ik,jk->ij", w * (1 + a * y) * (1 + a_l * y), force, n)


@pytest.mark.parametrize("four", CASES)
def test_full_forms_are_the_integral_of_the_harmonics(four) -> None:
    plane, space = _stress_plane(*four), _stress_space(*four)
    assert float(anisotropy_stress_ratio(*four)) == pytest.approx(
        (plane[0, 0] - plane[1, 1]) / np.trace(plane), abs=1e-12
    )
    ratio = (space[2, 2] - space[0, 0]) / np.trace(space)
    assert float(anisotropy_stress_ratio(*four, dimension=3)) == pytest.approx(ratio, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_linear_form_is_the_first_order_of_the_full_one(dimension) -> None:
    four = 1e-6 * np.array([1.0, 0.3, -0.7, 2.0])
    full, linear = (
        float(anisotropy_stress_ratio(*four, dimension=dimension, full=full))
        for full in (True, False)
    )
    assert linear == pytest.approx({2: 0.5, 3: 0.4}[dimension] * four.sum(), rel=1e-12)
    assert full == pytest.approx(linear, rel=1e-5)


@pytest.mark.parametrize("axis", [(0.3, 1.0), (0.2, -0.5, 1.0)])
@pytest.mark.parametrize("four", [(0.3, 0.02, 0.25, 0.05), (-0.3, 0.1, -0.25, -0.1)])
def test_known_harmonics_come_back(axis, four) -> None:
    packing = stressed(np.random.default_rng(5), 20000, *four, axis)
    found = stress_force_fabric(packing, axis=np.array(axis), criterion="listed", z_definition="z")
    for name, value in zip(("a", "a_l", "a_n", "a_t"), four, strict=True):
        error = float(found[f"{name}_error"])
        assert 0 < error < 0.02
        assert float(found[name]) == pytest.approx(value, abs=3 * error), name
    expected = float(anisotropy_stress_ratio(*four, dimension=len(axis)))
    for name in ("q_over_p_signed", "q_over_p_full", "q_over_p_harmonic"):
        error = float(found[f"{name}_error"])
        assert float(found[name]) == pytest.approx(expected, abs=3 * error), name
    assert float(found["full_over_measured"]) == pytest.approx(1.0, abs=0.02)


def test_force_anisotropy_is_of_directions_not_of_contacts() -> None:
    """Without noise the forms return exactly, where averages over contacts would be biased."""
    axis = np.array([0.0, 1.0])
    normal = draw_plane(3000, 0.8, np.pi / 2, np.random.default_rng(1))
    packing = packing_of(normal, 0.1, 0.5, 0.2, axis)
    found = stress_force_fabric(packing, axis=axis, criterion="listed", z_definition="z")
    for name, value in (("a_l", 0.1), ("a_n", 0.5), ("a_t", 0.2)):
        assert float(found[name]) == pytest.approx(value, abs=1e-10)
    assert float(found["force_0"]) == pytest.approx(2.0, abs=1e-10)
    force = np.einsum("ci,ci->c", packing.contacts.force, normal)
    weighted = 2 * np.mean(force * (2 * normal[:, 1] ** 2 - 1)) / force.mean()
    assert abs(weighted - 0.5) > 0.2


def test_density_above_order_two_does_not_leak_into_the_forces() -> None:
    axis = np.array([1.0, 0.0])
    normal = draw_plane(4000, 0.2, 0.0, np.random.default_rng(2), modes=[(4, 0.5, 0.0)])
    found = stress_force_fabric(
        packing_of(normal, 0.0, 0.4, 0.1, axis), axis=axis, criterion="listed", z_definition="z"
    )
    assert float(found["a_n"]) == pytest.approx(0.4, abs=1e-10)
    assert float(found["a_t"]) == pytest.approx(0.1, abs=1e-10)
    assert float(found["q_over_p_harmonic"]) == pytest.approx(
        float(found["q_over_p_signed"]), abs=0.01
    )
    assert abs(float(found["q_over_p_full"]) - float(found["q_over_p_signed"])) > 0.02


@pytest.mark.parametrize("axis", [(0.0, 1.0), (0.0, 0.0, 1.0)])
def test_curves_follow_the_fits_and_either_orientation_of_a_contact_gives_the_same(axis) -> None:
    packing = stressed(np.random.default_rng(3), 20000, 0.2, 0.05, 0.3, 0.2, axis)
    options = {"axis": np.array(axis), "criterion": "listed", "z_definition": "z", "replicas": 0}
    found = stress_force_fabric(packing, **options)
    for name in ("normal_force", "tangential_force", "mean_length", "density"):
        pull = (found[name] - found[f"{name}_fit"]) / found[f"{name}_error"]
        assert float((pull**2).mean()) < 2.5, name
    contacts = packing.contacts
    turned = replace(
        contacts,
        pair=contacts.pair[:, ::-1],
        normal=-contacts.normal,
        branch=-contacts.branch,
        force=-contacts.force,
    )
    again = stress_force_fabric(replace(packing, contacts=turned), **options)
    for name in found.data_vars:
        np.testing.assert_allclose(again[name], found[name], atol=1e-12)


def test_pooled_states_are_resampled_as_states() -> None:
    generator = np.random.default_rng(4)
    states = [stressed(generator, 2000, 0.3, 0.0, 0.2, 0.1, (0.0, 1.0)) for _ in range(20)]
    options = {"axis": np.array([0.0, 1.0]), "criterion": "listed", "z_definition": "z"}
    several = stress_force_fabric(states, **options)
    assert several.attrs["state_count"] == 20
    assert "states" in several.attrs["bootstrap"]
    one = stress_force_fabric(states[0], **options)
    assert "contacts" in one.attrs["bootstrap"]
    assert float(several["a_n_error"]) == pytest.approx(
        float(one["a_n_error"]) / np.sqrt(20), rel=0.5
    )


@pytest.mark.parametrize("lattice", [hexagonal, square])
def test_lattice_under_pressure_is_isotropic(lattice) -> None:
    packing = lattice()
    contacts = neighbours_within(packing, 1e-9)
    loaded = replace(packing, contacts=replace(contacts, force=3.0 * contacts.normal))
    found = stress_force_fabric(loaded, axis=np.array([1.0, 0.0]))
    for name in ("a", "a_l", "a_n", "a_t", "q_over_p", "q_over_p_full"):
        assert float(found[name]) == pytest.approx(0.0, abs=1e-9), name
    assert float(found["a"]) == pytest.approx(
        signed_anisotropy(np.eye(2) / 2, np.array([1.0, 0.0])), abs=1e-9
    )
    assert float(found["force_0"]) == pytest.approx(3.0)


def test_missing_forces_and_wrong_axes_are_named() -> None:
    packing = stressed(np.random.default_rng(0), 100, 0.0, 0.0, 0.0, 0.0, (0.0, 1.0))
    bare = replace(packing, contacts=replace(packing.contacts, force=None))
    with pytest.raises(MissingData, match="contact forces"):
        stress_force_fabric(bare, criterion="listed")
    with pytest.raises(InvalidSettings, match="axis must be a non-zero vector of 2"):
        stress_force_fabric(packing, axis=np.zeros(2), criterion="listed", z_definition="z")
    with pytest.raises(MissingData, match="no states"):
        stress_force_fabric([])
    with pytest.raises(InvalidSettings, match="must be 2 or 3"):
        anisotropy_stress_ratio(0.1, 0.0, 0.1, 0.1, dimension=4)
