"""Force distribution of known laws, exact shares, friction at its limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_forces import packing_of, stressed

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import force_statistics
from granufab.packing import Packing

LISTED = {"criterion": "listed", "z_definition": "z"}


def _with_forces(normal_force, *, shear=None, seed=0) -> Packing:
    generator = np.random.default_rng(seed)
    angle = generator.uniform(0, np.pi, len(normal_force))
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    packing = packing_of(normal, 0.0, 0.0, 0.0, np.array([0.0, 1.0]))
    force = normal_force[:, None] * normal
    if shear is not None:
        force = force + shear[:, None] * normal[:, ::-1] * [-1.0, 1.0]
    assert packing.contacts is not None
    return replace(packing, contacts=replace(packing.contacts, force=force))


def _drawn(count, alpha, beta, generator):
    """x with P ∝ x^α below 1 and e^{−βx} above, continuous there; its mean is returned too."""
    weak, strong = 1 / (alpha + 1), 1 / beta
    below = generator.uniform(size=count) < weak / (weak + strong)
    power = generator.uniform(size=count) ** (1 / (alpha + 1))
    return np.where(below, power, 1 + generator.exponential(1 / beta, count))


@pytest.mark.parametrize(("alpha", "beta"), [(-0.3, 1.6), (0.0, 1.4142135), (0.6, 1.2)])
def test_both_laws_come_back(alpha, beta) -> None:
    x = _drawn(40000, alpha, beta, np.random.default_rng(1))
    data = force_statistics(_with_forces(x), **LISTED)
    mean = x.mean()
    assert float(data["mean_force"]) == pytest.approx(mean)
    if mean <= 1.0:
        error = float(data["weak_exponent_error"])
        assert float(data["weak_exponent"]) == pytest.approx(alpha, abs=3 * error)
    if mean >= 1.0:
        error = float(data["strong_decay_error"])
        assert float(data["strong_decay"]) == pytest.approx(beta * mean, abs=3 * error)
        assert float(data["tail_variation"]) == pytest.approx(1.0, abs=0.05)


def test_equally_likely_logarithms_have_exponent_minus_one() -> None:
    x = np.geomspace(0.02, 1.0, 20001)[1:-1]
    strong = np.full(20000, 2.0 - x.mean())
    data = force_statistics(_with_forces(np.concatenate([x, strong])), replicas=0, **LISTED)
    assert float(data["weak_exponent"]) == pytest.approx(-1.0, abs=1e-3)


def test_density_integrates_to_the_share_of_its_bins() -> None:
    x = np.random.default_rng(2).exponential(1.0, 5000)
    data = force_statistics(_with_forces(x), smallest=1e-2, **LISTED)
    ratio = float(data["x"][1] / data["x"][0])
    width = data["x"] * (np.sqrt(ratio) - 1 / np.sqrt(ratio))
    inside = np.mean(x / x.mean() >= 1e-2)
    assert float((data["P_force"] * width).sum()) == pytest.approx(inside, abs=1e-9)


@pytest.mark.parametrize("axis", [(0.0, 1.0), (0.0, 0.0, 1.0)])
def test_shares_sum_to_one_and_the_fabric_is_shared_out(axis) -> None:
    packing = stressed(np.random.default_rng(6), 8000, 0.3, 0.0, 0.4, 0.1, axis)
    data = force_statistics(packing, axis=np.array(axis), **LISTED)
    for name in ("contact_share", "p_share", "q_share"):
        assert float(data[name].sum()) == pytest.approx(1.0, abs=1e-12)
    # Where forces are larger along the axis, so are strong contacts there.
    assert float(data["a"].sel(part="strong")) > float(data["a"].sel(part="weak"))
    whole = float((data["a"] * data["contact_share"]).sum())
    cosine = (packing.contacts.normal @ np.array(axis)) ** 2
    factor = {2: 2 * (2 * cosine.mean() - 1), 3: 1.25 * (3 * cosine.mean() - 1)}
    assert whole == pytest.approx(factor[len(axis)], abs=1e-10)


def test_strong_and_weak_parts_of_a_bimodal_state_are_exact() -> None:
    """Half the contacts along y bear 3, half along x bear 1: all of q comes from their gap."""
    normal = np.repeat([[0.0, 1.0], [1.0, 0.0]], 500, axis=0)
    packing = packing_of(normal, 0.0, 0.0, 0.0, np.array([0.0, 1.0]))
    force = normal * np.repeat([3.0, 1.0], 500)[:, None]
    packing = replace(packing, contacts=replace(packing.contacts, force=force))
    data = force_statistics(packing, axis=np.array([0.0, 1.0]), replicas=0, **LISTED)
    np.testing.assert_allclose(data["contact_share"], [0.5, 0.5])
    np.testing.assert_allclose(data["a"], [-2.0, 2.0])
    np.testing.assert_allclose(data["p_share"], [0.25, 0.75])
    np.testing.assert_allclose(data["q_share"], [-0.5, 1.5])


def test_contacts_exactly_at_the_friction_limit_slide() -> None:
    generator = np.random.default_rng(8)
    force = generator.exponential(1.0, 3000) + 0.01
    share = np.where(np.arange(3000) < 600, 1.0, generator.uniform(0, 0.9, 3000))
    sign = generator.choice([-1.0, 1.0], 3000)
    packing = _with_forces(force, shear=0.4 * share * sign * force)
    data = force_statistics(packing, friction=0.4, **LISTED)
    assert float(data["sliding_fraction"]) == pytest.approx(0.2, abs=1e-12)
    assert float(data["beyond_friction"]) == 0.0
    assert float(data["mean_mobilisation"]) == pytest.approx(share.mean())
    width = float(data["mobilisation"][1] - data["mobilisation"][0])
    assert float(data["P_mobilisation"].sum() * width) == pytest.approx(1.0)
    too_small = force_statistics(packing, friction=0.3, replicas=0, **LISTED)
    assert float(too_small["beyond_friction"]) == pytest.approx(np.mean(share > 0.75), abs=0.01)


def test_forces_of_each_state_are_in_its_own_mean() -> None:
    x = np.random.default_rng(9).exponential(1.0, 2000)
    options = {"friction": 0.5, "replicas": 0} | LISTED
    one = force_statistics(_with_forces(x), **options)
    both = force_statistics([_with_forces(x), _with_forces(7.0 * x)], **options)
    for name in ("weak_exponent", "strong_decay", "sliding_fraction"):
        assert float(both[name]) == pytest.approx(float(one[name]), abs=1e-9)


def test_without_friction_there_is_no_mobilisation_and_bad_values_are_named() -> None:
    packing = _with_forces(np.random.default_rng(0).exponential(1.0, 200))
    assert "sliding_fraction" not in force_statistics(packing, replicas=0, **LISTED)
    for option, text in (
        ({"friction": 0.0}, "friction is 0.0"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"weak_from": 2.0}, "weak_from"),
        ({"bins": 1}, "bins"),
    ):
        with pytest.raises(InvalidSettings, match=text):
            force_statistics(packing, **option, **LISTED)
    bare = replace(packing, contacts=replace(packing.contacts, force=None))
    with pytest.raises(MissingData, match="contact forces"):
        force_statistics(bare, **LISTED)
