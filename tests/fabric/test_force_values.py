"""Forces as flat values: what went into made-up contacts comes out, along a run too."""

import numpy as np
import pytest
from synthetic_forces import stressed

from granufab.fabric import force_statistics, force_values, measure_run, stress_force_fabric
from granufab.history import Frame, Run, series_dataset
from granufab.packing import Packing

AXIS = np.array([0.0, 1.0])


def frame(packing: Packing, strain: float) -> Frame:
    return Frame(
        packing=packing,
        eps_q=strain,
        eps_q_total=strain,
        strain=np.zeros((2, 2)),
        stage=0,
        stress=np.eye(2),
        inertial_number=1e-3,
        direction=AXIS,
    )


def test_known_anisotropies_come_back_for_every_frame():
    known = [(0.2, 0.01, 0.3, 0.05), (-0.25, 0.02, -0.2, -0.04)]
    generator = np.random.default_rng(4)
    frames = [
        frame(stressed(generator, 30_000, *four, AXIS, noise=False), 0.1 * k)
        for k, four in enumerate(known)
    ]
    run = Run(
        series_source=series_dataset([], {}), frames=frames, summary={}, name="made-up",
        settings={"material": {"friction": 0.5}},
    )  # fmt: skip
    table = measure_run(run, forces=True)
    for name, column in zip(("a_l", "a_n", "a_t"), np.array(known).T[1:], strict=True):
        np.testing.assert_allclose(table[name], column, atol=1e-9)
    # |f_t|/f_n = |a_t sin 2ψ|/(1 + a_n cos 2ψ), at most 0.053: far from µ = 0.5.
    np.testing.assert_array_equal(table["sliding_fraction"], 0.0)
    assert table["a_n"].attrs["units"] == "-"
    for k, values in enumerate(force_values(item, friction=0.5) for item in frames):
        sff = stress_force_fabric(frames[k], replicas=0)
        assert values["q_over_p_full"] == float(sff["q_over_p_full"]) == table["q_over_p_full"][k]
        forces = force_statistics(frames[k], friction=0.5, replicas=0)
        assert values["strong_q_share"] == float(forces["q_share"].sel(part="strong"))
        assert values["mean_mobilisation"] == pytest.approx(float(forces["mean_mobilisation"]))


@pytest.mark.parametrize("friction", [None, 0.0])
def test_without_friction_nothing_slides_or_holds(friction):
    packing = stressed(np.random.default_rng(1), 500, 0.1, 0.0, 0.1, 0.0, AXIS)
    values = force_values(packing, friction=friction)
    assert values["sliding_fraction"] is None and values["mean_mobilisation"] is None
    assert values["a_n"] is not None
