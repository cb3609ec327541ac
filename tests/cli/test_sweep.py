"""``granufab sweep``: exit codes, interruption and continuation, figures, its template."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from granufab.campaign import expand, load_sweep
from granufab.campaign.ledger import read_table
from granufab.cli.sweep_progress import time_left

TEXT = """
seeds = {seeds}
[case.sample]
grain_count = 40
[[case.path]]
strain = 0.01
inertial_number = 3e-3
[case.record]
series_interval = 1e-4
[[parameter]]
key = "material.friction"
values = [0.2, 0.6]
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.format(seeds=2), encoding="utf-8")
    return path


def test_a_campaign_from_the_shell(campaign: Path, granufab) -> None:
    done = granufab("sweep", campaign, "--workers", "1", "--json")
    assert done.code == 0, done.err
    summary = json.loads(done.out)
    folder = campaign.with_suffix("")
    assert (summary["done"], summary["results"]) == (4, "results.nc")
    assert json.loads((folder / "summary.json").read_text()) == summary
    figure = campaign.with_name("mu.pdf")
    assert granufab("sweep", folder, "--plot", "friction", "-o", figure).code == 0
    assert figure.read_bytes().startswith(b"%PDF")
    (folder / "results.nc").unlink()
    assert granufab("sweep", folder, "--gather").code == 0
    assert (folder / "results.nc").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_ends_with_3_and_the_same_command_goes_on(tmp_path: Path) -> None:
    file, folder = tmp_path / "mine.toml", tmp_path / "out"
    file.write_text(TEXT.format(seeds=3).replace("strain = 0.01", "strain = 0.03"))
    program = "from granufab.cli import main; main()"
    command = [sys.executable, "-c", program, "sweep", str(file), "--out", str(folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command += ["--workers", "1"]
    going = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not list(folder.glob("cases/*/summary.json")) and time.monotonic() < deadline:
        time.sleep(0.05)
    going.send_signal(signal.SIGINT)
    _, said = going.communicate(timeout=120)
    assert going.returncode == 3, said
    rows = read_table(folder / "cases.csv")
    states = {row.state for row in rows}
    assert "done" in states
    assert states <= {"done", "interrupted", "waiting"}
    assert len(states) > 1
    kept = {row.id: _hash(folder, row.id) for row in rows if row.state == "done"}
    again = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    assert {row.state for row in read_table(folder / "cases.csv")} == {"done"}
    assert {name: _hash(folder, name) for name in kept} == kept


def _hash(folder: Path, name: str) -> tuple[str, int]:
    file = folder / "cases" / name / "run.h5"
    return hashlib.sha256(file.read_bytes()).hexdigest(), file.stat().st_mtime_ns


def test_a_failed_case_ends_with_1_and_is_named(campaign: Path, granufab) -> None:
    text = campaign.read_text().replace("[0.2, 0.6]", "[0.2]").replace("seeds = 2", "seeds = 1")
    text = text.replace("grain_count = 40", 'grain_count = 40\nfile = "nowhere.h5"')
    campaign.write_text(text)
    done = granufab("sweep", campaign, "--workers", "1")
    assert done.code == 1
    assert "1 of 1 cases failed, see cases.csv; --retry runs them again" in done.err
    assert "nowhere.h5" in done.err
    assert "Traceback" not in done.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--workers", "900"], "900 workers of 1 threads need 900 cores"),
        (["--plot", "friction"], "belong together"),
        (["--manifest", "--gather"], "writes scripts only"),
        (["--dask", "nothing"], ("allowed local, slurm, pbs, sge", "install granufab[sweep]")),
    ],
)
def test_bad_options_end_with_2_and_run_nothing(
    options: list[str], words: str | tuple[str, ...], campaign: Path, granufab
) -> None:
    done = granufab("sweep", campaign, *options)
    assert done.code == 2
    assert any(one in done.err for one in ([words] if isinstance(words, str) else words))
    assert not list(campaign.with_suffix("").glob("cases/*"))


def test_a_manifest_runs_nothing(campaign: Path, granufab) -> None:
    done = granufab("sweep", campaign, "--manifest")
    folder = campaign.with_suffix("")
    assert done.code == 0, done.err
    assert len((folder / "manifest.csv").read_text().splitlines()) == 5
    assert len(list(folder.glob("cases/*/settings.toml"))) == 4
    assert not list(folder.glob("cases/*/run.h5"))


def test_the_template_expands(granufab, tmp_path: Path) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(granufab("new", "sweep").out, encoding="utf-8")
    members = expand(load_sweep(file))
    assert len(members) == 4 * 2 * 3
    assert set(members[0].parameters) == {"friction", "rate"}


def test_the_time_left_is_a_proportion() -> None:
    assert time_left(30.0, 0.25, 0.5) == "about 60 s left"
    assert time_left(600.0, 0.0, 0.1) == "about 90 min left"
    assert time_left(36000.0, 0.0, 0.5) == "about 10 h left"
    assert time_left(30.0, 0.5, 0.5) == ""
