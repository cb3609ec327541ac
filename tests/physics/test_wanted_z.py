"""A wanted coordination number is reached, or refused with what can be reached."""

from __future__ import annotations

import re

import pytest

from granufab.errors import InvalidSettings, NotConverged
from granufab.fabric import measure
from granufab.simulate import Sample, compress, prepare, random_sample


@pytest.mark.parametrize("wanted", [3.4, 3.7])
def test_a_wanted_coordination_is_reached(wanted):
    told = []
    made = prepare(
        Sample(grain_count=400, coordination=wanted, seed=2),
        progress=lambda text, fraction: told.append((text, fraction)),
    )
    values = measure(made.packing, criterion="force")
    assert values["z_backbone"] == pytest.approx(wanted, abs=0.05)
    assert made.wanted == wanted
    assert made.reached["z_backbone"] == pytest.approx(values["z_backbone"], rel=1e-12)
    assert made.reached["phi"] == pytest.approx(values["phi"], rel=1e-12)
    assert dict(made.trials)[made.friction] == made.reached["z_backbone"]
    assert any(f"z_0 = {wanted:g}" in text for text, _ in told)
    assert all(0.0 <= fraction <= 1.0 for _, fraction in told)


def test_another_definition_of_z_can_be_wanted():
    sample = Sample(grain_count=400, coordination=3.2, z_definition="z", seed=2)
    made = prepare(sample)
    assert made.reached["z"] == pytest.approx(3.2, abs=0.05)
    assert made.reached["z_backbone"] > 3.25


def test_an_impossible_coordination_is_refused_with_the_reachable_range():
    with pytest.raises(NotConverged) as refused:
        prepare(Sample(grain_count=300, coordination=4.5, seed=2))
    message = str(refused.value)
    assert "\n" not in message
    assert "4.5" in message
    bounds = re.search(r"from (\d\.\d+) to (\d\.\d+)", message)
    assert bounds is not None
    assert 2.8 < float(bounds[1]) < 3.3
    assert 3.9 < float(bounds[2]) < 4.1


def test_compaction_friction_decides_the_coordination():
    reached = []
    for friction in (0.0, 0.1, 0.5):
        packing = compress(random_sample(400, seed=1), friction=friction)
        reached.append(measure(packing, criterion="force"))
    z, phi = [r["z_backbone"] for r in reached], [r["phi"] for r in reached]
    assert 4.05 > z[0] > z[1] + 0.1 > z[2] + 0.2 > 3.0
    assert 0.86 > phi[0] > phi[1] > phi[2] > 0.75


@pytest.mark.parametrize("friction", [-0.1, float("nan"), float("inf")])
def test_a_bad_compaction_friction_is_refused(friction):
    with pytest.raises(InvalidSettings, match="compaction friction"):
        compress(random_sample(10, seed=1), friction=friction)


@pytest.mark.slow
@pytest.mark.parametrize("wanted", [3.3, 3.7])
def test_the_papers_coordination_numbers_are_reached(wanted):
    made = prepare(Sample(grain_count=2000, coordination=wanted, seed=1))
    assert measure(made.packing)["z_backbone"] == pytest.approx(wanted, abs=0.05)
    assert made.summary["residual"] <= 1e-6
