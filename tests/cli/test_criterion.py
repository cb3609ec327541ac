"""``criterion`` on a square lattice of unit forces: z = 4 up to the mean force, a = 0."""

from __future__ import annotations

import json
from pathlib import Path

import pytest


def test_json_holds_both_curves(granufab, run_file: Path) -> None:
    done = granufab("criterion", run_file, "--json")
    assert done.code == 0
    entry = json.loads(done.out)
    assert entry["source"] == str(run_file)
    assert entry["frame"] == 2
    assert entry["state_count"] == 1
    assert entry["z_definition"] == "z_backbone"
    force, gap = entry["force"], entry["gap"]
    assert force["z"][:-1] == [4.0] * 32
    assert force["z"][-1] == 0.0  # no force is above the mean where all are equal
    assert gap["z"] == [4.0] * 33
    assert force["a"][-1] is None
    assert gap["a"] == pytest.approx([0.0] * 33, abs=1e-12)
    assert gap["z_error"] == [None] * 33  # 16 grains are too few for blocks
    assert gap["threshold"][0] == pytest.approx(1e-5)


def test_a_window_averages_frames(granufab, run_file: Path) -> None:
    entry = json.loads(granufab("criterion", run_file, "--window", 1, "--json").out)
    assert entry["state_count"] == 3
    assert entry["gap"]["z_error"] == [0.0] * 33


def test_the_table_and_the_figure(granufab, run_file: Path, tmp_path: Path) -> None:
    figure = tmp_path / "curves.pdf"
    done = granufab("criterion", run_file, "-o", figure)
    assert done.code == 0
    assert figure.read_bytes().startswith(b"%PDF")
    assert "gap below [mean diameters]; z_backbone" in " ".join(done.out.split())
    again = granufab("criterion", run_file, "-o", figure)
    assert again.code == 2
    assert "--force" in again.err
    assert granufab("criterion", run_file, "-o", figure, "--force").code == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--frame", 9], "holds frames 0..2"),
        (["--window", -1], "must be a strain >= 0"),
        (["--bootstrap", -1], "must be >= 0"),
        (["-o", "curves.txt"], "must end in one of .pdf"),
        (["-o", "nowhere/curves.pdf"], "there is no folder nowhere"),
    ],
)
def test_bad_input_is_one_line(granufab, run_file: Path, options, says: str) -> None:
    done = granufab("criterion", run_file, *options)
    assert done.code == 2
    assert says in done.err
    assert done.err.count("\n") == 1
