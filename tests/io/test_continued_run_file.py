"""A run file that is continued ends as one that was written without a break."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from random_frames import assert_same_frame, random_frame, random_row
from version_one import make_version_one

import granufab.io as gio
from granufab.errors import CorruptFile, InvalidPacking, InvalidSettings, MissingData
from granufab.history import Frame
from granufab.io import RunFileWriter
from granufab.io.checked_file import repair_run_file
from granufab.io.run_lock import RunLock

COUNT = 7
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def path_of_frames() -> tuple[list[Frame], list[dict[str, Any]]]:
    """Frames that hold more and fewer contacts and optional entries, and as many rows."""
    rng = np.random.default_rng(3)
    frames: list[Frame] = []
    for k in range(COUNT):
        lacks = ("velocity", "branch") if k % 3 == 1 else ()
        base = frames[0].packing.grains if frames else None
        walls = None if k % 3 == 2 else 4 + k
        count = (90, 300, 7)[k % 3]
        frames.append(
            random_frame(rng, contact_count=count, wall_count=walls, base=base, lacks=lacks)
        )
    return frames, [random_row(rng) for _ in range(COUNT)]


def _write(writer: RunFileWriter, run: Any, first: int, last: int) -> None:
    frames, rows = run
    for k in range(first, last):
        writer.row(rows[k])
        writer.frame(frames[k])


def _assert_equals(path: Path, run: Any, count: int = COUNT) -> None:
    frames, rows = run
    got = gio.read(path)
    assert len(got.frames) == count
    for index in range(count):
        assert_same_frame(got.frames[index], frames[index])
    assert got.series["z"].values.tolist() == [row["z"] for row in rows[:count]]


@pytest.mark.parametrize(
    ("state", "kept"),
    [
        *(("left open", kept) for kept in range(COUNT + 1)),
        *(("finished", kept) for kept in (0, 3, COUNT)),
        *(("closed", kept) for kept in (1, COUNT - 1)),
        *(("version 1", kept) for kept in (0, 4)),
    ],
)
def test_it_goes_on_behind_any_frame(
    tmp_path: Path, path_of_frames: Any, state: str, kept: int
) -> None:
    path, live = tmp_path / "run.h5", tmp_path / "live.h5"
    writer = RunFileWriter(live, settings={"name": "x"})
    _write(writer, path_of_frames, 0, COUNT)
    if state == "finished":
        writer.close({"steps": 3})
    elif state != "left open":
        writer.close()
    shutil.copy(live, path)
    writer.close()
    if state == "version 1":
        make_version_one(path)
    created = gio.describe(path)["created"]
    with RunFileWriter.continued(path, frames=kept, rows=kept) as writer:
        assert (writer.frame_count, writer.row_count) == (kept, kept)
        _assert_equals(path, path_of_frames, kept)
        assert gio.describe(path)["finished"] is False
        _write(writer, path_of_frames, kept, COUNT)
        writer.close({"steps": 4})
    _assert_equals(path, path_of_frames)
    about = gio.describe(path)
    assert (about["finished"], about["created"], about["schema_version"]) == (True, created, 2)
    assert gio.read(path).summary == {"steps": 4}
    assert [one.name for one in tmp_path.iterdir() if one != live] == ["run.h5"]


def test_dropped_frames_stay_dropped(tmp_path: Path, path_of_frames: Any) -> None:
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}) as writer:
        _write(writer, path_of_frames, 0, COUNT)
    with RunFileWriter.continued(path, frames=4, rows=2) as writer:
        pass
    assert len(gio.read(path).frames) == 4
    assert gio.read(path).series.sizes["record"] == 2
    with RunFileWriter.continued(path, frames=4, rows=2) as writer:
        writer.frame(path_of_frames[0][6])
    frames = gio.read(path).frames
    assert len(frames) == 5
    assert_same_frame(frames[4], path_of_frames[0][6])


def test_a_file_without_frames_goes_on(tmp_path: Path, path_of_frames: Any) -> None:
    path = tmp_path / "run.h5"
    RunFileWriter(path, settings={}).close()
    with RunFileWriter.continued(path, frames=0, rows=0) as writer:
        _write(writer, path_of_frames, 0, COUNT)
    _assert_equals(path, path_of_frames)


def test_fewer_frames_or_rows_than_wanted_is_an_error(tmp_path: Path, path_of_frames: Any) -> None:
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}) as writer:
        _write(writer, path_of_frames, 0, 3)
    before = path.read_bytes()
    for frames, rows, match in ((4, 3, "3 complete frames, 4"), (3, 4, "3 complete rows, 4")):
        with pytest.raises(CorruptFile, match=match):
            RunFileWriter.continued(path, frames=frames, rows=rows)
    assert path.read_bytes() == before
    with pytest.raises(MissingData):
        RunFileWriter.continued(tmp_path / "no.h5", frames=0, rows=0)
    assert [one.name for one in tmp_path.iterdir()] == ["run.h5"]


def test_other_grains_are_refused_after_a_break(tmp_path: Path, path_of_frames: Any) -> None:
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}) as writer:
        _write(writer, path_of_frames, 0, 2)
    other = random_frame(np.random.default_rng(8))
    with (
        RunFileWriter.continued(path, frames=2, rows=2) as writer,
        pytest.raises(InvalidPacking, match="radius differs"),
    ):
        writer.frame(other)


def test_what_hdf5_will_not_open_for_writing_is_copied(
    tmp_path: Path, path_of_frames: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings={}) as writer:
        _write(writer, path_of_frames, 0, 5)
    refusals = [OSError("refused")]
    real = h5py.File

    def refusing(name: Any, mode: str = "r", **options: Any) -> Any:
        if mode == "r+" and refusals:
            raise refusals.pop()
        return real(name, mode, **options)

    monkeypatch.setattr(h5py, "File", refusing)
    with RunFileWriter.continued(path, frames=4, rows=4) as writer:
        _write(writer, path_of_frames, 4, COUNT)
    assert not refusals
    _assert_equals(path, path_of_frames)


def test_one_writer_at_a_time(tmp_path: Path, path_of_frames: Any) -> None:
    path = tmp_path / "run.h5"
    code = (
        "import sys; from granufab.io import RunFileWriter\n"
        "RunFileWriter.continued(sys.argv[1], frames=1, rows=1)"
    )
    environment = {**os.environ, "HDF5_USE_FILE_LOCKING": "FALSE"}
    with RunFileWriter(path, settings={}) as writer:
        _write(writer, path_of_frames, 0, 1)
        for force in (False, True):
            with pytest.raises(InvalidSettings, match="this process"):
                RunFileWriter(path, settings={}, force=force)
        done = subprocess.run(
            [sys.executable, "-c", code, str(path)], capture_output=True, text=True, env=environment
        )
        assert f"in use by process {os.getpid()}" in done.stderr
        _write(writer, path_of_frames, 1, COUNT)
    _assert_equals(path, path_of_frames)
    with RunLock(tmp_path), RunFileWriter.continued(path, frames=1, rows=1):
        assert sorted(one.name for one in tmp_path.iterdir()) == ["run.h5", "run.lock"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
@pytest.mark.parametrize("kills", [4, pytest.param(20, marks=pytest.mark.slow)])
def test_kill_and_continue_again_and_again(tmp_path: Path, kills: int) -> None:
    """A quarter of the kills come inside a write; every start keeps what was complete."""
    rng = np.random.default_rng()
    path = tmp_path / "run.h5"
    kept = inside = 0
    for trial in range(kills):
        how = "torn" if trial % 4 == 3 else "run"
        child = _writer(path, kept, how, int(rng.integers(1, 120)))
        assert child.stdout is not None
        reported = kept
        if how == "run":
            for _ in range(int(rng.integers(1, 6))):
                reported = int(child.stdout.readline())
            signal.sigtimedwait([], float(rng.uniform(0, 0.02)))
            child.send_signal(signal.SIGKILL)
        rest, errors = child.communicate(timeout=60)
        assert child.returncode == -signal.SIGKILL, errors
        inside += how == "torn"
        reported = int(rest.split()[-1]) if rest.split() else reported
        if not path.exists():
            assert reported == 0
            continue
        run = gio.read(path)
        assert reported <= len(run.frames) <= reported + 1
        assert len(run.frames) <= run.series.sizes["record"] <= len(run.frames) + 1
        kept = max(0, len(run.frames) - int(rng.integers(0, 3)))
    assert inside == kills // 4
    run = gio.read(path)
    for index, frame in enumerate(run.frames):
        assert_same_frame(frame, _frame(index))
        assert float(run.series["phi"][index]) == random_row(np.random.default_rng(index))["phi"]
    print(f"{kills} kills, {inside} inside writes: {len(run.frames)} frames, all right")


def _frame(index: int) -> Frame:
    base = random_frame(np.random.default_rng(0), grain_count=300).packing.grains
    rng = np.random.default_rng(index)
    return random_frame(rng, grain_count=300, contact_count=500 + index % 90, base=base)


def _writer(path: Path, kept: int, how: str, calls: int) -> subprocess.Popen[str]:
    source = HERE.parent.parent / "src"
    environment = {**os.environ, "PYTHONPATH": f"{source}{os.pathsep}{HERE}"}
    command = [sys.executable, str(HERE / "continuing_writer.py"), str(path), str(kept), how]
    return subprocess.Popen(
        [*command, str(calls)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )


@pytest.mark.parametrize("state", ["finished", "left open"])
def test_a_kill_while_it_is_opened_leaves_the_old_or_the_shortened_file(
    tmp_path: Path, path_of_frames: Any, monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    """The file as it is on the disk after each step of dropping what is not kept."""
    path, live = tmp_path / "run.h5", tmp_path / "live.h5"
    live_writer = RunFileWriter(live, settings={})
    _write(live_writer, path_of_frames, 0, COUNT)
    if state == "finished":
        live_writer.close({"steps": 3})
    shutil.copy(live, path)
    live_writer.close()
    copies: list[Path] = []
    real = h5py.File.flush

    def copying(file: h5py.File) -> None:
        real(file)
        copies.append(Path(shutil.copy(path, tmp_path / f"copy{len(copies)}.h5")))

    with monkeypatch.context() as patch:
        patch.setattr(h5py.File, "flush", copying)
        writer = RunFileWriter.continued(path, frames=3, rows=4)
        patch.undo()
        writer.close()
    seen = []
    for copy in copies:
        run = gio.read(copy)
        frames, rows = len(run.frames), run.series.sizes["record"]
        assert (frames, rows) in ((COUNT, COUNT), (3, COUNT), (3, 4))
        for index in range(frames):
            assert_same_frame(run.frames[index], path_of_frames[0][index])
        assert run.series["z"].values.tolist() == [row["z"] for row in path_of_frames[1][:rows]]
        seen.append(frames)
    assert len(copies) == 5 and seen[0] == COUNT and seen[-1] == 3
    assert seen == sorted(seen, reverse=True)


def test_checking_and_copying_hold_a_frame_at_a_time(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    first = random_frame(rng, grain_count=1000, contact_count=2500)
    base = first.packing.grains
    peaks = []
    for count in (2, 16):
        path = tmp_path / f"{count}.h5"
        with RunFileWriter(path, settings={}) as writer:
            for _ in range(count):
                writer.frame(random_frame(rng, grain_count=1000, contact_count=2500, base=base))
        tracemalloc.start()
        try:
            assert repair_run_file(path, tmp_path / f"new{count}.h5").faults == ()
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0]
