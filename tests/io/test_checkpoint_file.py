"""Checkpoints come back bit for bit, or the one before does, whatever happens to the file."""

from __future__ import annotations

import errno
import json
import os
import struct
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as numpy_st

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.io import read_checkpoint, write_checkpoint
from granufab.io.checkpoint_file import Checkpoint, previous_of, verify_checkpoint

KINDS = (
    numpy_st.boolean_dtypes()
    | numpy_st.integer_dtypes(endianness="?")
    | numpy_st.floating_dtypes(endianness="?")
    | numpy_st.complex_number_dtypes()
    | numpy_st.unicode_string_dtypes(max_len=5)
    | numpy_st.datetime64_dtypes()
    | st.just(np.dtype([("id", "<i4"), ("force", "<f8", (3,))]))
)
SHAPES = numpy_st.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=6)


class CrashError(BaseException):
    """The process ends here: nothing behind it runs but what a crash would leave."""


def _arrays(number: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(number)
    return {"impulse": rng.standard_normal((40, 2)), "pair": rng.integers(0, 99, (40, 2))}


def _is(found: Checkpoint, number: int) -> bool:
    wanted = _arrays(number)
    return (
        found.notes == {"number": number}
        and list(found.arrays) == list(wanted)
        and all(found.arrays[name].tobytes() == wanted[name].tobytes() for name in wanted)
        and all(found.arrays[name].dtype == wanted[name].dtype for name in wanted)
        and all(found.arrays[name].shape == wanted[name].shape for name in wanted)
    )


@pytest.fixture
def two(tmp_path: Path) -> Path:
    """Checkpoint 2, with 1 before it."""
    path = tmp_path / "run.checkpoint"
    for number in (1, 2):
        write_checkpoint(path, _arrays(number), {"number": number})
    return path


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    arrays=st.dictionaries(st.text(max_size=6), numpy_st.arrays(KINDS, SHAPES), max_size=4),
    turned=st.booleans(),
)
def test_any_array_comes_back_bit_for_bit(
    tmp_path: Path, arrays: dict[str, np.ndarray], turned: bool
) -> None:
    if turned:
        arrays = {
            name: array.T[..., ::-1] if array.ndim else array for name, array in arrays.items()
        }
    path = tmp_path / "c"
    write_checkpoint(path, arrays, {})
    found = read_checkpoint(path)
    assert found.warning is None
    assert list(found.arrays) == list(arrays)
    for name, wanted in arrays.items():
        got = found.arrays[name]
        assert (got.dtype, got.shape) == (wanted.dtype, wanted.shape)
        assert got.tobytes() == wanted.tobytes()
        assert got.flags.writeable
    verify_checkpoint(path)


def test_notes_come_back(tmp_path: Path) -> None:
    notes = {"step": 7, "t": 0.1 + 0.2, "big": float("inf"), "é": [None, True, {"x": "y"}]}
    write_checkpoint(tmp_path / "c", {}, {**notes, "count": np.int64(3), "where": (1, 2)})
    assert read_checkpoint(tmp_path / "c").notes == {**notes, "count": 3, "where": [1, 2]}


def test_objects_are_refused_and_nothing_is_touched(two: Path) -> None:
    for arrays, notes in (({"x": np.array([{}])}, {}), ({}, {"x": object()})):
        with pytest.raises(InvalidSettings):
            write_checkpoint(two, arrays, notes)
    assert _is(read_checkpoint(two), 2)
    assert sorted(one.name for one in two.parent.iterdir()) == [two.name, f"{two.name}.previous"]


def test_the_one_before_is_kept_and_used(two: Path) -> None:
    assert _is(read_checkpoint(two), 2)
    assert _is(read_checkpoint(previous_of(two)), 1)
    two.write_bytes(two.read_bytes()[:-1])
    found = read_checkpoint(two)
    assert _is(found, 1)
    assert found.warning is not None and "declares" in found.warning and "\n" not in found.warning
    two.unlink()
    found = read_checkpoint(two)
    assert _is(found, 1) and found.warning is not None and "no such file" in found.warning
    previous_of(two).write_bytes(b"x")
    with pytest.raises(CorruptFile, match="not that of a checkpoint"):
        read_checkpoint(two)
    previous_of(two).unlink()
    with pytest.raises(MissingData, match="no checkpoint"):
        read_checkpoint(two)


@contextmanager
def _failing(
    monkeypatch: pytest.MonkeyPatch, name: str, call: int, error: BaseException, early: bool
) -> Iterator[list[str]]:
    """Let the n-th call of a function of ``os`` fail, before or after it has worked."""
    done: list[str] = []
    real = getattr(os, name)

    def failing(*arguments: Any, **options: Any) -> Any:
        done.append(name)
        if len(done) == call and early:
            raise error
        result = real(*arguments, **options)
        if len(done) == call:
            raise error
        return result

    with monkeypatch.context() as patch:
        patch.setattr(os, name, failing)
        yield done


STEPS = (("fsync", 1), ("replace", 1), ("replace", 2), ("fsync", 2))


@pytest.mark.parametrize("early", [True, False])
@pytest.mark.parametrize("step", STEPS, ids=str)
@pytest.mark.parametrize(
    "error", [CrashError(), OSError(errno.EIO, "failed")], ids=["crash", "error"]
)
def test_a_crash_at_any_step_leaves_a_valid_checkpoint(
    two: Path,
    monkeypatch: pytest.MonkeyPatch,
    step: tuple[str, int],
    error: BaseException,
    early: bool,
) -> None:
    raised = CrashError if isinstance(error, CrashError) else OSError
    with (
        _failing(monkeypatch, *step, error, early) as done,
        pytest.raises(raised),
    ):
        write_checkpoint(two, _arrays(3), {"number": 3})
    assert len(done) == step[1]
    found = read_checkpoint(two)
    replaced = STEPS.index(step) > 2 or (step == ("replace", 2) and not early)
    assert _is(found, 3 if replaced else 2)
    write_checkpoint(two, _arrays(4), {"number": 4})
    assert _is(read_checkpoint(two), 4)
    assert sorted(one.name for one in two.parent.iterdir()) == [two.name, f"{two.name}.previous"]


@pytest.mark.parametrize("after", [0, 10, 16, 40, 100, 900, 1500])
def test_a_crash_inside_the_write(two: Path, after: int) -> None:
    """What a killed process leaves of the temporary file does not matter."""
    whole = two.read_bytes()
    two.with_name(f".{two.name}.tmp").write_bytes(whole[:after])
    assert _is(read_checkpoint(two), 2)
    write_checkpoint(two, _arrays(3), {"number": 3})
    assert _is(read_checkpoint(two), 3)
    assert sorted(one.name for one in two.parent.iterdir()) == [two.name, f"{two.name}.previous"]


def test_a_full_disk_is_told_and_keeps_the_one_before(
    two: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    with (
        _failing(monkeypatch, "fsync", 1, full, True),
        pytest.raises(OSError, match=r"No space left.*one before is kept") as caught,
    ):
        write_checkpoint(two, _arrays(3), {"number": 3})
    assert caught.value.filename == str(two)
    assert _is(read_checkpoint(two), 2)


def _damaged(two: Path, content: bytes) -> str:
    """``previous`` or ``refused``; anything else fails."""
    two.write_bytes(content)
    with pytest.raises(CorruptFile) as caught:
        verify_checkpoint(two)
    assert "\n" not in str(caught.value) and str(two) in str(caught.value)
    found = read_checkpoint(two)
    assert found.warning is not None
    assert _is(found, 1)
    return "previous"


def test_truncations_and_mutations_never_give_other_data(
    two: Path, tell: Callable[..., None]
) -> None:
    whole = two.read_bytes()
    rng = np.random.default_rng(4)
    told = [_damaged(two, whole[:size]) for size in rng.integers(0, len(whole), 200)]
    for _ in range(200):
        bad = bytearray(whole)
        for position in rng.integers(0, len(bad), int(rng.integers(1, 4))):
            bad[position] ^= int(rng.integers(1, 256))
        if bytes(bad) != whole:
            told.append(_damaged(two, bytes(bad)))
    two.write_bytes(whole)
    assert _is(read_checkpoint(two), 2)
    previous_of(two).unlink()
    two.write_bytes(whole[:-3])
    with pytest.raises(CorruptFile):
        read_checkpoint(two)
    tell(damaged=len(told))


def _with_header(change: Callable[[dict[str, Any]], None]) -> bytes:
    """A checkpoint of one array with another header, its sizes and checksum made to fit."""
    import hashlib

    content: dict[str, Any] = {"notes": {}, "arrays": [["x", "'<f8'", [2]]]}
    change(content)
    header = json.dumps(content).encode()
    size = 16 + 16 + len(header) + 16 + 32
    body = b"granufab-ckpt-1\n" + struct.pack("<QQ", len(header), size) + header + bytes(16)
    return body + hashlib.sha256(body).digest()


HOSTILE: dict[str, Callable[[dict[str, Any]], None]] = {
    "huge": lambda c: c["arrays"][0].__setitem__(2, [10**12]),
    "product": lambda c: c["arrays"][0].__setitem__(2, [2**40, 2**40]),
    "negative": lambda c: c["arrays"][0].__setitem__(2, [-2, -1]),
    "empty but wide": lambda c: c["arrays"][0].__setitem__(2, [0, 2**63]),
    "object": lambda c: c["arrays"][0].__setitem__(1, "'|O'"),
    "code": lambda c: c["arrays"][0].__setitem__(1, "__import__('os').getcwd()"),
    "nested": lambda c: c["arrays"][0].__setitem__(1, "[" * 10**5),
    "shape text": lambda c: c["arrays"][0].__setitem__(2, "22"),
    "name list": lambda c: c["arrays"][0].__setitem__(0, []),
    "no notes": lambda c: c.pop("notes"),
    "deep notes": lambda c: c["arrays"].extend([[]]),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_headers_are_refused_without_memory(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "c"
    path.write_bytes(_with_header(lambda c: None))
    assert read_checkpoint(path).arrays["x"].tolist() == [0, 0]
    path.write_bytes(_with_header(HOSTILE[kind]))
    tracemalloc.start()
    try:
        with pytest.raises(CorruptFile) as caught:
            read_checkpoint(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert peak < 8 * path.stat().st_size + 100_000


def test_arrays_are_not_copied(tmp_path: Path) -> None:
    arrays = {"c": np.zeros((2000, 1000)), "turned": np.zeros((1000, 2000)).T}
    tracemalloc.start()
    try:
        write_checkpoint(tmp_path / "c", arrays, {})
        written = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        read_checkpoint(tmp_path / "c")
        read = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert written < 4e6
    assert read < 32e6 + 4e6


def test_a_first_checkpoint_that_was_cut_short_is_no_checkpoint(tmp_path: Path) -> None:
    """A process that dies in its first write leaves a temporary file only."""
    path = tmp_path / "checkpoint"
    write_checkpoint(path, {"a": np.arange(100.0)}, {})
    content = path.read_bytes()
    path.unlink()
    path.with_name(".checkpoint.tmp").write_bytes(content[: len(content) // 2])
    with pytest.raises(MissingData, match="no checkpoint"):
        read_checkpoint(path)
    path.with_name(".checkpoint.tmp").write_bytes(content)  # it died before the rename
    assert (read_checkpoint(path).arrays["a"] == np.arange(100.0)).all()
