"""``run`` simulates a small case and leaves the promised files; a signal ends it with code 3."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from granufab.history import SERIES_UNITS
from granufab.simulate.settings import load_case

CASE = """
name = "tiny"
[sample]
grain_count = 40
[record]
series_interval = 5e-4
frame_interval = 0.005
[[path]]
strain = 0.02
inertial_number = 5e-3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of one tiny run."""
    from granufab.cli import main

    base = tmp_path_factory.mktemp("run")
    case = base / "tiny.toml"
    case.write_text(CASE, encoding="utf-8")
    arguments = ["run", str(case), "--out", str(base / "out"), "--seed", "5"]
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--set", "material.friction=0.2"])
    assert ended.value.code == 0
    return base / "out"


def test_the_promised_files_and_no_others(folder: Path) -> None:
    names = ["run.h5", "series.csv", "settings.toml", "summary.json"]
    assert sorted(path.name for path in folder.iterdir()) == names


def test_the_series_has_the_promised_columns_and_reaches_the_strain(folder: Path) -> None:
    with (folder / "series.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["path", *SERIES_UNITS]
    assert {row["path"] for row in rows} == {"tiny"}
    assert float(rows[-1]["eps_q"]) == pytest.approx(0.02, rel=1e-6)
    assert 2.0 < float(rows[-1]["z_backbone"]) < 4.1
    assert float(rows[-1]["inertial_number"]) == pytest.approx(5e-3)


def test_the_settings_are_the_resolved_ones(folder: Path) -> None:
    case = load_case(folder / "settings.toml")
    assert case.sample.seed == 5
    assert case.material.friction == 0.2
    assert case.sample.grain_count == 40


def test_the_summary_says_how_well_it_was_solved(folder: Path) -> None:
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["seed"] == 5
    assert (summary["criterion"], summary["z_definition"]) == ("force", "z_backbone")
    assert summary["steps"] >= 200
    assert summary["nonconverged_steps"] <= 0.01 * summary["steps"]
    assert summary["overlap_max"] < 2e-3


def test_other_verbs_read_what_run_left(granufab, folder: Path) -> None:
    states = json.loads(granufab("measure", folder / "run.h5", "--json").out)
    assert states[-1]["eps_q"] == pytest.approx(0.02, rel=1e-6)
    assert states[-1]["p"] == pytest.approx(1.0, abs=0.02)
    found = json.loads(granufab("fit", folder / "series.csv", "--json").out)
    again = json.loads(granufab("fit", folder / "run.h5", "--json").out)
    assert found["z_star"]["value"] == pytest.approx(again["z_star"]["value"], rel=1e-6)


def test_a_case_starts_from_the_last_frame_of_a_run_file(
    granufab, folder: Path, tmp_path: Path
) -> None:
    case = tmp_path / "next.toml"
    case.write_text(CASE, encoding="utf-8")
    arguments = ["run", case, "--set", "path.0.strain=0.002", "--set", "sample.grain_count=99"]
    arguments += ["--set", f'sample.file="{(folder / "run.h5").as_posix()}"', "--out"]
    assert granufab(*arguments, tmp_path / "out").code == 0
    before = json.loads(granufab("measure", folder / "run.h5", "--json").out)[-1]
    after = json.loads(granufab("measure", tmp_path / "out" / "run.h5", "--json").out)[0]
    for name in ("grain_count", "phi", "z_backbone", "p"):
        assert after[name] == pytest.approx(before[name], rel=1e-4)
    assert after["a_signed"] == pytest.approx(before["a_signed"], abs=1e-3)
    assert load_case(tmp_path / "out" / "settings.toml").sample.grain_count == 40
    refused = granufab(*arguments, folder, "--force")
    assert refused.code == 2
    assert (folder / "run.h5").exists()
    gone = granufab(*arguments, tmp_path / "out2", "--set", "sample.file=none.h5")
    assert gone.code == 2
    assert "none.h5" in gone.err


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_with_code_3(granufab, tmp_path: Path, number: signal.Signals) -> None:
    case = tmp_path / "long.toml"
    case.write_text(CASE.replace("strain = 0.02", "strain = 50.0"), encoding="utf-8")
    out = tmp_path / "out"
    program = "from granufab.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", program, "run", str(case), "--out", str(out)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        _wait_for_frames(out / "run.h5", process)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 3, errors
    assert errors.splitlines()[-1] == "granufab: interrupted"
    assert "Traceback" not in errors
    assert json.loads(granufab("info", out / "run.h5", "--json").out)["frames"] >= 1


def test_a_time_limit_ends_with_code_3_and_the_run_goes_on(granufab, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(CASE.replace("strain = 0.02", "strain = 0.06"), encoding="utf-8")
    for out in (tmp_path / "whole", tmp_path / "parts"):
        limit = ("--max-walltime", "0:00:0.7", "--resume") if out.name == "parts" else ()
        codes = [granufab("run", case, "--out", out, *limit)]
        while codes[-1].code == 3:
            assert "--max-walltime is over; go on with --resume" in codes[-1].err
            assert len(codes) < 60
            codes.append(granufab("run", case, "--out", out, *limit))
        assert codes[-1].code == 0, codes[-1].err
    series = [(tmp_path / name / "series.csv").read_bytes() for name in ("whole", "parts")]
    assert series[0] == series[1]
    for text in ("soon", "0", "-5", "1:2:3:4", "nan"):
        done = granufab("run", case, "--out", tmp_path / "other", f"--max-walltime={text}")
        assert done.code == 2
        assert "h:m:s" in done.err


def _wait_for_frames(path: Path, process: subprocess.Popen[str]) -> None:
    """Until the run file has grown past its header, by several frames."""
    for _ in range(1200):
        assert process.poll() is None, process.communicate()
        if path.exists() and path.stat().st_size > 150_000:
            return
        time.sleep(0.1)
    raise AssertionError("no frames within two minutes")


def test_a_run_that_fails_before_its_first_frame_leaves_nothing(granufab, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text("[sample]\ngrain_count = 60\ncoordination = 4.5\n")
    out = tmp_path / "out"
    result = granufab("run", case, "--out", out)
    assert result.code == 1
    assert "gives z_backbone from" in result.err
    assert list(out.iterdir()) == []
