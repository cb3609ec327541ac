"""The evolution law: fixed points, exact solution, objectivity, bounds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from granufab.errors import InvalidSettings
from granufab.states import (
    AccessibleDomain,
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    predict_evolution,
    proportional_gradient,
)

MINIMAL: dict[str, Any] = {"gain_rate": 25.0, "loss_rate": 40.0}
FORMS: dict[str, dict[str, Any]] = {
    "minimal": MINIMAL,
    "early": MINIMAL | {"early": 6.0, "early_strain": 0.01},
    "shedding": MINIMAL | {"shedding": 500.0, "shedding_ratio": 0.3},
    "memory": MINIMAL | {"shedding": 500.0, "shedding_ratio": 0.3, "memory": 0.6},
}
LIMITS = {2: (2.9, 3.8), 3: (4.0, 6.0)}


def law_of(form: str, dimension: int) -> EvolutionLaw:
    z_min, z_max = LIMITS[dimension]
    return EvolutionLaw(z_min=z_min, z_max=z_max, dimension=dimension, **FORMS[form])


def stage(gradient: Any, strain: float, count: int = 61) -> StrainStage:
    return StrainStage(gradient=gradient, times=np.linspace(0.0, strain, count))


def turn_2d(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("dimension", "b", "mode"),
    [(2, 0.0, {}), (3, 0.0, {"b": 0.0}), (3, 1.0, {"b": 1.0}), (3, 0.35, {"b": 0.35})],
    ids=["2D", "compression", "extension", "b=0.35"],
)
def test_fixed_points_are_the_critical_states(
    form: str, dimension: int, b: float, mode: dict[str, float]
) -> None:
    law = law_of(form, dimension)
    domain = AccessibleDomain(z_min=law.z_min, z_max=law.z_max, dimension=dimension, **mode)
    start = fabric_from_state(5.0, 0.1, direction=np.eye(dimension)[0])
    result = predict_evolution(
        law, start, [stage(proportional_gradient(dimension, b=b), 3.0)], tolerance=1e-10
    )
    last = result.isel(record=-1)
    assert float(last["z"]) == pytest.approx(domain.z_star, abs=1e-7)
    assert float(last["a"]) == pytest.approx(domain.a_star, abs=1e-7)
    if dimension == 3:
        assert float(last["b_g"]) == pytest.approx(b, abs=1e-7)


@pytest.mark.parametrize("dimension", [2, 3])
def test_reversal_leads_to_the_opposite_critical_state(dimension: int) -> None:
    law = law_of("memory", dimension)
    forward = proportional_gradient(dimension)
    start = fabric_from_state(LIMITS[dimension][1], direction=np.eye(dimension)[1])
    result = predict_evolution(law, start, [stage(forward, 1.0), stage(-forward, 3.0)])
    opposite = AccessibleDomain(
        z_min=law.z_min, z_max=law.z_max, dimension=dimension, mode="extension"
    )
    last = result.isel(record=-1)
    assert float(last["a_signed"]) == pytest.approx(-opposite.a_star, abs=1e-7)
    assert float(last["z"]) == pytest.approx(opposite.z_star, abs=1e-7)
    assert float(last["eps_q"]) == pytest.approx(-2.0)
    assert float(last["eps_q_total"]) == pytest.approx(4.0)


def test_minimal_form_is_exponential_on_each_axis() -> None:
    """dG_k = A_g|dε_k|(z_max/4 − G_k), dG_k = −A_l|dε_k|(G_k − z_min/4) [theory, section 6]."""
    law = law_of("minimal", 2)
    start = np.array([[0.8, 0.1], [0.1, 1.0]])
    result = predict_evolution(law, start, [stage(proportional_gradient(2), 0.1)])
    half = result["eps_q"].values / 2.0
    fabric = result["fabric"].values
    gaining = 3.8 / 4 + (1.0 - 3.8 / 4) * np.exp(-25.0 * half)
    losing = 2.9 / 4 + (0.8 - 2.9 / 4) * np.exp(-40.0 * half)
    assert np.allclose(fabric[:, 1, 1], gaining, rtol=0, atol=1e-14)
    assert np.allclose(fabric[:, 0, 0], losing, rtol=0, atol=1e-14)
    assert np.allclose(fabric[:, 0, 1], 0.1 * np.exp(-32.5 * half), rtol=0, atol=1e-14)


def test_the_integrator_agrees_with_the_exact_solution() -> None:
    law = law_of("minimal", 3)
    start = fabric_from_state(5.0, 0.4, direction=[1.0, 2.0, 0.5])
    gradient = proportional_gradient(3, b=0.2)
    exact = predict_evolution(law, start, [stage(gradient, 0.2)])
    solved = predict_evolution(law, start, [stage(lambda _: gradient, 0.2)])
    assert np.allclose(exact["fabric"], solved["fabric"], rtol=0, atol=1e-9)
    assert np.allclose(exact["eps_q"], solved["eps_q"], rtol=0, atol=1e-12)


def test_spin_alone_turns_the_tensor() -> None:
    spin = np.array([[0.0, -1.3], [1.3, 0.0]])
    start = fabric_from_state(3.4, 0.3)
    first = stage(proportional_gradient(2), 1e-9, 2)
    result = predict_evolution(law_of("memory", 2), start, [first, stage(spin, 0.7, 2)])
    turned = expm(0.7 * spin) @ start @ expm(0.7 * spin).T
    assert np.allclose(result["fabric"].values[-1], turned, rtol=0, atol=1e-7)


@pytest.mark.parametrize("form", FORMS)
def test_rotating_a_planar_history_rotates_the_result(form: str) -> None:
    law = law_of(form, 2)
    start = np.array([[0.9, 0.06], [0.06, 1.0]])
    history = [proportional_gradient(2), np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([-0.5, 0.5])]
    turn = turn_2d(0.77)
    straight, turned = (
        predict_evolution(law, q @ start @ q.T, [stage(q @ g @ q.T, 0.1, 21) for g in history])
        for q in (np.eye(2), turn)
    )
    expected = np.einsum("ik,rkl,jl->rij", turn, straight["fabric"].values, turn)
    assert np.allclose(turned["fabric"], expected, rtol=0, atol=1e-10)
    for name in ("z", "a", "a_signed", "eps_q", "eps_q_total"):
        assert np.allclose(straight[name], turned[name], rtol=0, atol=1e-10)


@pytest.mark.parametrize("form", FORMS)
def test_rotating_a_spatial_history_rotates_the_result(form: str) -> None:
    law = law_of(form, 3)
    start = fabric_from_state(5.2, 0.3, direction=[1.0, 1.0, 0.2])
    shear = np.zeros((3, 3))
    shear[0, 1] = 1.0
    history = [proportional_gradient(3), shear, proportional_gradient(3, b=0.7, axis=2)]
    turn = Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()
    straight, turned = (
        predict_evolution(law, q @ start @ q.T, [stage(q @ g @ q.T, 0.1, 11) for g in history])
        for q in (np.eye(3), turn)
    )
    expected = np.einsum("ik,rkl,jl->rij", turn, straight["fabric"].values, turn)
    assert np.allclose(turned["fabric"], expected, rtol=0, atol=1e-10)
    assert np.allclose(straight["a_signed"], turned["a_signed"], rtol=0, atol=1e-10)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("form", ["minimal", "early"])
def test_no_history_leaves_the_accessible_states(form: str, dimension: int) -> None:
    law = law_of(form, dimension)
    random = np.random.default_rng(5)
    start = fabric_from_state(LIMITS[dimension][0] + 0.3, direction=np.eye(dimension)[0])
    history = [stage(random.normal(size=(dimension, dimension)), 0.05, 6) for _ in range(25)]
    result = predict_evolution(law, start, history, tolerance=1e-9)
    principal = np.linalg.eigvalsh(result["fabric"].values) * 2 * dimension
    assert principal.min() >= law.z_min - 1e-7
    assert principal.max() <= law.z_max + 1e-7
    assert np.ptp(principal) > 0.3


def test_volume_change_and_speed_do_not_matter() -> None:
    law = law_of("memory", 2)
    start = fabric_from_state(3.9)
    gradient = proportional_gradient(2)
    once = predict_evolution(law, start, [stage(gradient, 0.2)])
    fast = [stage(7.0 * gradient + 2.0 * np.eye(2), 0.2 / 7.0)]
    again = predict_evolution(law, start, fast)
    assert np.allclose(once["fabric"], again["fabric"], rtol=0, atol=1e-9)
    assert np.allclose(once["eps_q"], again["eps_q"], rtol=0, atol=1e-12)


def test_only_a_dense_start_dips_and_only_with_shedding() -> None:
    """Minimal form: the dip is at most (z_max − z_0)/2, so nothing at z_0 > z_max."""
    dense = fabric_from_state(4.1)
    path = [stage(proportional_gradient(2), 0.5, 501)]
    equal = {"gain_rate": 35.0, "loss_rate": 35.0}
    limits = {"z_min": 2.9, "z_max": 3.8}
    plain = predict_evolution(EvolutionLaw(**limits, **equal), dense, path)
    better = EvolutionLaw(**limits, **equal, shedding=3e3, shedding_ratio=0.3, memory=0.8)
    peaked = predict_evolution(better, dense, path)
    critical = AccessibleDomain(**limits)
    assert plain["a"].values.max() <= critical.a_star + 1e-9
    assert peaked["a"].values.max() > critical.a_star + 0.03
    assert peaked["a"].values[-1] == pytest.approx(critical.a_star, abs=0.01)
    early = int(np.argmin(np.abs(peaked["eps_q"].values - 0.003)))
    assert plain["z"].values[early] > critical.z_star + 0.5
    assert peaked["z"].values[early] < critical.z_star + 0.15


def test_reversal_dips_where_loss_is_faster() -> None:
    gradient = proportional_gradient(2)
    for loss, dips in ((60.0, True), (25.0, False)):
        law = EvolutionLaw(z_min=2.9, z_max=3.8, gain_rate=25.0, loss_rate=loss)
        result = predict_evolution(
            law, fabric_from_state(3.35), [stage(gradient, 1.0), stage(-gradient, 1.0)]
        )
        after = result["z"].values[result["stage"].values == 1]
        assert bool(after.min() < 3.35 - 0.05) is dips


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"z_min": 5.0}, "z_min"),
        ({"gain_rate": 0.0}, "gain_rate"),
        ({"memory": -1.0}, "memory"),
        ({"early_strain": float("nan")}, "early_strain"),
        ({"dimension": 4}, "dimension"),
    ],
)
def test_bad_parameters_are_named(change: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {"z_min": 2.9, "z_max": 3.8, "gain_rate": 20.0, "loss_rate": 20.0}
    with pytest.raises(InvalidSettings, match=message):
        EvolutionLaw(**(good | change))


def test_bad_histories_are_refused() -> None:
    law = law_of("minimal", 2)
    start = fabric_from_state(3.4)
    good = stage(proportional_gradient(2), 0.1)
    for fabric, stages, message in (
        (np.eye(3), [good], "shape"),
        (np.array([[1.0, 0.2], [0.0, 1.0]]), [good], "symmetric"),
        (start, [], "at least one stage"),
        (start, [stage(proportional_gradient(3), 0.1)], "stage 0"),
        (start, [stage(np.eye(2), 0.1)], "no deviatoric"),
    ):
        with pytest.raises(InvalidSettings, match=message):
            predict_evolution(law, fabric, stages)
    with pytest.raises(InvalidSettings, match="increase"):
        StrainStage(gradient=np.eye(2), times=np.array([0.0, 0.2, 0.1]))
    with pytest.raises(InvalidSettings, match="a' is"):
        fabric_from_state(4.0, 2.5)
