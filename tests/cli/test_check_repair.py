"""What ``check`` and ``repair`` say about sound and damaged files, and what they leave."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from granufab.io import read, write_checkpoint


def _flip(path: Path, dataset: str, row: int, chunk: int = 0) -> None:
    """Change a byte of a record of an uncompressed dataset."""
    with h5py.File(path) as file:
        data = file[dataset]
        place = data.id.get_chunk_info(chunk).byte_offset + row * data.dtype.itemsize + 2
    content = bytearray(path.read_bytes())
    content[place] ^= 16
    path.write_bytes(content)


def _scalar(path: Path, dataset: str, value: int) -> None:
    with h5py.File(path) as file:
        place = file[dataset].id.get_offset()
    content = bytearray(path.read_bytes())
    content[place] = value
    path.write_bytes(content)


def test_sound_files(granufab, run_file: Path) -> None:
    write_checkpoint(run_file.parent / "c", {"x": np.arange(5)}, {})
    (run_file.parent / "notes.txt").write_text("")
    done = granufab("check", run_file.parent)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert [line.split()[-1] for line in lines if line.strip()][1:] == ["sound", "sound"]
    done = granufab("check", run_file, run_file.parent / "c", "--json")
    run, checkpoint = json.loads(done.out)
    assert done.code == 0
    assert (run["frames"], run["sound_frames"], run["rows"], run["sound_rows"]) == (3, 3, 40, 40)
    assert (run["sound"], run["finished"], run["schema_version"]) == (True, False, 2)
    assert (checkpoint["kind"], checkpoint["sound"]) == ("checkpoint", True)


def test_each_fault_is_a_line_and_repair_leaves_the_rest(granufab, run_file: Path) -> None:
    _flip(run_file, "frames/eps_q", 1)
    for row in (4, 5, 9):
        _flip(run_file, "series/z", row)
    damaged = run_file.read_bytes()
    done = granufab("check", run_file)
    assert done.code == 1
    faults = [line for line in done.out.splitlines() if line.startswith(f"{run_file}: ")]
    assert len(faults) == 3
    for fault, words in zip(faults, ("frame 1", "rows 4 to 5", "row 9"), strict=True):
        assert f": {words} " in fault
    new = run_file.with_name("new.h5")
    done = granufab("repair", run_file, "-o", new)
    assert (done.code, done.err) == (0, "")
    assert "2 of 3" in done.out and "37 of 40" in done.out
    assert run_file.read_bytes() == damaged
    run = read(new)
    assert [frame.eps_q for frame in run.frames] == [0.0, 0.2]
    kept = [index for index in range(40) if index not in (4, 5, 9)]
    np.testing.assert_allclose(run.series["eps_q"], 0.01 * np.array(kept), rtol=1e-15)
    assert granufab("check", new).code == 0
    assert sorted(one.name for one in run_file.parent.iterdir()) == ["new.h5", "run.h5"]


def test_repair_of_a_sound_finished_file_is_the_same_run(granufab, run_file: Path) -> None:
    from granufab.io import RunFileWriter

    with RunFileWriter.continued(run_file, frames=2, rows=40) as writer:
        writer.close({"steps": 7})
    new = run_file.with_name("new.h5")
    assert granufab("repair", run_file, "-o", new).code == 0
    old, copy = read(run_file), read(new)
    assert copy.summary == old.summary == {"steps": 7}
    assert copy.settings == old.settings
    assert copy.series.identical(old.series.assign_attrs(source=str(new)))
    assert len(copy.frames) == 2
    for first, second in zip(old.frames, copy.frames, strict=True):
        grains = first.packing.grains, second.packing.grains
        assert grains[0].position.tobytes() == grains[1].position.tobytes()


@pytest.mark.parametrize("name", ["complete_frames", "complete_rows"])
@pytest.mark.parametrize("value", [0, 1, 2])
def test_a_lowered_counter_loses_nothing(granufab, run_file: Path, name: str, value: int) -> None:
    _scalar(run_file, name, value)
    run = read(run_file)
    assert (len(run.frames), run.series.sizes["record"]) == (3, 40)
    assert granufab("check", run_file).code == 0


def test_a_raised_counter_is_a_fault(granufab, run_file: Path) -> None:
    _scalar(run_file, "complete_frames", 5)
    done = granufab("check", run_file)
    assert done.code == 1 and "holds 3 of 5 records" in done.out
    new = run_file.with_name("new.h5")
    assert granufab("repair", run_file, "-o", new).code == 0
    assert len(read(new).frames) == 3


def test_a_truncated_file(granufab, run_file: Path) -> None:
    content = run_file.read_bytes()
    run_file.write_bytes(content[:-1])
    done = granufab("check", run_file)
    assert done.code == 1 and f"{run_file}: is truncated" in done.out
    done = granufab("info", run_file)
    assert done.code == 0
    assert done.err.startswith("granufab: warning: ") and done.err.count("\n") == 1
    new = run_file.with_name("new.h5")
    assert granufab("repair", run_file, "-o", new).code == 0
    assert granufab("check", new).code == 0
    run_file.write_bytes(content[:400])
    done = granufab("check", run_file)
    assert done.code == 1 and len(done.out.splitlines()) > 1
    assert granufab("repair", run_file, "-o", run_file.with_name("other.h5")).code == 2
    assert not run_file.with_name("other.h5").exists()


def test_bad_arguments_are_one_line(granufab, run_file: Path, tmp_path: Path) -> None:
    text, folder = tmp_path / "text", tmp_path / "empty"
    text.write_text("x")
    folder.mkdir()
    checkpoint = tmp_path / "c"
    write_checkpoint(checkpoint, {}, {})
    calls = (
        ("check", text),
        ("check", folder),
        ("check", tmp_path / "none"),
        ("repair", run_file, "-o", run_file),
        ("repair", text, "-o", tmp_path / "new"),
        ("repair", tmp_path / "none", "-o", tmp_path / "new"),
        ("repair", checkpoint, "-o", tmp_path / "new"),
        ("repair", run_file, "-o", text / "new"),
    )
    for call in calls:
        done = granufab(*call)
        assert (done.code, done.out) == (2, ""), call
        assert done.err.count("\n") == 1 and done.err.startswith("granufab: "), call
    assert not (tmp_path / "new").exists()


def test_a_damaged_checkpoint(granufab, tmp_path: Path) -> None:
    path = tmp_path / "c"
    write_checkpoint(path, {"x": np.arange(50)}, {})
    content = bytearray(path.read_bytes())
    content[-60] ^= 1
    path.write_bytes(content)
    done = granufab("check", path)
    assert done.code == 1 and "checksum" in done.out
