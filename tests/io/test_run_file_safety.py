"""Killed writers, truncated, mangled, foreign and hostile files."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from random_frames import assert_same_frame, random_frame, random_row

import granufab.io as gio
from granufab.errors import CorruptFile, MissingData, UnknownFormat
from granufab.history import Frame, Run
from granufab.io.run_file import RunFileWriter

HERE = Path(__file__).parent
BROKEN = (CorruptFile, UnknownFormat)


def _frames(count: int, **kwargs: Any) -> list[Frame]:
    rng = np.random.default_rng(11)
    frames = [random_frame(rng, wall_count=5, **kwargs)]
    for k in range(1, count):
        base = frames[0].packing.grains
        frames.append(
            random_frame(rng, wall_count=5, base=base, **{**kwargs, "contact_count": 50 + 13 * k})
        )
    return frames


def _assert_prefix(run: Run, frames: list[Frame], count: int) -> None:
    assert len(run.frames) == count
    for index in range(count):
        assert_same_frame(run.frames[index], frames[index])


@pytest.fixture
def frames() -> list[Frame]:
    return _frames(4)


@pytest.fixture
def finished(tmp_path: Path, frames: list[Frame]) -> Path:
    path = tmp_path / "finished.h5"
    rng = np.random.default_rng(2)
    with RunFileWriter(path, settings={"name": "x"}) as writer:
        for frame in frames:
            writer.row(random_row(rng))
            writer.frame(frame)
        writer.close({"steps": 3})
    return path


def test_a_copy_taken_while_writing_opens_to_the_last_complete_frame(
    tmp_path: Path, frames: list[Frame]
) -> None:
    path = tmp_path / "run.h5"
    rng = np.random.default_rng(2)
    with RunFileWriter(path, settings={}) as writer:
        for count, frame in enumerate(frames, start=1):
            writer.row(random_row(rng))
            writer.frame(frame)
            _assert_prefix(gio.read(path), frames, count)  # live
            copy = Path(shutil.copy(path, tmp_path / f"copy{count}.h5"))
            _assert_prefix(gio.read(copy), frames, count)
            assert gio.read(copy).series.sizes["record"] == count
            assert gio.describe(copy)["finished"] is False


def test_a_writer_that_dies_in_the_middle_of_a_frame(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    done = _child(path, "exit")
    output, _ = done.communicate(timeout=60)
    assert done.returncode == 9
    assert output.split()[-1] == "3"
    run = gio.read(path)
    assert len(run.frames) == 3
    assert run.series.sizes["record"] == 4
    _assert_replays(run)


def test_a_writer_killed_at_any_moment(tmp_path: Path) -> None:
    rng = np.random.default_rng()
    for trial in range(3):
        path = tmp_path / f"run{trial}.h5"
        child = _child(path, "run")
        assert child.stdout is not None
        for _ in range(3 + 5 * trial):
            reported = int(child.stdout.readline())
        signal.sigtimedwait([], float(rng.uniform(0, 0.02)))
        child.send_signal(signal.SIGKILL)
        rest, _ = child.communicate(timeout=60)
        reported = int(rest.split()[-1]) if rest.split() else reported
        run = gio.read(path)
        assert reported <= len(run.frames) <= reported + 1
        assert len(run.frames) <= run.series.sizes["record"] <= len(run.frames) + 1
        _assert_replays(run)


def _child(path: Path, how: str) -> subprocess.Popen[str]:
    source = HERE.parent.parent / "src"
    environment = {**os.environ, "PYTHONPATH": f"{source}{os.pathsep}{HERE}"}
    command = [sys.executable, str(HERE / "killed_writer.py"), str(path), how]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)


def _assert_replays(run: Run) -> None:
    """The frames equal those that the same seed gives again."""
    rng = np.random.default_rng(5)
    base = None
    for count in range(len(run.frames)):
        wanted = random_frame(rng, grain_count=300, contact_count=500 + count % 90, base=base)
        base = wanted.packing.grains
        row = random_row(rng, "loose")
        assert_same_frame(run.frames[count], wanted)
        assert float(run.series["phi"][count]) == row["phi"]
    assert run.name == "loose"


@pytest.mark.parametrize("group", ["grains/position", "contacts/force", "contacts/normal"])
def test_a_flipped_byte_in_the_large_arrays_is_noticed(
    tmp_path: Path, finished: Path, group: str
) -> None:
    with h5py.File(finished, "r") as file:
        chunk = file[group].id.get_chunk_info(0)
    content = bytearray(finished.read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 1
    finished.write_bytes(content)
    run = gio.read(finished)
    with pytest.raises(CorruptFile):
        run.frames[0]


def test_files_that_are_not_ours(tmp_path: Path) -> None:
    with pytest.raises(MissingData, match="no such file"):
        gio.read(tmp_path / "nowhere.h5")
    with pytest.raises(UnknownFormat, match="is of no known format"):
        gio.read(tmp_path)
    for content in (b"", b"x", b"\x89HDF", b"PK\x03\x04 zip", b"z,a\n3,0.2\n"):
        path = tmp_path / "other.h5"
        path.write_bytes(content)
        with pytest.raises(UnknownFormat, match=r"other\.h5"):
            gio.read(path)
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["data"] = np.arange(3)
    with pytest.raises(UnknownFormat, match="HDF5 of no known kind"):
        gio.read(tmp_path / "foreign.h5")
    with pytest.raises(UnknownFormat, match="not a granufab run file"):
        gio.describe(tmp_path / "foreign.h5")


def test_a_newer_schema_names_both_versions(finished: Path) -> None:
    with h5py.File(finished, "r+") as file:
        file.attrs["schema_version"] = 7
    with pytest.raises(UnknownFormat, match=r"schema_version 7.* up to 2"):
        gio.read(finished)


def _retype(file: h5py.File, name: str, **kwargs: Any) -> None:
    del file[name]
    file.create_dataset(name, **kwargs)


def _link_elsewhere(file: h5py.File) -> None:
    del file["contacts/gap"]
    file["contacts/gap"] = h5py.ExternalLink("/etc/hostname", "/x")


def _soft_link(file: h5py.File) -> None:
    file.move("contacts/gap", "hidden")
    file["contacts/gap"] = h5py.SoftLink("/hidden")


def _linked_group(file: h5py.File) -> None:
    file.move("contacts", "hidden")
    file["contacts"] = h5py.SoftLink("/hidden")


def _external_storage(file: h5py.File) -> None:
    _retype(
        file,
        "grains/radius",
        shape=(30,),
        dtype="float64",
        external=[("/etc/passwd", 0, 240)],
    )


def _bomb(file: h5py.File) -> None:
    file["contacts/pair"].resize(2**40, axis=0)
    file["contacts/start"][1:] = 2**40


def _set(name: str, index: Any, value: Any) -> Any:
    def change(file: h5py.File) -> None:
        file[name][index] = value

    return change


HOSTILE: dict[str, Any] = {
    "external link": _link_elsewhere,
    "soft link": _soft_link,
    "linked group": _linked_group,
    "external storage": _external_storage,
    "declared size": _bomb,
    "missing dataset": lambda f: f.__delitem__("grains/position"),
    "group for dataset": lambda f: (f.__delitem__("frames/time"), f.create_group("frames/time")),
    "other type": lambda f: _retype(f, "grains/radius", data=np.ones(30, "f4")),
    "other shape": lambda f: _retype(f, "grains/radius", data=np.ones(29)),
    "unwritten radius": lambda f: _retype(f, "grains/radius", shape=(30,), dtype="f8"),
    "compound type": lambda f: _retype(
        f, "frames/stage", data=np.zeros(4, [("x", "i8")]), maxshape=(None,)
    ),
    "counter too large": _set("complete_frames", (), 5),
    "counter negative": _set("complete_frames", (), -1),
    "start beyond the end": _set("contacts/start", 4, 10**9),
    "start falls": _set("contacts/start", 2, 10**9),
    "pair out of range": _set("contacts/pair", 0, 99),
    "radius negative": _set("grains/radius", 3, -1.0),
    "no settings": lambda f: f.attrs.__delitem__("settings"),
    "settings no JSON": lambda f: f.attrs.__setitem__("settings", "{"),
    "settings a list": lambda f: f.attrs.__setitem__("settings", "[1]"),
    "settings too deep": lambda f: f.attrs.__setitem__("settings", "[" * 60000),
    "version no number": lambda f: f.attrs.__setitem__("schema_version", "one"),
    "summary no text": _set("summary", 0, 255),
}


@pytest.mark.parametrize("change", HOSTILE)
def test_contradictions_are_corrupt_files(finished: Path, change: str) -> None:
    with h5py.File(finished, "r+") as file:
        HOSTILE[change](file)
    with pytest.raises(CorruptFile) as caught:
        for frame in gio.read(finished).frames:
            assert frame.packing.grains.count == 30
    assert "\n" not in str(caught.value)
    assert str(finished) in str(caught.value)


def test_a_replaced_file_is_not_taken_for_the_old_one(finished: Path) -> None:
    run = gio.read(finished)
    with RunFileWriter(finished, settings={}, force=True) as writer:
        writer.frame(_frames(1)[0])
    with pytest.raises(CorruptFile, match="replaced"):
        run.frames[0]


FULL_DISK = """
import resource, sys, numpy as np
from random_frames import random_frame
from granufab.io.run_file import RunFileWriter
rng = np.random.default_rng(5)
frame = random_frame(rng, grain_count=300, contact_count=500)
writer = RunFileWriter(sys.argv[1], settings={})
writer.frame(frame)
size = __import__("os").path.getsize(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (size + 60000, size + 60000))
for count in range(1, 100):
    try:
        writer.frame(frame)
    except OSError as error:
        print(count, str(error).count("\\n"), "frames" in str(error), flush=True)
        __import__("os")._exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs RLIMIT_FSIZE")
def test_a_full_disk_keeps_the_frames_before_it(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    source = HERE.parent.parent / "src"
    environment = {**os.environ, "PYTHONPATH": f"{source}{os.pathsep}{HERE}"}
    command = [sys.executable, "-c", FULL_DISK, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    count, lines, named = done.stdout.split()
    assert (lines, named) == ("0", "True")
    run = gio.read(path)
    assert len(run.frames) == int(count) > 1
    assert run.frames[-1].packing.grains.count == 300
