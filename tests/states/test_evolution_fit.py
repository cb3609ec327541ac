"""Fits of the evolution law to paths that a known law walked."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from granufab.errors import InvalidSettings
from granufab.states import (
    Bootstrap,
    EvolutionFit,
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    fit_evolution,
    predict_evolution,
    proportional_gradient,
)

QUICK = Bootstrap(samples=60)
TRUE = EvolutionLaw(
    z_min=2.75, z_max=3.65, gain_rate=35.0, loss_rate=35.0,
    shedding=3000.0, shedding_ratio=0.3, memory=0.8,
)  # fmt: skip


def walked(
    law: EvolutionLaw, z_0: float, signs: tuple[int, ...] = (1,), noise: float = 0.01, seed: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(ε_q, z, a') of a straight path with its reversals, noise added."""
    gradient = proportional_gradient(law.dimension)
    stages = [StrainStage(gradient=s * gradient, times=np.linspace(0, 0.3, 151)) for s in signs]
    axis = np.eye(law.dimension)[1]
    start = fabric_from_state(z_0, direction=axis)
    result = predict_evolution(law, start, stages, direction=axis, tolerance=1e-8)
    scatter = noise * np.random.default_rng(seed).normal(size=(2, result.sizes["record"]))
    scatter[:, 0] = 0.0
    return (
        result["eps_q"].values,
        result["z"].values + scatter[0],
        result["a_signed"].values + scatter[1],
    )


@pytest.fixture(scope="module")
def fitted() -> EvolutionFit:
    return fit_evolution(*walked(TRUE, 4.0), form="memory", limits="fitted", bootstrap=QUICK)


def test_a_known_law_comes_back(fitted: EvolutionFit) -> None:
    assert fitted.law.gain_rate == fitted.law.loss_rate
    assert fitted.rms["z"] == pytest.approx(0.01, abs=0.002)
    assert fitted.rms["a"] == pytest.approx(0.01, abs=0.002)
    known = {"rate": 35.0, "shedding": 3000.0, "shedding_ratio": 0.3, "memory": 0.8}
    for name, value in (known | {"z_min": 2.75, "z_max": 3.65}).items():
        estimate = fitted.parameters[name]
        half = estimate.half_width
        assert estimate.low - half <= value <= estimate.high + half, name
        assert half < 0.6 * value, name


def test_it_predicts_a_path_it_has_not_seen(fitted: EvolutionFit) -> None:
    strain, z, a = walked(TRUE, 3.3, (1, -1), noise=0.0)
    gradient = proportional_gradient(2)
    times = np.linspace(0, 0.3, 151)
    stages = [StrainStage(gradient=s * gradient, times=times) for s in (1, -1)]
    result = fitted.predict(fabric_from_state(3.3), stages, samples=15)
    assert np.allclose(result["eps_q"], strain, rtol=0, atol=1e-12)
    assert np.sqrt(np.mean((result["z"] - z) ** 2)) < 0.02
    assert np.sqrt(np.mean((result["a_signed"] - a) ** 2)) < 0.03
    inside = (result["a_low"] <= a) & (a <= result["a_high"])
    assert inside.mean() > 0.9
    # the band is not narrower than the scatter of single states alone
    assert float((result["z_high"] - result["z_low"]).min()) >= 2 * 1.95 * fitted.rms["z"]


def test_limits_of_the_critical_state() -> None:
    fit = fit_evolution(*walked(TRUE, 3.3), form="shedding", bootstrap=QUICK)
    assert fit.limits == "critical"
    assert fit.law.z_min == pytest.approx(2.75, abs=0.05)
    assert fit.law.z_max == pytest.approx(3.65, abs=0.05)


def test_information_criteria_prefer_the_form_that_made_the_path() -> None:
    path = walked(TRUE, 4.0)
    memory = fit_evolution(*path, form="memory", bootstrap=QUICK)
    minimal = fit_evolution(*path, form="minimal", bootstrap=QUICK)
    assert memory.bic < minimal.bic - 50
    plain = EvolutionLaw(z_min=2.75, z_max=3.65, gain_rate=30.0, loss_rate=45.0)
    path = walked(plain, 3.4)
    minimal = fit_evolution(*path, form="minimal", limits="fitted", bootstrap=QUICK)
    early = fit_evolution(*path, form="early", limits="fitted", bootstrap=QUICK)
    assert minimal.bic < early.bic
    assert minimal.parameters["gain_rate"].value == pytest.approx(30.0, rel=0.3)
    assert minimal.parameters["loss_rate"].value == pytest.approx(45.0, rel=0.3)


def test_several_paths_and_reversals_are_fitted_together() -> None:
    law = EvolutionLaw(z_min=2.75, z_max=3.65, gain_rate=25.0, loss_rate=45.0)
    paths = [walked(law, 3.6), walked(law, 2.9, (1, -1), seed=2)]
    columns = [list(column) for column in zip(*paths, strict=True)]
    fit = fit_evolution(*columns, form="minimal", bootstrap=QUICK)
    assert fit.state_count == 150 + 300
    assert fit.parameters["gain_rate"].value == pytest.approx(25.0, rel=0.15)
    assert fit.parameters["loss_rate"].value == pytest.approx(45.0, rel=0.15)


def test_spheres_in_compression_and_extension() -> None:
    law = EvolutionLaw(z_min=4.0, z_max=6.0, gain_rate=25.0, loss_rate=60.0, dimension=3)
    for sign in (1, -1):
        path = walked(law, 5.2, (sign,), noise=0.005)
        fit = fit_evolution(*path, form="minimal", dimension=3, limits="fitted", bootstrap=QUICK)
        assert np.sign(path[2][-1]) == sign
        assert fit.law.z_min == pytest.approx(4.0, abs=0.05)
        assert fit.law.z_max == pytest.approx(6.0, abs=0.05)
        assert fit.law.gain_rate == pytest.approx(25.0, rel=0.15)


def test_json_round_trip(fitted: EvolutionFit) -> None:
    again = EvolutionFit.from_dict(json.loads(json.dumps(fitted.to_dict())))
    assert again.law == fitted.law
    assert again.parameters == fitted.parameters
    assert np.array_equal(again.draws, fitted.draws)
    assert again.to_dict() == fitted.to_dict()


def test_what_is_not_a_fit_is_refused(fitted: EvolutionFit) -> None:
    with pytest.raises(InvalidSettings, match="granufab fit"):
        EvolutionFit.from_dict({"z_min": 3})
    broken: dict[str, Any] = fitted.to_dict()
    del broken["rms"]
    with pytest.raises(InvalidSettings, match="rms"):
        EvolutionFit.from_dict(broken)
    wrong = fitted.to_dict()
    wrong["law"] = wrong["law"] | {"gain_rate": -1.0}
    with pytest.raises(InvalidSettings, match="gain_rate"):
        EvolutionFit.from_dict(wrong)


def test_an_undetermined_parameter_says_so() -> None:
    """A loose start sheds nothing, so B stays unknown over decades."""
    law = EvolutionLaw(z_min=2.75, z_max=3.65, gain_rate=30.0, loss_rate=30.0)
    fit = fit_evolution(*walked(law, 2.9), form="shedding", bootstrap=QUICK)
    shedding = fit.parameters["shedding"]
    assert shedding.high / shedding.low > 1e3
    assert fit.parameters["rate"].half_width < 10.0


def test_bad_options() -> None:
    path = walked(TRUE, 3.3)
    with pytest.raises(InvalidSettings, match="form"):
        fit_evolution(*path, form="best")  # type: ignore[arg-type]
    with pytest.raises(InvalidSettings, match="limits"):
        fit_evolution(*path, limits="guess")  # type: ignore[arg-type]
    with pytest.raises(InvalidSettings, match="same axis"):
        fit_evolution(path[0], path[1], -path[2])
    with pytest.raises(InvalidSettings, match="dimension"):
        fit_evolution(*path, dimension=5)
