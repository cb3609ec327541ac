"""Truncated and changed run files: the data that were written, or one line of error.

What is read counts as different if any number, name, setting or the summary differs, or if
frames or rows are missing without a warning.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from random_frames import assert_same_frame, random_frame, random_row
from version_one import make_version_one

import granufab.io as gio
from granufab.errors import CorruptFile, GranufabError, IncompleteFile, UnknownFormat
from granufab.history import Frame, Run
from granufab.io import RunFileWriter
from granufab.io.checked_file import check_file
from granufab.io.global_heap import heaps_are_sound

LONGEST = 10.0


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    rng = np.random.default_rng(11)
    first = random_frame(rng, wall_count=5)
    base = first.packing.grains
    return [first, random_frame(rng, wall_count=3, contact_count=90, base=base)]


@pytest.fixture(scope="module", params=["finished", "killed"])
def file(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    frames: list[Frame],
) -> Path:
    """A run file of two frames and three rows, closed or as a killed writer leaves it."""
    folder = tmp_path_factory.mktemp("run")
    rng = np.random.default_rng(2)
    writer = RunFileWriter(folder / "live.h5", settings={"name": "x", "seed": 7})
    for frame in frames:
        writer.row(random_row(rng))
        writer.frame(frame)
    writer.row(random_row(rng))
    if request.param == "finished":
        writer.close({"steps": 3, "residual_max": 1e-7})
    path = Path(shutil.copy(folder / "live.h5", folder / "run.h5"))
    writer.close()
    return path


def _content(run: Run) -> tuple[Any, ...]:
    return run.name, run.settings, run.summary, dict(run.series.attrs, source="")


class Outcomes:
    """Read damaged copies of a file and count what comes out."""

    def __init__(self, path: Path) -> None:
        self.whole = path.read_bytes()
        self.path = path.with_name("damaged.h5")
        self.path.write_bytes(self.whole)
        run = gio.read(self.path)
        self.content, self.series = _content(run), run.series
        self.frames = list(run.frames)
        self.provenance = gio.describe(self.path)["provenance"]
        self.counts: Counter[str] = Counter()

    def read(self, content: bytes | bytearray) -> str:
        """Read a damaged copy; anything different fails.

        Returns:
            ``same``, ``refused``, ``some frames`` (others are refused when they are asked for)
            or ``shorter`` (with a warning).
        """
        self.path.write_bytes(content)
        started = time.perf_counter()
        with warnings.catch_warnings(record=True) as shown:
            warnings.simplefilter("always")
            try:
                outcome = self._compared()
            except GranufabError as error:
                self._check(error)
                outcome = "refused"
        warned = [one for one in shown if issubclass(one.category, IncompleteFile)]
        assert len(warned) == len(shown), [str(one.message) for one in shown]
        assert outcome != "shorter" or warned
        assert time.perf_counter() - started < LONGEST
        self.counts[outcome] += 1
        return outcome

    def _compared(self) -> str:
        run = gio.read(self.path)
        rows = run.series.sizes["record"]
        assert rows <= 3 and len(run.frames) <= len(self.frames)
        if rows and run.summary:
            assert _content(run) == self.content
        assert run.settings == self.content[1]
        assert run.summary in (self.content[2], {})
        assert run.series.assign_attrs({}).equals(
            self.series.isel(record=slice(rows)).assign_attrs({})
        )
        assert gio.describe(self.path)["provenance"] == self.provenance
        outcome = "same"
        for index in range(len(run.frames)):
            try:
                frame = run.frames[index]
            except GranufabError as error:
                self._check(error)
                outcome = "some frames"
                continue
            assert_same_frame(frame, self.frames[index])
        short = len(run.frames) < len(self.frames) or rows < 3 or run.summary != self.content[2]
        return "shorter" if short else outcome

    def _check(self, error: GranufabError) -> None:
        assert isinstance(error, CorruptFile | UnknownFormat)
        assert "\n" not in str(error) and str(self.path) in str(error)


def _mutations(outcomes: Outcomes, count: int, seed: int) -> None:
    """Change one byte, or several, anywhere or among the bytes that are not zero."""
    rng = np.random.default_rng(seed)
    whole = outcomes.whole
    used = np.flatnonzero(np.frombuffer(whole, np.uint8))
    for trial in range(count):
        bad = bytearray(whole)
        size = 1 if trial % 2 else int(rng.integers(2, 9))
        places = rng.choice(used, size) if trial % 4 else rng.integers(0, len(whole), size)
        for place in places:
            bad[place] ^= int(rng.integers(1, 256))
        outcomes.read(bad)


def test_mutations_are_never_silent(file: Path, tell: Callable[..., None]) -> None:
    outcomes = Outcomes(file)
    _mutations(outcomes, 100, 9)
    tell(**outcomes.counts)
    assert outcomes.counts["same"] < 70
    assert outcomes.counts["refused"] + outcomes.counts["some frames"] > 30


@pytest.mark.slow
def test_many_mutations_are_never_silent(file: Path, tell: Callable[..., None]) -> None:
    outcomes = Outcomes(file)
    _mutations(outcomes, 700, 10)
    tell(**outcomes.counts)


def test_truncations_open_to_what_is_there(file: Path, tell: Callable[..., None]) -> None:
    outcomes = Outcomes(file)
    length = len(outcomes.whole)
    for size in np.linspace(0, length - 1, 60).astype(int):
        outcomes.read(outcomes.whole[:size])
    tell(**outcomes.counts)
    assert outcomes.counts["same"] <= (0 if outcomes.content[2] else 3)
    assert outcomes.counts["refused"] > 0
    assert outcomes.counts["shorter"] > 3


@pytest.mark.slow
def test_many_truncations_open_to_what_is_there(file: Path, tell: Callable[..., None]) -> None:
    outcomes = Outcomes(file)
    for size in np.random.default_rng(3).integers(0, len(outcomes.whole), 400):
        outcomes.read(outcomes.whole[:size])
    tell(**outcomes.counts)


def test_every_byte_of_the_small_numbers_is_covered(file: Path, tell: Callable[..., None]) -> None:
    """Each stored number without HDF5's own checksum, changed, is told or changes nothing."""
    outcomes = Outcomes(file)
    places = []
    with h5py.File(file.with_name("live.h5")) as live:
        names: list[str] = []
        live.visit(names.append)
        for name in names:
            data = live[name]
            if not isinstance(data, h5py.Dataset) or data.fletcher32:
                continue
            if data.chunks is None:
                start = data.id.get_offset()
                stop = start + data.nbytes if data.nbytes <= 8 else start + 16
                places += [(name, start), (name, stop - 1), (name, stop - 3)]
            elif data.id.get_num_chunks():
                start, row = data.id.get_chunk_info(0).byte_offset, data[0:1].nbytes
                places += [(name, start + 1), (name, start + row), (name, start + 2 * row - 1)]
    told = 0
    places = places[::4]
    for _name, place in places:
        bad = bytearray(outcomes.whole)
        bad[place] ^= 0x11
        told += outcomes.read(bad) != "same"
    tell(places=len(places), **outcomes.counts)
    assert told > 0.6 * len(places)


def test_checking_agrees_with_reading(file: Path) -> None:
    """``check`` finds a fault wherever reading does, and none in a sound file."""
    outcomes = Outcomes(file)
    assert check_file(outcomes.path).faults == ()
    rng = np.random.default_rng(5)
    for _ in range(25):
        bad = bytearray(outcomes.whole)
        for place in rng.integers(8, len(bad), 12):
            bad[place] ^= int(rng.integers(1, 256))
        outcome = outcomes.read(bad)
        try:
            faults = check_file(outcomes.path).faults
        except UnknownFormat:
            assert outcome == "refused"
            continue
        assert bool(faults) == (outcome != "same"), (outcome, faults)


def test_version_one_stays_readable(file: Path, frames: list[Frame]) -> None:
    path = file.with_name("one.h5")
    shutil.copy(file.with_name("live.h5"), path)
    expected = gio.read(path)
    make_version_one(path)
    run = gio.read(path)
    assert gio.describe(path)["schema_version"] == 1
    assert _content(run) == _content(expected)
    assert run.series.equals(expected.series)
    for got, wanted in zip(run.frames, frames, strict=True):
        assert_same_frame(got, wanted)
    report = check_file(path)
    assert report.faults == () and "no checksums" in report.notes[0]
    with h5py.File(path, "r+") as one:
        one["series/z"][0] += 1
    assert float(gio.read(path).series["z"][0]) == float(expected.series["z"][0]) + 1


def test_a_column_that_an_earlier_granufab_did_not_write_is_nan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    row = random_row(np.random.default_rng(1))
    with RunFileWriter(path, settings={}) as writer:
        writer.row(row)
    with h5py.File(path, "r+") as file:
        del file["series/phi"]
        from granufab.io.run_file_checksum import row_checksums

        columns = {f"series/{name}": file[f"series/{name}"][:] for name in [*row] if name != "phi"}
        file["series/checksum"][:] = row_checksums(columns, 0)
    run = gio.read(path)
    assert np.isnan(run.series["phi"]).all()
    assert float(run.series["z"][0]) == row["z"]


def test_a_checksum_depends_on_each_value(frames: list[Frame]) -> None:
    """A frame's checksum depends on its index and on each value."""
    from granufab.io.run_file_checksum import frame_checksum
    from granufab.io.stored_frame import stored_frame

    values = stored_frame(frames[0])
    right = frame_checksum(0, values)
    assert right != frame_checksum(1, values)
    for name, value in values.items():
        if value.size == 0:
            continue
        changed = np.array(value)
        changed.reshape(-1).view(np.uint8)[0] ^= 1
        assert frame_checksum(0, {**values, name: changed}) != right, name


def test_long_texts_come_back_and_lie_in_no_heap(tmp_path: Path) -> None:
    settings = {"name": "x", "note": "µ" * 100_000}
    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings=settings) as writer:
        writer.row({"z": 4.0})
    assert gio.read(path).settings == settings
    assert b"GCOL" not in path.read_bytes()


READ = "import sys, granufab.io as gio\ntry: gio.read(sys.argv[1])\nexcept OSError: print(1)"


@pytest.mark.parametrize("damage", ["longer", "free piece of no length", "cut"])
def test_a_damaged_heap_of_version_one_does_not_hang(file: Path, damage: str) -> None:
    """HDF5 alone turns in it without end, so that it is tried in a process that can be ended."""
    path = file.with_name("heap.h5")
    shutil.copy(file.with_name("live.h5"), path)
    make_version_one(path)
    content = bytearray(path.read_bytes())
    place = content.index(b"GCOL\x01")
    size = int.from_bytes(content[place + 8 : place + 16], "little")
    assert size >= 4096
    assert heaps_are_sound(path)
    if damage == "longer":
        content += bytes(65536)
        content[place + 8 : place + 16] = (len(content) - place).to_bytes(8, "little")
    elif damage == "cut":
        content[place + 8 : place + 16] = (512).to_bytes(8, "little")
    else:
        content[place + 16 : place + 32] = bytes(16)
    path.write_bytes(content)
    assert not heaps_are_sound(path)
    done = subprocess.run(
        [sys.executable, "-c", READ, str(path)], capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "1"
