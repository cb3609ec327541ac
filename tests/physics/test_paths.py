"""Paths of several stages: strains along each stage's axes, stated rates, honest provenance."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.errors import InvalidSettings
from granufab.simulate import Isotropic, Record, SimpleShear, Step, run, shear
from granufab.simulate.settings import parse_case

RARE = Record(series_interval=5e-3, frame_interval=5e-3)


def test_a_shear_after_an_isotropic_stage_walks_its_own_strain(loose):
    path = [
        Step(loading=Isotropic(), strain=None),
        Step(loading=SimpleShear(rate=1.2e-3), strain=0.02),
    ]
    result = run(loose, path, record_settings=RARE)
    end = result.frames[-1]
    assert -2 * end.strain[0, 1] == pytest.approx(0.02, rel=0.05)
    assert end.eps_q_total == pytest.approx(0.02, rel=0.05)
    assert end.eps_q == pytest.approx(0.02, rel=0.05)
    np.testing.assert_allclose(end.direction, [-np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)


def test_biaxial_compression_states_the_inertial_number_it_has(loose):
    result = shear(loose, strain=0.02, loading="biaxial", inertial_number=1e-3)
    frames = list(result.frames)
    time = frames[-1].packing.time - frames[0].packing.time
    mass = loose.grains.mass.mean()
    achieved = frames[-1].eps_q / time * np.sqrt(mass)
    assert result.series["inertial_number"].values[-1] == pytest.approx(1e-3, rel=1e-9)
    assert achieved == pytest.approx(1e-3, rel=0.15)


def test_a_given_packing_has_no_invented_seed(loose):
    result = shear(loose, strain=0.002, record_settings=RARE)
    assert result.summary["seed"] is None
    assert result.summary["source"] == loose.source


@pytest.mark.parametrize(
    ("data", "named"),
    [
        ({"path": []}, "path"),
        ({"record": {"criterion": "foo"}}, "record.criterion"),
        ({"record": {"reach": 0.5}}, "record.reach"),
        ({"path": [{"rate": 1e-3, "inertial_number": 1e-3}]}, "not both"),
        ({"sample": {"solid_fraction": 0.69}}, "sample.solid_fraction"),
    ],
)
def test_settings_that_cannot_be_met_are_refused_in_one_line(data, named):
    with pytest.raises(InvalidSettings) as caught:
        parse_case(data)
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_given_rate_replaces_the_inertial_number():
    assert parse_case({"path": [{"rate": 2e-3}]}).path[0].inertial_number is None
