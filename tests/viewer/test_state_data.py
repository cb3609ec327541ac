"""The numbers of the viewer are those of the verbs: measure, balance, criterion, fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sheared_run import sheared_frames

import granufab
from granufab.errors import InvalidSettings
from granufab.fabric import criterion_curves, orientation, select_network
from granufab.fabric.harmonics import sphere_density, sphere_orientation
from granufab.states import AccessibleDomain
from granufab.viewer import (
    ViewedRun,
    criterion_data,
    fit_data,
    interval_data,
    overview,
    series_data,
    state_data,
)
from granufab.viewer.run_data import domain_data

Look = Callable[[Path], ViewedRun]


@pytest.mark.parametrize("criterion", [None, "gap:0.02", "listed", "force:0.5"])
@pytest.mark.parametrize("definition", ["z", "z_backbone", "z_mechanical"])
def test_values_are_those_of_measure(
    view_of: Look,
    output_of: Callable[..., Any],
    run_file: Path,
    criterion: str | None,
    definition: str,
) -> None:
    viewed = view_of(run_file)
    options = [] if criterion is None else ["--criterion", criterion]
    (wanted,) = output_of(
        "measure", run_file, "--frame", 7, "--z-definition", definition, "--json", *options
    )
    found = state_data(viewed.run, viewed.frame(7), viewed.choice(criterion, definition))
    for name in ("source", "frame", "criterion", "z_definition"):
        wanted.pop(name)
    assert found["values"] == wanted
    assert set(found["units"]) == set(wanted)
    assert found["point"]["z"] == wanted[definition]
    assert found["point"]["a"] == wanted["a_signed"]
    assert found["mohr"]["z"] == pytest.approx(wanted[definition])
    assert found["mohr"]["principal"] == pytest.approx([wanted["g_1"], wanted["g_2"]])
    assert found["missing"] is None


def test_spheres_too(view_of: Look, output_of: Callable[..., Any], sphere_file: Path) -> None:
    viewed = view_of(sphere_file)
    (wanted,) = output_of("measure", sphere_file, "--frame", 2, "--json")
    found = state_data(viewed.run, viewed.frame(2), viewed.choice(None, None))
    assert {name: wanted[name] for name in found["values"]} == found["values"]
    network = select_network(viewed.frame(2).packing)
    surface = found["rose"]["surface"]
    theta, around = np.array(surface["theta"]), np.array(surface["azimuth"])
    place = 7, 11
    direction = np.array(
        [
            np.sin(theta[place[0]]) * np.cos(around[place[1]]),
            np.sin(theta[place[0]]) * np.sin(around[place[1]]),
            np.cos(theta[place[0]]),
        ]
    )
    sphere = sphere_orientation(network.contacts, z=network.z)
    assert surface["E"][7][11] == pytest.approx(float(sphere_density(sphere, direction)))
    assert len(found["mohr"]["circles"]) == 3


def test_the_rose_is_orientation_with_a_band_as_wide_as_resampled_fits(
    view_of: Look, run_file: Path
) -> None:
    viewed = view_of(run_file)
    frame = viewed.frame(3)
    rose = state_data(viewed.run, frame, viewed.choice(None, None), bins=24)["rose"]
    network = select_network(frame.packing)
    direct = orientation(network.contacts, z=network.z, bins=24)
    for name in ("theta", "count", "E", "E_error"):
        assert rose[name] == direct[name].to_numpy().tolist()
    assert (rose["a"], rose["a_error"]) == (float(direct["a"]), float(direct["a_error"]))
    curve = {name: np.array(values) for name, values in rose["curve"].items()}
    phase = np.radians(rose["phase"])
    assert curve["E"] == pytest.approx(
        network.z / (2 * np.pi) * (1 + rose["a"] * np.cos(2 * (curve["theta"] - phase)))
    )
    random = np.random.default_rng(4)
    fits = []
    for _ in range(300):
        drawn = random.integers(0, network.contacts.count, network.contacts.count)
        angle = np.arctan2(*network.contacts.normal[drawn].T[::-1])
        moment = np.exp(2j * angle).mean()
        turn = np.exp(-2j * curve["theta"])
        fits.append(network.z / (2 * np.pi) * (1 + 2 * (moment * turn).real))
    spread = np.std(fits, axis=0)
    assert 0.5 * (curve["high"] - curve["low"]) == pytest.approx(spread, rel=0.15)


def test_unknown_values_are_null_and_explained(view_of: Look, run_file: Path) -> None:
    viewed = view_of(run_file)
    frame = viewed.frame(0)
    packing = replace(frame.packing, contacts=replace(frame.packing.contacts, force=None))
    found = state_data(viewed.run, replace(frame, packing=packing), viewed.choice(None, None))
    assert found["values"]["z"] is None
    assert found["values"]["phi"] is not None
    assert found["rose"] is found["mohr"] is found["point"]["az"] is None
    assert "contact forces" in found["missing"]


def test_the_interval_is_that_of_balance(view_of: Look, run_file: Path) -> None:
    viewed = view_of(run_file)
    found = interval_data(viewed.frame(5), viewed.frame(6), viewed.choice("gap:0.02", None))
    whole = granufab.fabric.balance_run(viewed.run, criterion="gap:0.02").isel(interval=5)
    for name in ("gain", "loss", "current", "before"):
        assert found[name] == whole[name].to_numpy().tolist()
    assert sum(found["gain"]) == found["gained"] > 0
    assert found["since_eps_q"] == float(whole["eps_q_before"])


def test_the_slider_is_criterion_curves(view_of: Look, run_file: Path) -> None:
    viewed = view_of(run_file)
    choice = viewed.choice(None, None)
    found = criterion_data(viewed.run, 4, choice)
    curves = criterion_curves(viewed.run, frame=4, z_definition="z_backbone", bootstrap=0)
    for kind in ("force", "gap"):
        for name in ("z", "a", "az", "rattler_fraction"):
            values = np.array(found[kind][name], dtype=float)  # null becomes NaN
            assert np.array_equal(values, curves[f"{name}_{kind}"], equal_nan=True)
    # A point of the curve is what the state gives under that criterion.
    gap = found["gap"]["threshold"][-3]
    state = state_data(viewed.run, viewed.frame(4), viewed.choice(f"gap:{gap!r}", None))
    assert state["point"]["z"] == pytest.approx(found["gap"]["z"][-3])
    assert state["point"]["a"] == pytest.approx(found["gap"]["a"][-3])


def test_fit_is_that_of_the_verb(
    view_of: Look, output_of: Callable[..., Any], run_file: Path
) -> None:
    wanted = output_of("fit", run_file, run_file, "--json")
    found = fit_data([view_of(run_file), view_of(run_file)])
    assert found["missing"] is None
    for name in ("z_min", "z_max", "z_star", "a_star", "z_definition", "outside_significant"):
        assert found["fit"][name] == wanted[name]
    domain = found["domain"]
    assert domain["z_min"] == wanted["z_min"]["value"]
    assert domain["intervals"]["z_max"] == [wanted["z_max"]["low"], wanted["z_max"]["high"]]
    # The critical circle spans the two limit states.
    centre, radius = domain["mohr"]["critical"]
    assert [centre - radius, centre + radius] == pytest.approx(domain["mohr"]["limits"])


def test_the_lines_meet_at_the_critical_state() -> None:
    for domain in (
        AccessibleDomain(z_min=3.0, z_max=3.8),
        AccessibleDomain(z_min=4.0, z_max=5.0, dimension=3),
        AccessibleDomain(z_min=4.0, z_max=5.0, dimension=3, b=0.5),
    ):
        for side in domain_data(domain)["sides"]:
            size = np.abs(side["a_max"])
            assert size.max() == pytest.approx(abs(side["a_star"]), rel=0.02)
            assert side["z"][size.argmax()] == pytest.approx(side["z_star"], abs=0.01)
            assert np.sign(side["a_star"]) == side["sign"]
            inside = 0.999 * side["a_max"]
            assert domain.contains(side["z"], inside).all()
            assert not domain.contains(side["z"][1:-1], 1.001 * side["a_max"][1:-1]).any()


def test_no_domain_is_explained(view_of: Look, run_file: Path, sphere_file: Path) -> None:
    found = fit_data([view_of(run_file), view_of(sphere_file)])
    assert found["fit"] is None
    assert "dimension" in found["missing"]
    with pytest.raises(InvalidSettings, match="method"):
        fit_data([view_of(run_file)], "guess")


def test_overview_and_series(view_of: Look, run_file: Path) -> None:
    viewed = view_of(run_file)
    found = overview(viewed)
    frames = list(sheared_frames(2))
    assert found["frames"]["eps_q"] == [frame.eps_q for frame in frames]
    assert found["frames"]["number"] == list(range(12))
    assert (found["dimension"], found["frame_count"], found["finished"]) == (2, 12, False)
    assert found["criterion"] == "force"
    series = series_data(viewed)
    run = granufab.read(run_file)
    assert set(series["columns"]) == set(map(str, run.series.data_vars))
    for name in ("z_backbone", "a_signed", "eps_q"):
        assert series["columns"][name] == run.series[name].to_numpy().tolist()
    assert series["units"]["p"][0] == "stress"


def test_foreign_data_have_their_measured_series(tmp_path: Path) -> None:
    from granufab.io import write

    path = tmp_path / "states.extxyz"
    states = granufab.read(write_three(tmp_path))
    write(states, path)
    viewed = ViewedRun("states", [path], lambda: granufab.read(path))
    series = series_data(viewed)
    table = granufab.fabric.measure_run(granufab.read(path))
    assert series["columns"]["phi"] == table["phi"].to_numpy().tolist()
    assert series["columns"]["z"] == table["z"].to_numpy().tolist()
    assert overview(viewed)["source"]


def write_three(folder: Path) -> Path:
    from sheared_run import write_run

    return write_run(folder / "three.h5", sheared_frames(2, 3), rows=0)
