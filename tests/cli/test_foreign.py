"""The verbs on other programs' data: the same tables, figures and fits as of own runs."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from foreign_tables import CELL, STEP, sheared_squares

SAMPLES = Path(os.environ.get("GRANUFAB_SAMPLES", Path(__file__).parents[3] / "shared/samples"))


def test_files_that_complete_each_other_are_one_series(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path)
    done = granufab("measure", *paths, *CELL, "--strain", STEP, "--axis", "x", "--json")
    assert done.code == 0, done.err
    states = json.loads(done.out)
    assert [s["frame"] for s in states] == list(range(24))
    for frame, state in enumerate(states):
        along_x, along_y = 16, 16 - frame // 2
        assert state["source"] == str(paths[0])
        assert state["criterion"] == "force"
        assert state["eps_q"] == pytest.approx(STEP * frame)
        assert state["z"] == 2 * (along_x + along_y) / 16
        assert state["phi"] == pytest.approx(math.pi / 4)
    # F = diag(16, 4 + 1)/…: a' = 2 (F_xx − F_yy) with all contacts of grains that have two.
    share = 16 / (16 + 16 - 23 // 2)
    assert states[-1]["a_signed"] == pytest.approx(2 * (2 * share - 1))
    lines = done.err.splitlines()
    assert sum("24 frames in 2 files" in line for line in lines) == 1
    assert all(line.startswith("granufab: ") for line in lines)


def test_what_is_missing_is_named_with_its_option(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path, 2)
    err = granufab("measure", *paths, "--json").err
    assert "--cell" in err
    assert "--strain" in err
    bare = tmp_path / "bare.csv"
    bare.write_text("x,y,z\n0,0,0\n1,1,1\n")
    done = granufab("measure", bare, "--json")
    assert (done.code, done.out) == (2, "")
    assert "--radius" in done.err
    assert len(done.err.splitlines()) == 1
    states = json.loads(granufab("measure", bare, "--radius", 1, "--json").out)
    assert (states[0]["criterion"], states[0]["contact_count"]) == ("gap:0.0", 1)


def test_a_column_map_comes_from_a_file(granufab, tmp_path: Path) -> None:
    table = tmp_path / "table.dat"
    table.write_text("8 0 0 1\n8 2 0 1\n8 1 1.7 1\n")
    columns = tmp_path / "columns.toml"
    columns.write_text("[grains]\nx = 2\ny = 3\nradius = 4\n")
    arguments = ("measure", table, "--columns", columns, "--json", "--format", "csv")
    states = json.loads(granufab(*arguments, "--criterion", "gap:0.01").out)
    assert (states[0]["dimension"], states[0]["contact_count"]) == (2, 3)
    columns.write_text("[grains]\nx = 2\ny = 9\n")
    done = granufab(*arguments)
    assert done.code == 2
    assert "columns 1..4" in done.err
    columns.write_text("x = 2")
    assert "outside a section" in granufab(*arguments).err


def test_run_files_refuse_what_they_tell_themselves(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file, "--radius", 1)
    assert done.code == 2
    assert "--radius is for other programs' data" in done.err


def test_own_runs_and_foreign_data_stand_side_by_side(
    granufab, run_file: Path, tmp_path: Path
) -> None:
    paths = sheared_squares(tmp_path, 2)
    states = json.loads(granufab("measure", run_file, *paths, *CELL, run_file, "--json").out)
    assert [s["source"] for s in states] == [str(run_file)] * 3 + [str(paths[0])] * 2 + [
        str(run_file)
    ] * 3
    assert len({s["z"] for s in states}) == 1


def test_balance_follows_contacts_of_persisting_grains(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path)
    done = granufab("balance", *paths, *CELL, "--strain", STEP, "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)
    assert [row["lost"] for row in rows] == [k % 2 for k in range(23)]
    assert sum(row["gained"] for row in rows) == 0
    table = granufab("balance", *paths, *CELL).out
    assert "strain between the frames is unknown; give --strain" in " ".join(table.split())


def test_criterion_info_and_plot_take_them(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path, 12)
    curves = json.loads(granufab("criterion", *paths, *CELL, "--json", "--bootstrap", 0).out)
    # At a share of 1.4 of the mean only the contacts along y are left, and below it all.
    force = dict(zip(curves["force"]["threshold"], curves["force"]["z"], strict=True))
    assert max(force.values()) == max(curves["force"]["z"])
    found = json.loads(granufab("info", *paths, "--json").out)
    assert (found["frames"], found["grain_count"], found["contact_count"]) == (12, 16, 32)
    for figure in ("series", "path", "zaz", "network", "rose", "forces", "balance"):
        out = tmp_path / f"{figure}.png"
        options = ("--strain", STEP, "--axis", "x", *CELL, "--figure", figure, "-o", out)
        done = granufab("plot", *paths, *options)
        assert done.code == 0, done.err
        assert out.stat().st_size > 3000
    done = granufab("plot", *paths, *CELL, "--figure", "balance", "-o", tmp_path / "no.png")
    assert done.code == 2
    assert "--strain" in done.err


def test_fit_measures_the_frames(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path)
    options = (*CELL, "--strain", STEP, "--axis", "x")
    done = granufab("fit", *paths, *options, "--z-definition", "z", "--json")
    assert done.code == 0, done.err
    fitted = json.loads(done.out)
    imported = tmp_path / "imported.h5"
    assert granufab("import", *paths, *options, "-o", imported).code == 0
    again = json.loads(granufab("fit", imported, "--z-definition", "z", "--json").out)
    for name in ("z_min", "z_max", "z_star", "a_star"):
        assert fitted[name] == again[name]
    states = [
        json.loads(granufab("measure", *files, "--json").out)
        for files in ((imported,), (*paths, *options))
    ]
    for own, foreign in zip(*states, strict=True):
        assert own | {"source": 0} == foreign | {"source": 0}
    assert granufab("fit", imported, "--dimension", 2, "--z-definition", "z").code == 0


def test_import_tells_what_it_did(granufab, tmp_path: Path) -> None:
    paths = sheared_squares(tmp_path, 3)
    found = json.loads(granufab("import", *paths, *CELL, "--json").out)
    assert (found["frames"], found["frames_read"], found["grains"]) == (3, 3, 16)
    assert (found["contacts"], found["rattlers"], found["duplicates_dropped"]) == (31, 0, 0)
    assert found["seconds"] > 0
    assert found["peak_memory_bytes"] > 1e7
    text = granufab("import", *paths).out
    assert "3 frames in 2 files, 16 grains" in text
    assert "peak memory" in text
    target = tmp_path / "new.h5"
    target.write_text("mine")
    assert granufab("import", *paths, "-o", target).code == 2
    assert target.read_text() == "mine"


def test_import_refuses_grains_that_change(granufab, tmp_path: Path) -> None:
    table = tmp_path / "growing.csv"
    table.write_text("frame,id,x,y,r\n0,1,0,0,1\n1,1,0,0,1\n1,2,3,3,1\n")
    done = granufab("import", table, "-o", tmp_path / "new.h5")
    assert (done.code, done.out) == (2, "")
    assert len(done.err.splitlines()) == 1
    assert "frame 1 has 2 grains in 2D, but the run began with 1 in 2D" in done.err
    assert "import --frames 0:1 or a later part" in done.err
    assert not (tmp_path / "new.h5").exists()
    for part in ("0:1", "1:"):
        done = granufab("import", table, "--frames", part, "-o", tmp_path / f"{part[0]}.h5")
        assert done.code == 0, done.err
    assert json.loads(granufab("info", tmp_path / "1.h5", "--json").out)["grain_count"] == 2


def test_export_and_back(granufab, tmp_path: Path, run_file: Path) -> None:
    done = granufab("export", run_file, "--frame", 0, "-o", tmp_path / "state.csv")
    assert done.code == 0, done.err
    files = [tmp_path / f"state_{part}.csv" for part in ("grains", "contacts")]
    states = json.loads(granufab("measure", *files, "--cell", "0,0,4,4", "--json").out)
    own = json.loads(granufab("measure", run_file, "--frame", 0, "--json").out)
    for name in ("z", "a", "phi", "p", "contact_count"):
        assert states[0][name] == pytest.approx(own[0][name], abs=1e-12)
    done = granufab("export", run_file, "--frame", 9, "-o", tmp_path / "no.csv")
    assert (done.code, "holds frames 0..2" in done.err) == (2, True)
    assert granufab("export", run_file, "-o", tmp_path / "no.abc").code == 2


def test_a_sample_given_as_two_files(granufab) -> None:
    folder = SAMPLES / "spam_dem"
    if not folder.is_dir():
        pytest.skip(f"the samples are not at {SAMPLES} (GRANUFAB_SAMPLES)")
    done = granufab("measure", folder / "spheres.txt", folder / "contacts.txt", "--json")
    state = json.loads(done.out)[0]
    assert (state["grain_count"], state["contact_count"]) == (203, 337)
    assert state["z"] == pytest.approx(3.320, abs=5e-4)
    whole = granufab(
        "measure", folder / "spheres.txt", folder / "contacts.txt", "--json", "--z-definition", "z"
    )
    values = json.loads(whole.out)[0]
    tensor = np.array(
        [[values["f_" + "".join(sorted(a + b))] for a in "xyz"] for b in "xyz"]
    )  # fmt: skip
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), [0.3099, 0.3278, 0.3623], atol=5e-5)
