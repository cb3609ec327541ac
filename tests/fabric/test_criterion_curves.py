"""Each point of a curve is the measure under its criterion; errors are the spread of states."""

import time
from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import jittered, square

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import criterion_curves, measure, neighbours_within
from granufab.history import Frame, Run, StepStatistics, series_dataset
from granufab.packing import Cell, Grains, Packing

UP = np.array([0.0, 1.0])


def forced(seed=1, count=400, dimension=2, reach=0.15):
    """A disordered stretched state whose pairs within ``reach`` bear forces of all sizes."""
    generator = np.random.default_rng(seed)
    matrix = np.diag([1.1, 0.95, 1.0][:dimension]) * round(count ** (1 / dimension))
    packing = jittered(generator, count, dimension, spread=0.3, matrix=matrix)
    contacts = neighbours_within(packing, reach)
    size = 10.0 ** generator.uniform(-9, 1, contacts.count)
    return replace(packing, contacts=replace(contacts, force=contacts.normal * size[:, None]))


def path_of(packings, strains, settings=None, stages=None):
    frames = [
        Frame(
            packing=packing,
            eps_q=strain,
            eps_q_total=strain,
            strain=np.zeros((2, 2)),
            stage=0 if stages is None else stages[k],
            stress=np.eye(2),
            inertial_number=1e-3,
            direction=UP,
            statistics=StepStatistics(),
        )
        for k, (packing, strain) in enumerate(zip(packings, strains, strict=True))
    ]
    return Run(series_source=series_dataset([], {}), frames=frames, settings=settings or {})


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("definition", ["z", "z_backbone", "z_mechanical"])
def test_each_point_is_the_measure_under_its_criterion(dimension, definition):
    packing = forced(dimension=dimension, count=400 if dimension == 2 else 343)
    axis = np.eye(dimension)[1]
    curves = criterion_curves(
        packing,
        force_thresholds=[1e-7, 1e-4, 1e-3],
        gap_thresholds=[0.01, 0.05, 0.2],
        z_definition=definition,
        direction=axis,
        bootstrap=0,
    )
    for kind in ("force", "gap"):
        for index, threshold in enumerate(curves[f"{kind}_threshold"].values):
            wanted = measure(
                packing,
                criterion=f"{kind}:{float(threshold)!r}",
                z_definition=definition,
                direction=axis,
            )
            at = {name: float(curves[f"{name}_{kind}"][index]) for name in ("z", "a", "az")}
            assert at["z"] == pytest.approx(wanted[definition], abs=1e-12)
            assert at["a"] == pytest.approx(wanted["a_signed"], abs=1e-12)
            assert at["az"] == pytest.approx(at["z"] * at["a"], abs=1e-12)
            assert float(curves[f"rattler_fraction_{kind}"][index]) == wanted["rattler_fraction"]
    assert curves.attrs["z_definition"] == definition


def test_the_curve_passes_the_default_criterion():
    packing = forced()
    curves = criterion_curves(packing, force_thresholds=[1e-6], direction=UP, bootstrap=0)
    assert float(curves.z_force[0]) == measure(packing)["z_backbone"]
    assert curves.attrs["default_force_threshold"] == 1e-6
    assert curves.z_force.attrs["units"] == "-"
    assert curves.gap_threshold.attrs["units"] == "mean diameter"


def test_a_square_lattice_gains_its_diagonals_at_their_gap():
    # Neighbours at distance 1, diagonals at √2: gap √2 − 1 = 0.4142 d.
    curves = criterion_curves(square(8), gap_thresholds=[1e-5, 0.41, 0.42], bootstrap=0)
    np.testing.assert_allclose(curves.z_gap, [4, 4, 8])
    np.testing.assert_allclose(curves.az_gap, 0, atol=1e-10)
    assert "z_force" not in curves
    assert curves.attrs["missing"].startswith("force: contacts are not in this data")
    assert curves.attrs["anisotropy"] == "unsigned"


def test_pairs_beyond_the_recorded_reach_come_from_geometry():
    packing = forced(reach=0.02)
    curves = criterion_curves(packing, gap_thresholds=[0.01, 0.3], z_definition="z", bootstrap=0)
    wide = 2 * neighbours_within(packing, 0.3).count / 400
    assert float(curves.z_gap[1]) == wide > 2 * packing.contacts.count / 400


def test_walls_hold_grains_at_every_gap():
    # A disk in the corner of a box, 0.03 from each wall, and nothing else near it.
    packing = Packing(
        grains=Grains(position=[[0.53, 0.53], [5.0, 5.0]], radius=[0.5, 0.5]),
        cell=Cell(matrix=10 * np.eye(2), periodic=(False, False)),
    )
    curves = criterion_curves(packing, gap_thresholds=[0.02, 0.04], bootstrap=0)
    assert curves.rattler_fraction_gap.values.tolist() == [1.0, 0.5]
    assert np.isnan(curves.a_gap).all()


def test_a_wider_criterion_counts_more_contacts():
    curves = criterion_curves(forced(), z_definition="z", bootstrap=0)
    assert (np.diff(curves.z_gap) >= 0).all()
    assert (np.diff(curves.z_force) <= 0).all()
    assert curves.sizes == {"force_threshold": 33, "gap_threshold": 33}


def test_the_error_of_one_state_is_the_spread_between_states():
    points = {"force_thresholds": [0.01], "gap_thresholds": [0.01], "direction": UP}
    states = [forced(seed, count=900) for seed in range(40)]
    curves = [criterion_curves(state, **points) for state in states]
    for name in ("a_gap", "a_force", "az_gap", "z_gap", "rattler_fraction_gap"):
        spread = np.std([float(c[name][0]) for c in curves], ddof=1)
        stated = np.mean([float(c[f"{name}_error"][0]) for c in curves])
        # 40 draws know their standard deviation to 11 %.
        assert 0.65 < stated / spread < 1.6, name
    together = criterion_curves(states, **points)
    alone = [float(c.a_gap[0]) for c in curves]
    assert float(together.a_gap[0]) == pytest.approx(np.mean(alone))
    error = np.std(alone, ddof=1) / np.sqrt(40)
    assert float(together.a_gap_error[0]) == pytest.approx(error)
    assert together.attrs["state_count"] == 40


def test_frames_that_repeat_each_other_are_not_taken_for_independent():
    states = [forced(seed, count=100) for seed in range(8)]
    points = {"force_thresholds": [0.01], "gap_thresholds": [0.01]}
    slow = [state for state in states for _ in range(5)]
    strains = np.arange(40) * 0.01
    curves = criterion_curves(path_of(slow, strains), window=1.0, **points)
    once = criterion_curves(states, direction=UP, **points)
    naive = criterion_curves(slow, direction=UP, **points)
    assert curves.attrs["anisotropy"] == "signed"
    assert float(curves.a_gap[0]) == pytest.approx(float(once.a_gap[0]))
    assert float(curves.a_gap_error[0]) > 1.6 * float(naive.a_gap_error[0])
    assert 0.6 < float(curves.a_gap_error[0]) / float(once.a_gap_error[0]) < 1.8


def test_the_window_stays_in_its_stage_and_before_its_frame():
    packings = [forced(seed, count=100) for seed in range(6)]
    run = path_of(packings, np.arange(6) * 0.01, stages=[0, 0, 0, 0, 1, 1])
    points = {"force_thresholds": [0.01], "gap_thresholds": [0.01], "bootstrap": 0}

    def z(**options):
        return float(criterion_curves(run, **points, **options).z_gap[0])

    def mean(chosen):
        return np.mean([measure(p, criterion="gap:0.01")["z_backbone"] for p in chosen])

    assert z() == pytest.approx(mean(packings[5:]))
    assert z(window=0.03) == pytest.approx(mean(packings[4:]))
    assert z(frame=3, window=0.02) == pytest.approx(mean(packings[1:4]))
    assert z(frame=1) == pytest.approx(mean(packings[1:2]))


def test_a_run_gives_its_own_definitions():
    settings = {"record": {"z_definition": "z"}, "material": {"friction": 0.0}}
    run = path_of([forced()], [0.0], settings)
    curves = criterion_curves(run, bootstrap=0)
    assert curves.attrs["z_definition"] == "z"
    assert curves.attrs["minimum_contacts"] == 3


def test_many_thresholds_of_a_large_state_take_no_time():
    packing = forced(count=5041)
    start = time.perf_counter()
    criterion_curves(packing, direction=UP, bootstrap=0)
    assert time.perf_counter() - start < 4.0


def test_bad_requests_are_refused_in_one_line():
    packing = forced(count=100)
    for wrong in ([-1.0], [], [np.nan], [11.0]):
        with pytest.raises(InvalidSettings, match="force_thresholds are"):
            criterion_curves(packing, force_thresholds=wrong)
    with pytest.raises(InvalidSettings, match=r"gap_thresholds are \[2.0\], must lie in 0..1"):
        criterion_curves(packing, gap_thresholds=[2.0])
    with pytest.raises(InvalidSettings, match=r"holds frames 0\.\.0"):
        criterion_curves(path_of([packing], [0.0]), frame=1)
    with pytest.raises(InvalidSettings, match="must be a strain >= 0"):
        criterion_curves(path_of([packing], [0.0]), window=-0.1)
    with pytest.raises(MissingData, match="at least one state"):
        criterion_curves([])
