"""The verbs on series with damaged frames, on parts of series, on folders and several files."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from foreign_tables import CELL, STEP, sheared_squares

SAMPLES = Path(os.environ.get("GRANUFAB_SAMPLES", Path(__file__).parents[3] / "shared/samples"))
STRAIN = ("--strain", STEP, "--axis", "x")


def _sample(*names: str) -> Path:
    path = SAMPLES.joinpath(*names)
    if not path.exists():
        pytest.skip(f"no {path.name}: set GRANUFAB_SAMPLES to the folder of sample files")
    return path


def _damaged(folder: Path, frames: int = 6, at: int = 2) -> tuple[Path, Path]:
    """The series of :func:`sheared_squares` with a number lost in one frame of the contacts."""
    grains, contacts = sheared_squares(folder, frames)
    text = contacts.read_text()
    assert f"{at},1,5,-1,0" in text
    contacts.write_text(text.replace(f"\n{at},1,5,-1,0\n", f"\n{at},1,99,-1,0\n"))
    return grains, contacts


def test_measure_leaves_out_damaged_frames(granufab, tmp_path: Path) -> None:
    paths = _damaged(tmp_path)
    done = granufab("measure", *paths, *CELL, *STRAIN, "--json")
    assert (done.code, done.out) == (2, "")
    assert len(done.err.splitlines()) == 1
    assert "99" in done.err
    assert "--skip-damaged" in done.err
    done = granufab("measure", *paths, *CELL, *STRAIN, "--skip-damaged", "--json")
    assert done.code == 0, done.err
    states = json.loads(done.out)
    assert [state["frame"] for state in states] == [0, 1, 3, 4, 5]
    for state in states:
        assert state["eps_q"] == pytest.approx(STEP * state["frame"])
        assert state["z"] == 2 * (32 - state["frame"] // 2) / 16
        (skipped,) = state["skipped_frames"]
        assert skipped["frame"] == 2
        assert "99" in skipped["reason"]
    assert "granufab: warning: 1 damaged frames skipped" in done.err
    assert "granufab: frame 2 skipped: " in done.err
    assert "skipped_frames" not in granufab("measure", *sheared_squares(tmp_path), "--json").out


def test_frames_keep_their_numbers(granufab, tmp_path: Path) -> None:
    paths = _damaged(tmp_path)
    options = (*paths, *CELL, *STRAIN, "--skip-damaged")
    for given, number in ((3, 3), (-1, 5), (-4, 1)):
        states = json.loads(granufab("measure", *options, "--frame", given, "--json").out)
        assert [state["frame"] for state in states] == [number]
        curves = json.loads(
            granufab("criterion", *options, "--frame", given, "--json", "--bootstrap", 0).out
        )
        assert curves["frame"] == number
        assert curves["eps_q"] == pytest.approx(STEP * number)
        assert [one["frame"] for one in curves["skipped_frames"]] == [2]
    for verb in (("measure",), ("export", "-o", tmp_path / "no.csv"),
                 ("plot", "--figure", "rose", "-o", tmp_path / "no.png")):  # fmt: skip
        done = granufab(verb[0], *options, *verb[1:], "--frame", 2)
        assert done.code == 2
        assert "holds frames 0..5, 5 of them" in done.err
    states = json.loads(granufab("measure", *paths, *CELL, "--frames", "3:", "--json").out)
    assert [state["frame"] for state in states] == [3, 4, 5]


def test_balance_goes_over_the_gap(granufab, tmp_path: Path) -> None:
    paths = _damaged(tmp_path, frames=6, at=3)
    done = granufab("balance", *paths, *CELL, *STRAIN, "--skip-damaged", "--json")
    assert done.code == 0, done.err
    rows = json.loads(done.out)
    ends = [(row["frame_before"], row["frame_after"]) for row in rows]
    assert ends == [(0, 1), (1, 2), (2, 4), (4, 5)]
    assert [row["lost"] for row in rows] == [0, 1, 1, 0]  # one every second frame
    assert all([one["frame"] for one in row["skipped_frames"]] == [3] for row in rows)


def test_fit_plot_info_and_import_leave_them_out(granufab, tmp_path: Path) -> None:
    paths = _damaged(tmp_path, frames=24, at=5)
    options = (*paths, *CELL, *STRAIN)
    fit = ("fit", *options, "--z-definition", "z", "--json")
    assert granufab(*fit).code == 2
    done = granufab(*fit, "--skip-damaged")
    assert done.code == 0, done.err
    fitted = json.loads(done.out)
    assert [one["frame"] for one in fitted["skipped_frames"]] == [5]
    figure = tmp_path / "path.png"
    done = granufab("plot", *options, "--skip-damaged", "--figure", "series", "-o", figure)
    assert done.code == 0, done.err
    assert "frame 5 skipped" in done.err
    assert figure.stat().st_size > 3000
    found = json.loads(granufab("info", *options, "--skip-damaged", "--json").out)
    assert (found["frames"], found["skipped_frames"][0]["frame"]) == (23, 5)
    imported = tmp_path / "imported.h5"
    summary = json.loads(
        granufab("import", *options, "--skip-damaged", "-o", imported, "--json").out
    )
    assert (summary["frames"], summary["frames_read"]) == (24, 23)
    assert [one["frame"] for one in summary["skipped_frames"]] == [5]
    again = json.loads(granufab("fit", imported, "--z-definition", "z", "--json").out)
    assert again["z_min"] == fitted["z_min"]


def test_own_runs_need_no_skipping(granufab, run_file: Path) -> None:
    done = granufab("measure", run_file, "--skip-damaged")
    assert done.code == 2
    assert "--skip-damaged is for other programs' data" in done.err


def test_the_photoelastic_sample(granufab) -> None:
    folder = _sample("rigidlib", "DataAnnulus_1")
    done = granufab("measure", folder, "--json")
    assert (done.code, len(done.err.splitlines())) == (2, 1)
    states = json.loads(granufab("measure", folder, "--skip-damaged", "--json").out)
    assert [state["frame"] for state in states] == [0]
    assert states[0]["z"] == pytest.approx(2 * 51 / 1783)


def test_three_files_of_lmgc90_and_its_folder(granufab) -> None:
    folder = _sample("lmgc90_text", "1024DK_BoxJC")
    files = [folder / name for name in ("BODIES.DAT", "DOF.INI", "Vloc_Rloc.INI")]
    given = ("--json", "--z-definition", "z")
    states = [json.loads(granufab("measure", *what, *given).out) for what in (files, [folder])]
    for (state,) in states:
        assert (state["grain_count"], state["contact_count"]) == (1024, 1929)
        assert (round(state["z"], 3), round(state["a"], 3)) == (3.768, 0.079)


def test_a_folder_of_rigidlibrary(granufab) -> None:
    folder = _sample("rigidlib", "DataSim")
    done = granufab("measure", folder, "--json", "--z-definition", "z", "--criterion", "listed")
    states = json.loads(done.out)
    assert [state["frame"] for state in states] == list(range(11))
    assert all(3.7635 <= state["z"] < 3.7735 for state in states)
    assert all(0.1775 <= state["a"] < 0.1855 for state in states)
    part = granufab("measure", folder, "--json", "--frames", "8:", "--criterion", "listed")
    assert [state["frame"] for state in json.loads(part.out)] == [8, 9, 10]
    rows = json.loads(granufab("balance", folder, "--json", "--criterion", "listed").out)
    assert all(0 <= row[name] <= 4 for row in rows for name in ("gained", "lost"))
    for row in rows:
        for k in range(len(row["gain"])):
            change = row["gain"][k] - row["loss"][k] + row["current_in"][k] - row["current_out"][k]
            assert row["after"][k] == row["before"][k] + change
