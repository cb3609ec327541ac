import time
from dataclasses import replace

import numpy as np
import pytest
from fabric_cases import draw_plane, face_centred, hexagonal, jittered

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import (
    anisotropy,
    criterion_sweep,
    fabric_tensor,
    measure,
    measure_run,
    neighbours_within,
    quick_measure,
    signed_anisotropy,
)
from granufab.history import Frame, Run, StepStatistics, series_dataset
from granufab.packing import Cell, Contacts, Grains, Packing


def forced(seed=1, count=400, dimension=2, bearing=0.8):
    """A disordered state whose near pairs bear random forces, some none."""
    generator = np.random.default_rng(seed)
    packing = jittered(generator, count, dimension, spread=0.3)
    contacts = neighbours_within(packing, 0.15)
    size = generator.exponential(size=contacts.count)
    size *= generator.uniform(size=contacts.count) < bearing
    return replace(packing, contacts=replace(contacts, force=contacts.normal * size[:, None]))


def test_measured_values_agree_with_each_other():
    packing = forced()
    axis = np.array([0.3, 1.0])
    for definition in ("z", "z_backbone", "z_mechanical"):
        values = measure(packing, direction=axis, z_definition=definition)
        z = values[definition]
        assert values["p_g"] == pytest.approx(z / 4)
        assert values["q_g"] == pytest.approx(z * values["a"] / 8)
        assert values["g_1"] + values["g_2"] == pytest.approx(z / 2)
        assert values["f_xx"] + values["f_yy"] == pytest.approx(1.0)
        theta = np.radians(values["theta_c"] - np.degrees(np.arctan2(*axis[::-1])))
        assert values["a_signed"] == pytest.approx(values["a"] * np.cos(2 * theta), abs=1e-12)
        assert values["z_definition"] == definition
        assert values["criterion"] == "force"
        assert values["missing"] is None


def test_fabric_uses_the_contacts_of_the_z_in_use():
    # A triangle of touching disks, and a floater that touches one of them along x.
    position = np.array([[0.0, 0], [1.0, 0], [0.5, np.sqrt(0.75)], [2.0, 0]])
    packing = Packing(
        grains=Grains(position=position, radius=np.full(4, 0.5)), cell=Cell(matrix=10 * np.eye(2))
    )
    core = measure(packing, criterion="gap:0.01", direction=np.array([1.0, 0]))
    everything = measure(
        packing, criterion="gap:0.01", direction=np.array([1.0, 0]), z_definition="z"
    )
    assert core["a"] == pytest.approx(0, abs=1e-9)
    assert core["z_backbone"] == 2
    # Two contacts along x and two at ±60°: <cos 2θ> = (2 − 1)/4.
    assert everything["a_signed"] == pytest.approx(0.5)
    # z_mechanical counts the floater's contact for the grain that it touches: (8 − 1)/(4 − 1).
    touched = measure(
        packing, criterion="gap:0.01", direction=np.array([1.0, 0]), z_definition="z_mechanical"
    )
    assert touched["a_signed"] == pytest.approx(0.5)
    assert touched["z_mechanical"] == pytest.approx(7 / 3)
    # Errors of independent contacts: three of them in the core, four in all.
    assert core["a_noise"] == pytest.approx(np.sqrt(2 / 3))
    assert everything["a_noise"] == pytest.approx(np.sqrt((2 - 0.5**2) / 4))
    assert everything["z"] == 2.0
    assert everything["rattler_fraction"] == 0.25


def test_mirror_and_rotation_of_a_whole_state():
    packing = forced()
    base = measure(packing, direction=np.array([0, 1.0]))
    flip, quarter = np.diag([-1.0, 1.0]), np.array([[0.0, -1.0], [1.0, 0.0]])
    for turn, angle in ((flip, 180 - base["theta_c"]), (quarter, base["theta_c"] + 90)):
        contacts = packing.contacts
        # A mirrored cell matrix would have a negative determinant; the cell is square.
        turned = Packing(
            grains=Grains(position=packing.grains.position @ turn.T, radius=packing.grains.radius),
            cell=packing.cell,
            contacts=Contacts(
                pair=contacts.pair,
                normal=contacts.normal @ turn.T,
                branch=contacts.branch @ turn.T,
                gap=contacts.gap,
                force=contacts.force @ turn.T,
            ),
        )
        values = measure(turned, direction=turn @ np.array([0, 1.0]))
        for name in ("z", "z_backbone", "z_mechanical", "a", "a_signed", "g_1", "g_2", "p"):
            assert values[name] == pytest.approx(base[name], abs=1e-12)
        assert values["theta_c"] == pytest.approx(angle % 180, abs=1e-9)


def test_units_do_not_matter_but_to_the_stress():
    packing, scale, newton = forced(), 1e-3, 50.0
    contacts = packing.contacts
    scaled = Packing(
        grains=Grains(
            position=packing.grains.position * scale, radius=packing.grains.radius * scale
        ),
        cell=Cell(matrix=packing.cell.matrix * scale),
        contacts=replace(
            contacts,
            branch=contacts.branch * scale,
            gap=contacts.gap * scale,
            force=contacts.force * newton,
        ),
    )
    base, values = measure(packing), measure(scaled)
    for name in ("z", "z_backbone", "a", "phi", "q_over_p", "overlap"):
        assert values[name] == pytest.approx(base[name], rel=1e-12)
    assert values["p"] == pytest.approx(base["p"] * newton / scale)


def test_space_states_have_three_principal_values():
    values = measure(forced(count=343, dimension=3), direction=np.array([0, 0, 1.0]))
    assert values["g_1"] + values["g_2"] + values["g_3"] == pytest.approx(values["z_backbone"] / 2)
    # q_G = (G_1 − G_3)/3 = (z/2)(F_1 − F_3)/3 and a = (5/2)(F_1 − F_3).
    assert values["q_g"] == pytest.approx(values["z_backbone"] * values["a"] / 15)
    assert 0 <= values["b_g"] <= 1
    assert 0 <= values["theta_c"] <= 90
    lattice = measure(face_centred(), criterion="gap:0.01")
    assert lattice["phi"] == pytest.approx(np.pi / np.sqrt(18))


def test_the_worst_overlap_is_in_mean_diameters():
    grains = Grains(position=[[0.0, 0], [1.9, 0], [3.95, 0]], radius=[1.0, 1.0, 1.0])
    assert measure(Packing(grains=grains, cell=Cell(matrix=9 * np.eye(2))), criterion="gap:0.1")[
        "overlap"
    ] == pytest.approx(0.05)
    assert measure(hexagonal(), criterion="gap:0.1")["overlap"] == pytest.approx(0, abs=1e-12)


def test_unknown_values_are_none_and_say_why():
    packing = forced()
    scanned = replace(packing, contacts=replace(packing.contacts, force=None))
    values = measure(scanned)
    assert values["z"] is None
    assert values["a"] is None
    assert values["p"] is None
    assert values["phi"] == pytest.approx(np.pi / 4)
    assert "contact forces are not in this data" in values["missing"]
    listed = measure(scanned, criterion="listed")
    assert listed["z"] == pytest.approx(2 * packing.contacts.count / 400)
    assert listed["a_signed"] is None
    assert measure(Packing(grains=packing.grains), criterion="gap:0.05")["phi"] is None
    with pytest.raises(MissingData, match=r"^contacts are not in this data"):
        measure(Packing(grains=packing.grains))


def test_an_empty_network_has_no_anisotropy():
    packing = forced(bearing=0.0)
    values = measure(packing)
    assert values["z"] == values["z_backbone"] == values["z_mechanical"] == 0
    assert values["rattler_fraction"] == 1
    assert values["a"] is None
    assert values["q_over_p"] is None


def test_bad_settings_are_refused():
    with pytest.raises(InvalidSettings, match="z_definition 'zb' is unknown; allowed: z, z_back"):
        measure(forced(), z_definition="zb")
    with pytest.raises(InvalidSettings, match="non-zero vector of 2 numbers"):
        measure(forced(), direction=np.array([0, 0, 1.0]))


def test_quick_values_are_the_full_ones():
    for dimension, count in ((2, 400), (3, 343)):
        packing = forced(count=count, dimension=dimension)
        contacts = packing.contacts
        axis = np.eye(dimension)[1]
        force = np.einsum("ci,ci->c", contacts.force, contacts.normal)
        for definition in ("z", "z_backbone", "z_mechanical"):
            full = measure(packing, direction=axis, z_definition=definition)
            quick = quick_measure(
                contacts.pair,
                contacts.normal,
                force,
                packing.grains.count,
                direction=axis,
                z_definition=definition,
            )
            for name, value in quick.items():
                assert value == pytest.approx(full[name], abs=1e-12), name


def test_quick_values_of_ten_thousand_contacts_take_milliseconds():
    packing = forced(count=5041, bearing=0.8)
    contacts = packing.contacts
    force = np.einsum("ci,ci->c", contacts.force, contacts.normal)
    axis = np.array([0, 1.0])
    times = []
    for _ in range(5):
        start = time.perf_counter()
        quick_measure(contacts.pair, contacts.normal, force, 5041, direction=axis)
        times.append(time.perf_counter() - start)
    # 3 ms are wanted; a shared machine may be slower.
    assert min(times) < 0.015


def test_no_forces_give_no_anisotropy_quickly():
    values = quick_measure(np.zeros((0, 2), dtype=int), np.zeros((0, 2)), np.zeros(0), 5)
    assert values["z"] == 0
    assert np.isnan(values["a"])


def path_of(packings):
    frames = [
        Frame(
            packing=packing,
            eps_q=0.1 * k,
            eps_q_total=0.1 * k,
            strain=np.zeros((2, 2)),
            stage=0,
            stress=np.eye(2),
            inertial_number=1e-3,
            direction=np.array([0.0, 1.0]),
            statistics=StepStatistics(residual=1e-4, sweeps=12.0),
        )
        for k, packing in enumerate(packings)
    ]
    settings = {"record": {"criterion": "gap:0.05", "reach": 0.05, "z_definition": "z"}}
    return Run(series_source=series_dataset([], {}), frames=frames, name="dense", settings=settings)


def test_a_run_is_measured_frame_by_frame():
    packings = [forced(seed) for seed in range(3)]
    data = measure_run(path_of(packings), criterion="force", z_definition="z_backbone")
    assert dict(data.sizes) == {"frame": 3}
    for k, packing in enumerate(packings):
        values = measure(packing, direction=np.array([0, 1.0]))
        for name in ("z", "z_backbone", "a", "a_signed", "theta_c", "p", "phi"):
            assert float(data[name][k]) == values[name]
    np.testing.assert_allclose(data.eps_q, [0, 0.1, 0.2])
    assert data.sweeps.values.tolist() == [12.0] * 3
    assert data.attrs["criterion"] == "force"
    assert data.theta_c.attrs["units"] == "degree"


def test_a_run_brings_its_own_criterion():
    data = measure_run(path_of([forced()]))
    assert data.attrs["criterion"] == "gap:0.05"
    assert data.attrs["z_definition"] == "z"
    assert float(data.z[0]) == measure(forced(), criterion="gap:0.05")["z"]
    assert np.isfinite(data.q_over_p).all()
    with pytest.raises(MissingData, match="no recorded frames"):
        measure_run(path_of([]))


def test_a_gap_beyond_what_the_run_recorded_finds_its_own_pairs():
    short = forced()
    assert short.contacts is not None and short.contacts.gap is not None
    listed = short.contacts.select(short.contacts.gap < 0.02)
    run = path_of([replace(short, contacts=listed)])
    settings = {"record": {"reach": 0.3}, "solver": {"skin": 0.02}}
    data = measure_run(replace(run, settings=settings), criterion="gap:0.25", z_definition="z")
    assert float(data.z[0]) == measure(short, criterion="gap:0.25", z_definition="z")["z"]


@pytest.mark.parametrize(("friction", "fewest"), [(0.0, 3), (0.4, 2)])
def test_a_run_without_friction_keeps_the_rattler_rule_of_its_series(friction, fewest):
    packing = forced(bearing=0.5)
    run = replace(path_of([packing]), settings={"material": {"friction": friction}})
    found = measure_run(run, criterion="force")
    wanted = measure(packing, criterion="force", minimum=fewest)
    assert wanted["z_backbone"] != measure(packing, minimum=5 - fewest)["z_backbone"]
    assert float(found.z_backbone[0]) == wanted["z_backbone"]
    assert found.attrs["minimum_contacts"] == fewest


def test_a_wider_criterion_counts_more():
    data = criterion_sweep(forced(), ("gap:0.0", "gap:0.05", "gap:0.1"), z_definition="z")
    assert (np.diff(data.z) > 0).all()
    np.testing.assert_allclose(data["az"], data.a * data.z)
    assert data.criterion.values.tolist() == ["gap:0.0", "gap:0.05", "gap:0.1"]


def test_independent_isotropic_contacts_stay_near_the_noise_floor():
    generator = np.random.default_rng(7)
    within = 0
    for _ in range(60):
        fabric = fabric_tensor(draw_plane(400, 0.0, 0.0, generator))
        assert anisotropy(fabric) < 5 * np.sqrt(2 / 400)
        within += abs(signed_anisotropy(fabric, np.array([0, 1.0]))) < np.sqrt(2 / 400)
    # One standard error holds 68 % of the draws: 41 ± 4 of 60.
    assert 30 <= within <= 52
