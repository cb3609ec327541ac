"""Runs from outside: recorders, counted failures, interruption, sizes of grains."""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics_cases import grains

from granufab.errors import BrokenState, InvalidSettings, MissingData, NotConverged
from granufab.history import SERIES_UNITS
from granufab.packing import Cell, Grains, Packing
from granufab.simulate import (
    ConstantMean,
    Isotropic,
    Record,
    Simulation,
    Sizes,
    Solver,
    Step,
    draw_radii,
    random_sample,
    run,
    shear,
)

PATH = [Step(loading=ConstantMean(rate=1.2e-3), strain=0.01)]
OFTEN = Record(series_interval=1e-3, frame_interval=4e-3)


class Listener:
    """A user's own recorder; after ``patience`` rows it interrupts the run."""

    def __init__(self, patience: int = 10**9) -> None:
        self.frames, self.rows, self.patience = [], [], patience

    def frame(self, frame):
        self.frames.append(frame)

    def row(self, row):
        self.rows.append(row)
        if len(self.rows) == self.patience:
            raise KeyboardInterrupt


def test_a_recorder_receives_frames_and_rows(dense):
    listener = Listener()
    result = run(dense, PATH, record=listener, record_settings=OFTEN, name="mine")
    step = 0.01 / result.summary["steps"]
    for strain, interval in (
        (np.array([row["eps_q"] for row in listener.rows]), 1e-3),
        (np.array([frame.eps_q for frame in listener.frames]), 4e-3),
    ):
        assert strain[0] == 0.0
        assert strain[-1] == pytest.approx(0.01, rel=1e-9)
        assert len(strain) == round(0.01 / interval + 0.5) + 1
        assert np.diff(strain)[:-1] == pytest.approx(interval, abs=step)
    assert all(row["path"] == "mine" for row in listener.rows)
    assert len(result.frames) == len(listener.frames)
    assert result.series.sizes["record"] == len(listener.rows)
    first = listener.frames[0].packing
    assert np.array_equal(first.grains.position, dense.grains.position)
    assert listener.rows[0]["p"] == pytest.approx(1.0, abs=1e-3)


def test_series_columns_are_complete_and_true(dense):
    result = run(dense, PATH, record_settings=OFTEN)
    assert set(result.series) == set(SERIES_UNITS)
    for name in result.series:
        column = result.series[name]
        assert np.isfinite(column.values).all(), name
        assert column.attrs["units"] == SERIES_UNITS[name][0]
    series = result.series
    assert np.all(series["residual"][1:] <= 1e-4)
    assert np.all(series["sweeps"][1:] >= 1)
    assert np.all(series["overlap"] < 2e-3)
    assert np.all(series["z_backbone"] >= series["z"])
    assert np.all((series["phi"] > 0.78) & (series["phi"] < 0.87))
    assert series["inertial_number"][-1] == pytest.approx(result.summary["inertial_number_max"])
    last = result.frames[len(result.frames) - 1]
    low, high = np.linalg.eigvalsh(last.stress)
    assert float(series["q_over_p"][-1]) == pytest.approx((high - low) / (high + low), rel=1e-4)
    assert float(series["p"][-1]) == pytest.approx(np.trace(last.stress) / 2, rel=1e-12)


def test_steps_that_do_not_converge_are_counted_and_told(dense):
    hasty = Solver(max_sweeps=1, tolerance=1e-8)
    result = run(dense, PATH, solver=hasty, record_settings=OFTEN)
    summary = result.summary
    assert summary["nonconverged_steps"] == summary["steps"] > 50
    assert summary["residual_max"] > 1e-8
    assert summary["sweeps_mean"] >= 1
    assert any(f"{summary['steps']} of {summary['steps']} steps" in w for w in summary["warnings"])
    patient = run(dense, PATH, record_settings=OFTEN)
    assert patient.summary["nonconverged_steps"] == 0
    assert patient.summary["residual_max"] <= patient.summary["tolerance"]


def test_strict_makes_the_first_such_step_an_error(dense):
    with pytest.raises(NotConverged, match=r"after 1 sweeps, tolerance 1\.0e-08") as failed:
        run(dense, PATH, solver=Solver(max_sweeps=1, tolerance=1e-8, strict=True))
    assert "\n" not in str(failed.value)


def test_an_interrupted_run_returns_what_it_has(dense):
    listener = Listener(patience=6)
    result = run(dense, PATH, record=listener, record_settings=OFTEN)
    assert result.summary["interrupted"] is True
    assert result.series.sizes["record"] == 6
    assert len(result.frames) >= 2
    complete = run(dense, PATH, record_settings=OFTEN)
    assert complete.summary["interrupted"] is False
    assert result.summary["steps"] == pytest.approx(complete.summary["steps"] / 2, rel=0.1)
    kept = result.series["q_over_p"].values
    assert np.array_equal(kept, complete.series["q_over_p"].values[:6])


def test_a_quick_run_is_told_to_be_no_longer_quasi_static(dense):
    result = shear(dense, strain=0.002, inertial_number=1e-2)
    assert any("inertial number" in warning for warning in result.summary["warnings"])
    result = shear(dense, strain=0.002, inertial_number=1e-3)
    assert not any("inertial number" in warning for warning in result.summary["warnings"])


def test_a_relaxing_stage_ends_at_rest(dense):
    path = [*PATH, Step(loading=Isotropic(diagonals=True), strain=None)]
    result = run(dense, path, record_settings=OFTEN)
    last = result.frames[len(result.frames) - 1]
    assert last.stage == 1
    assert last.statistics.kinetic_ratio < 1e-8
    assert np.diag(last.stress) == pytest.approx([1.0, 1.0], abs=1e-2)


def test_an_empty_path_is_refused(dense):
    with pytest.raises(InvalidSettings, match="no stages"):
        run(dense, [])


def test_grains_without_masses_or_cell_are_refused(dense):
    bare = Packing(
        grains=Grains(position=dense.grains.position, radius=dense.grains.radius), cell=dense.cell
    )
    with pytest.raises(MissingData, match="mass"):
        Simulation(bare, Isotropic())
    with pytest.raises(MissingData, match="cell"):
        Simulation(Packing(grains=dense.grains), Isotropic())


def test_grains_that_cross_are_an_error():
    """A step that carries a grain into its neighbour stops the run with a remedy."""
    crossing = Packing(
        grains=grains([[5.0, 5.0], [6.05, 5.0]], velocity=[[1.0, 0.0], [-1.0, 0.0]]),
        cell=Cell(matrix=np.eye(2) * 20),
    )
    still = Isotropic()
    simulation = Simulation(crossing, still, step=0.7, solver=Solver(stiffness=math.inf))
    with pytest.raises(BrokenState, match="grains 0 and 1 overlap") as failed:
        simulation.step()
    assert "time_step" in str(failed.value)


# --- sizes ------------------------------------------------------------------------------------

COUNT = 20_000


def _diameters(sizes: Sizes, dimension: int = 2, diameter: float = 2.5) -> np.ndarray:
    generator = np.random.default_rng(3)
    return 2 * draw_radii(COUNT, sizes, diameter=diameter, dimension=dimension, generator=generator)


@pytest.mark.parametrize("kind", ["uniform", "uniform-by-volume", "bidisperse", "log-normal"])
def test_the_mean_diameter_is_the_wanted_one(kind):
    assert _diameters(Sizes(kind=kind)).mean() == pytest.approx(2.5, rel=1e-12)


def test_uniform_sizes():
    d = _diameters(Sizes(kind="uniform", spread=0.3)) / 2.5
    assert 0.69 < d.min() < 0.71
    assert 1.29 < d.max() < 1.31
    assert d.std() == pytest.approx(0.3 / math.sqrt(3), rel=0.02)
    share = np.histogram(d, bins=6, range=(0.7, 1.3))[0] / COUNT
    assert share == pytest.approx(1 / 6, rel=0.06)


@pytest.mark.parametrize("dimension", [2, 3])
def test_uniform_by_volume_gives_every_class_the_same_solid_volume(dimension):
    d = _diameters(Sizes(kind="uniform-by-volume", spread=0.4), dimension)
    assert d.max() / d.min() == pytest.approx(1.4 / 0.6, rel=1e-2)
    edges = np.linspace(d.min(), d.max() * (1 + 1e-12), 7)
    volume = np.histogram(d, bins=edges, weights=d**dimension)[0]
    assert volume / volume.sum() == pytest.approx(1 / 6, rel=0.06)


def test_log_normal_sizes():
    logarithm = np.log(_diameters(Sizes(kind="log-normal", spread=0.25)))
    assert logarithm.std() == pytest.approx(0.25, rel=0.03)
    skewness = ((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3
    assert skewness == pytest.approx(0.0, abs=0.06)


def test_bidisperse_sizes():
    d = _diameters(Sizes(kind="bidisperse", ratio=1.5, large_fraction=0.3))
    small, large = np.unique(d)
    assert large / small == pytest.approx(1.5, rel=1e-12)
    assert (d == large).mean() == pytest.approx(0.3, abs=1e-12)


def test_monodisperse_sizes():
    assert np.unique(_diameters(Sizes(kind="monodisperse"))) == pytest.approx([2.5])


def test_radii_from_a_file_are_used_as_they_are(tmp_path):
    path = tmp_path / "radii.txt"
    path.write_text("0.4\n0.5 0.7\n0.6\n", encoding="utf-8")
    packing = random_sample(3, sizes=Sizes(kind="file", file=str(path)), solid_fraction=0.2)
    assert sorted(packing.grains.radius) == [0.4, 0.5, 0.7]
    with pytest.raises(InvalidSettings, match="holds 4 radii, grain_count is 5"):
        random_sample(5, sizes=Sizes(kind="file", file=str(path)))


@pytest.mark.parametrize(
    ("text", "message"),
    [("0.5 banana", "banana"), ("0.5 -0.1", "finite and > 0"), ("0.5 nan", "finite and > 0")],
)
def test_a_bad_file_of_radii_is_refused(tmp_path, text, message):
    path = tmp_path / "radii.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InvalidSettings, match=message):
        random_sample(2, sizes=Sizes(kind="file", file=str(path)))
    with pytest.raises(InvalidSettings, match="cannot be read"):
        random_sample(2, sizes=Sizes(kind="file", file=str(tmp_path / "absent.txt")))


@pytest.mark.parametrize(("dimension", "fraction"), [(2, 0.45), (3, 0.3)])
@pytest.mark.parametrize("boundary", ["periodic", "walls"])
def test_a_random_sample_is_dilute_and_free_of_overlap(dimension, fraction, boundary):
    packing = random_sample(
        150, dimension=dimension, solid_fraction=fraction, boundary=boundary, density=2.0, seed=7
    )
    made = packing.grains
    solid = made.mass.sum() / 2.0
    assert solid / packing.cell.volume == pytest.approx(fraction, rel=1e-9)
    edge = packing.cell.matrix[0, 0]
    apart = made.position[:, None] - made.position[None]
    if boundary == "periodic":
        apart -= edge * np.round(apart / edge)
    else:
        assert (made.position - made.radius[:, None]).min() >= 0
        assert (made.position + made.radius[:, None]).max() <= edge
    distance = np.linalg.norm(apart, axis=2)
    reach = made.radius[:, None] + made.radius[None]
    np.fill_diagonal(distance, np.inf)
    assert (distance >= reach).all()
