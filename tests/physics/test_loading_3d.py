"""Spheres under triaxial, true triaxial and simple shear: held stresses and exact rates."""

from __future__ import annotations

import numpy as np
import pytest

from granufab.errors import InvalidSettings
from granufab.fabric import measure_run
from granufab.packing import Packing
from granufab.simulate import (
    Biaxial,
    Case,
    ConstantMean,
    Loading,
    Material,
    Sample,
    SimpleShear,
    Simulation,
    Stage,
    compress,
    random_sample,
    run_case,
)
from granufab.simulate.settings import parse_case

RATE = 1.5e-3


@pytest.fixture(scope="module")
def spheres() -> Packing:
    """150 spheres at rest under p = 1."""
    return compress(random_sample(150, dimension=3, seed=5), friction=0.3)


def _march(packing: Packing, loading: Loading, count: int) -> tuple[Simulation, np.ndarray]:
    simulation = Simulation(packing, loading, material=Material(friction=0.4))
    stress = np.empty((count, 3, 3))
    converged = 0
    for k in range(count):
        converged += simulation.step().converged
        stress[k] = simulation.stress
    assert converged >= 0.97 * count
    return simulation, stress


@pytest.mark.parametrize("sign", [1, -1], ids=["compression", "extension"])
def test_triaxial_loading_holds_both_lateral_stresses(sign, spheres):
    loading = Biaxial(axial_rate=sign * RATE, axis=2, dimension=3)
    simulation, stress = _march(spheres, loading, 250)
    for axis in (0, 1):
        assert stress[:, axis, axis].mean() == pytest.approx(1.0, abs=2e-3)
        assert np.abs(stress[:, axis, axis] - 1).max() < 2e-2
    axial = simulation.strain[2, 2]
    assert axial == pytest.approx(sign * RATE * 250 * simulation.step_size, rel=1e-12)
    assert sign * (stress[-50:, 2, 2].mean() - 1) > 0.1
    assert loading.axisymmetric


@pytest.mark.parametrize("b", [None, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_true_triaxial_rates_are_exact_and_the_mean_stress_is_held(b, sign, spheres):
    loading = ConstantMean(rate=sign * RATE, axis=1, dimension=3, b=b)
    simulation, stress = _march(spheres, loading, 60)
    mean = np.trace(stress, axis1=1, axis2=2) / 3
    assert np.abs(mean - 1).max() < 1e-2
    assert mean.mean() == pytest.approx(1.0, abs=1e-3)
    elapsed = 60 * simulation.step_size
    first, third, second = (simulation.strain[k, k] for k in (1, 2, 0))
    assert first - third == pytest.approx(sign * RATE * elapsed, rel=1e-10)
    assert second - third == pytest.approx(sign * RATE * (b or 0.0) * elapsed, rel=1e-9, abs=1e-15)
    assert np.trace(loading.rate) == pytest.approx(0, abs=1e-18)
    assert loading.axisymmetric == (b in (None, 0.0))
    assert loading.deviatoric_rate == pytest.approx(sign * RATE, rel=1e-12)


def test_the_intermediate_stress_rises_with_the_intermediate_rate(spheres):
    """b = 1 is extension along the third axis: the middle stress leaves σ3 for σ1."""
    ratio = {}
    for b in (0.0, 1.0):
        _, stress = _march(spheres, ConstantMean(rate=RATE, axis=1, dimension=3, b=b), 250)
        late = stress[-50:].mean(axis=0)
        assert late[1, 1] > late[2, 2] + 0.2
        ratio[b] = (late[0, 0] - late[2, 2]) / (late[1, 1] - late[2, 2])
    assert ratio[1.0] > ratio[0.0] + 0.15


def test_simple_shear_of_spheres_holds_the_normal_stress(spheres):
    simulation, stress = _march(spheres, SimpleShear(rate=RATE, axis=2, dimension=3), 150)
    assert stress[:, 2, 2].mean() == pytest.approx(1.0, abs=2e-3)
    assert simulation.rate[1, 2] == RATE
    assert stress[-1, 1, 2] < -0.03
    assert not simulation.loading.axisymmetric


def test_signed_anisotropy_of_a_run_has_the_sign_and_axes_of_its_loading(spheres):
    stages = {
        "compression": Stage(loading="triaxial", strain=0.03, axis=2, inertial_number=2e-3),
        "extension": Stage(loading="constant-mean", strain=-0.03, axis=2, inertial_number=2e-3),
        "plane": Stage(loading="constant-mean", strain=0.03, axis=2, b=0.5, inertial_number=2e-3),
    }
    late = {}
    for name, stage in stages.items():
        case = Case(sample=Sample(grain_count=150, dimension=3), path=(stage,))
        run = run_case(case, start=spheres)
        late[name] = float(run.series["a_signed"][-8:].mean())
        assert float(run.series["eps_q"][-1]) == pytest.approx(stage.strain, abs=2e-4)
        frame = run.frames[-1]
        np.testing.assert_array_equal(frame.direction, [0, 0, 1])
        if name == "plane":
            np.testing.assert_array_equal(frame.extension, [1, 0, 0])
            measured = measure_run(run).isel(frame=-1)
            a = 2.5 * float(measured["f_zz"] - measured["f_xx"])
            assert float(measured["a_signed"]) == pytest.approx(a, abs=1e-12)
            assert float(run.series["a_signed"][-1]) == pytest.approx(a, abs=1e-12)
        else:
            assert frame.extension is None
    assert late["compression"] > 0.05
    assert late["extension"] < -0.05
    assert late["plane"] > 0.03


@pytest.mark.parametrize(
    ("path", "dimension", "words"),
    [
        ({"loading": "triaxial"}, 2, "path.0.loading is triaxial, .* use biaxial"),
        ({"loading": "biaxial"}, 3, "path.0.loading is biaxial, .* use triaxial"),
        ({"b": 0.5}, 2, "path.0.b is 0.5, which exists only in 3D"),
        ({"b": 0.5, "loading": "triaxial"}, 3, "b is for loading constant-mean"),
        ({"b": 1.5}, 3, "path.0.b.*less than or equal to 1"),
    ],
)
def test_settings_that_do_not_fit_the_dimension_are_refused(path, dimension, words):
    with pytest.raises(InvalidSettings, match=words):
        parse_case({"sample": {"dimension": dimension}, "path": [path]})


def test_b_is_refused_in_two_dimensions():
    with pytest.raises(InvalidSettings, match=r"b is 0.3, allowed 0..1 in 3D"):
        ConstantMean(rate=1.0, b=0.3)
