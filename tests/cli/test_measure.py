"""``measure`` on a run file of known states: a square lattice has z = 4 and no anisotropy."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from moving_run import moving_run


def test_json_holds_one_object_per_state(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file, "--json")
    assert done.code == 0
    assert done.err == ""
    states = json.loads(done.out)
    assert [state["frame"] for state in states] == [0, 1, 2]
    for state in states:
        assert state["source"] == str(run_file)
        assert state["z"] == state["z_backbone"] == state["z_mechanical"] == 4.0
        assert state["a"] == pytest.approx(0.0, abs=1e-12)
        assert state["rattler_fraction"] == 0.0
        assert state["grain_count"] == 16
        assert state["contact_count"] == 32
        assert state["phi"] == pytest.approx(np.pi / 4)
        assert state["p"] == pytest.approx(1.0)  # force 1 per unit length on both axes
        assert state["criterion"] == "force"
        assert state["z_definition"] == "z_backbone"


def test_several_files_follow_one_another(granufab, run_file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.h5"
    other.write_bytes(run_file.read_bytes())
    states = json.loads(granufab("measure", run_file, other, "--json").out)
    assert [(s["source"], s["frame"]) for s in states] == [
        (str(path), frame) for path in (run_file, other) for frame in range(3)
    ]


def test_the_criterion_decides(granufab, run_file: Path) -> None:
    states = json.loads(granufab("measure", run_file, "--json", "--criterion", "gap:0.5").out)
    assert states[0]["z"] == 8.0  # the diagonal neighbours are at a gap of 0.41 diameters
    assert states[0]["criterion"] == "gap:0.5"


def test_unknown_values_are_null(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file, "--json", "--criterion", "gap:0.5")
    assert all(value == value for value in json.loads(done.out)[0].values())
    assert "NaN" not in done.out


def test_spheres_have_b_and_forces_where_wanted(granufab, tmp_path: Path) -> None:
    """Made-up spheres: exponential normal forces, none across, µ as in the case."""
    run = moving_run(tmp_path / "run.h5", dimension=3)
    plain, asked = (
        json.loads(granufab("measure", run, "--json", "--frame", -1, *options).out)[0]
        for options in ((), ("--with-forces",))
    )
    assert plain["dimension"] == 3
    g_1, g_2, g_3 = (plain[f"g_{k}"] for k in (1, 2, 3))
    assert plain["b_g"] == pytest.approx((g_2 - g_3) / (g_1 - g_3))
    assert not {"a_n", "sliding_fraction"} & set(plain)
    assert {name: asked[name] for name in plain} == plain
    assert asked["a_t"] == pytest.approx(0.0, abs=1e-12)
    assert asked["sliding_fraction"] == 0.0
    assert asked["mean_mobilisation"] == pytest.approx(0.0, abs=1e-12)
    assert asked["strong_share"] == pytest.approx(np.exp(-1), abs=0.06)
    table = granufab("measure", run, "--with-forces").out
    assert "b_G" in table and "sliding" in table


def test_a_criterion_without_forces_says_so(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file, "--json", "--with-forces", "--criterion", "gap:0.5")
    assert done.code == 0
    assert json.loads(done.out)[0]["a_n"] is None
    assert "contact forces" in done.err


@pytest.mark.parametrize("frame", [1, -2])
def test_one_state(granufab, run_file: Path, frame: int) -> None:
    states = json.loads(granufab("measure", run_file, "--json", "--frame", frame).out)
    assert [state["eps_q"] for state in states] == [pytest.approx(0.1)]
    assert states[0]["frame"] == 1


@pytest.mark.parametrize("frame", [3, -4])
def test_a_state_that_is_not_there(granufab, run_file: Path, frame: int) -> None:
    done = granufab("measure", run_file, "--frame", frame)
    assert done.code == 2
    assert "0..2" in done.err


@pytest.mark.parametrize("criterion", ["gap:-1", "gap:x", "gap", "closeness"])
def test_an_unknown_criterion(granufab, run_file: Path, criterion: str) -> None:
    done = granufab("measure", run_file, "--criterion", criterion)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert criterion in done.err


def test_the_table_for_people_names_the_definitions(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file)
    assert done.code == 0
    assert "force" in done.out
    assert "z_backbone" in done.out


def test_csv(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "table.csv"
    assert granufab("measure", run_file, "--out", out).code == 0
    with out.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["source"] for row in rows] == [str(run_file)] * 3
    assert [float(row["z_backbone"]) for row in rows] == [4.0] * 3


def test_netcdf_keeps_units_and_definitions(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "table.nc"
    assert granufab("measure", run_file, run_file, "--out", out).code == 0
    with xr.open_dataset(out, engine="scipy") as table:
        assert table.sizes["frame"] == 6
        assert table.attrs["criterion"] == "force"
        assert table["theta_c"].attrs["units"] == "degree"


def test_a_table_is_not_overwritten(granufab, run_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "table.csv"
    out.write_text("precious", encoding="utf-8")
    done = granufab("measure", run_file, "--out", out)
    assert done.code == 2
    assert "--force" in done.err
    assert out.read_text(encoding="utf-8") == "precious"
    assert granufab("measure", run_file, "--out", out, "--force").code == 0
    assert out.read_text(encoding="utf-8") != "precious"


def test_an_ending_that_is_no_table(granufab, run_file: Path, tmp_path: Path) -> None:
    done = granufab("measure", run_file, "--out", tmp_path / "table.xlsx")
    assert done.code == 2
    assert ".csv" in done.err
