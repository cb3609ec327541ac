"""Campaigns without Dask: the scripts of the manifest run the same cases to the same bits."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from granufab.campaign import gather, prepare_manifest, run_campaign
from granufab.campaign.manifest import _ranges

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="scripts of a POSIX shell")


def environment(tmp_path: Path) -> dict[str, str]:
    """A PATH on which ``granufab`` is this source tree's."""
    script = tmp_path / "bin" / "granufab"
    script.parent.mkdir(exist_ok=True)
    call = "from granufab.cli import main; main()"
    script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{call}" "$@"\n')
    script.chmod(0o755)
    source = os.pathsep.join(sys.path)
    return os.environ | {"PATH": f"{script.parent}:{os.environ['PATH']}", "PYTHONPATH": source}


def run_all(folder: Path, tmp_path: Path) -> subprocess.CompletedProcess[str]:
    command = ["sh", str(folder / "run-all.sh"), "2"]
    return subprocess.run(
        command, env=environment(tmp_path), capture_output=True, text=True, timeout=900
    )


@pytest.mark.parametrize(
    ("frictions", "seeds"),
    [((0.5,), 2), pytest.param((0.1, 0.2, 0.4, 0.8), 6, marks=pytest.mark.slow)],
)
def test_the_scripts_give_the_same_bits(
    frictions: tuple[float, ...], seeds: int, tmp_path: Path, small: Callable[..., Any]
) -> None:
    sweep = small(*frictions, seeds=seeds)
    local, other = tmp_path / "local", tmp_path / "manifest"
    run_campaign(sweep, local, workers=1, threads=1)
    planned = prepare_manifest(sweep, other)
    assert planned["waiting"] == planned["cases"] == len(frictions) * seeds
    done = run_all(other, tmp_path)
    assert done.returncode == 0, done.stderr
    summary = run_campaign(sweep, other, gather_only=True)
    assert summary["done"] == summary["cases"]
    xr.testing.assert_identical(gather(local), gather(other))
    for file in local.glob("cases/*/series.csv"):
        twin = other / "cases" / file.parent.name / "series.csv"
        assert twin.read_bytes() == file.read_bytes()


def test_a_job_that_failed_is_told_with_its_reason(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    folder = tmp_path / "out"
    sweep = small(0.2)
    prepare_manifest(sweep, folder)
    (settings,) = folder.glob("cases/*/settings.toml")
    good = settings.read_text()
    settings.write_text("broken = [")
    assert run_all(folder, tmp_path).returncode != 0
    summary = run_campaign(sweep, folder, gather_only=True)
    assert summary["failed"] == 1
    (reason,) = summary["failures"].values()
    assert "not valid TOML" in reason
    settings.write_text(good)
    again = run_campaign(sweep, folder, gather_only=True, retry=True)
    assert (again["failed"], again["waiting"]) == (0, 1)


def test_lines_keep_their_numbers_when_cases_are_added(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    def lines(sweep: Any) -> dict[str, str]:
        prepare_manifest(sweep, tmp_path / "out")
        with (tmp_path / "out" / "manifest.csv").open() as file:
            return {row["id"]: row["number"] for row in csv.DictReader(file)}

    first = lines(small(0.2, 0.4))
    second = lines(small(0.1, 0.2, 0.3, 0.4))
    assert sorted(first.values()) == ["1", "2"]
    assert first.items() < second.items()
    assert sorted(second.values()) == ["1", "2", "3", "4"]


def test_done_cases_are_left_out_of_the_array(finished: Path, small: Callable[..., Any]) -> None:
    copy = finished.parent / "manifest-copy"
    shutil.copytree(finished, copy)
    prepare_manifest(small(0.1, 0.3, 0.6, seeds=2), copy)
    script = (copy / "job-array.sh").read_text()
    assert "#SBATCH --array=3-4\n" in script
    assert subprocess.run(["sh", "-n", str(copy / "job-array.sh")]).returncode == 0


def test_ranges() -> None:
    assert _ranges([1, 2, 3, 7, 9, 10]) == "1-3,7,9-10"
    assert _ranges([]) == ""
