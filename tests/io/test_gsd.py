"""GSD: a file laid out by hand from its description, defaults, tilts, damage."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.errors import GranufabError, UnknownFormat

NAMES = (
    *("configuration/step", "configuration/dimensions", "configuration/box", "particles/N"),
    *("particles/position", "particles/diameter", "particles/mass"),
)
PLACE = np.random.default_rng(3).uniform(-3, 3, (3, 6, 3)).astype("f4")
DIAMETER = np.linspace(0.8, 1.0, 6, dtype="f4")


def _file(path: Path, *, dimensions: int = 3, frames: int = 3, schema: bytes = b"hoomd") -> Path:
    """Header, name list, chunks, index at the end; diameters in frame 0 only."""
    names = b"".join(name.encode() + b"\0" for name in NAMES).ljust(256, b"\0")
    data, entries = b"", []

    def put(frame: int, name: str, kind: int, values: np.ndarray) -> None:
        nonlocal data
        rows, columns = (*values.shape, 1)[:2]
        place = 512 + len(data)
        number = NAMES.index(f"{name}")
        entries.append(struct.pack("<QQqIHBB", frame, rows, place, columns, number, kind, 0))
        data += values.tobytes()

    for frame in range(frames):
        place = PLACE[frame].copy()
        place[:, 2] *= dimensions == 3
        put(frame, NAMES[0], 4, np.array([10 * frame], "u8"))
        if frame == 0:
            put(frame, NAMES[1], 1, np.array([dimensions], "u1"))
            put(frame, NAMES[3], 3, np.array([6], "u4"))
            put(frame, NAMES[5], 9, DIAMETER)
        put(frame, NAMES[2], 9, np.array([8 + frame, 8, 8, 0.25, 0, 0], "f4"))
        put(frame, NAMES[4], 9, place)
    head = struct.pack(
        "<QQQQQII64s64s80s", 0x65DF65DF65DF65DF, 512 + len(data), len(entries) + 2, 256, 4,
        (1 << 16) | 4, 2 << 16, b"test", schema, b"",
    )  # fmt: skip
    path.write_bytes(head + names + data + b"".join(entries) + bytes(64))
    return path


def test_three_frames_in_a_tilted_box(tmp_path: Path) -> None:
    run = granufab.read(_file(tmp_path / "a.gsd"))
    assert len(run.frames) == 3
    for frame in range(3):
        packing = run.frames[frame].packing
        np.testing.assert_array_equal(packing.grains.position, PLACE[frame].astype(float))
        np.testing.assert_array_equal(packing.grains.radius, DIAMETER.astype(float) / 2)
        assert packing.cell is not None
        matrix = np.diag([8.0 + frame, 8, 8])
        matrix[0, 1] = 2.0
        np.testing.assert_allclose(packing.cell.matrix, matrix)
        np.testing.assert_allclose(packing.cell.origin, -matrix.sum(axis=1) / 2)
    assert run.frames[2].strain[0, 0] == pytest.approx(-np.log(10 / 8), abs=0.02)


def test_flat_data(tmp_path: Path) -> None:
    packing = granufab.read(_file(tmp_path / "a.gsd", dimensions=2)).frames[0].packing
    assert packing.dimension == 2
    assert packing.cell is not None
    np.testing.assert_allclose(packing.cell.matrix, [[8, 2], [0, 8]])


def test_another_schema(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormat, match="schema"):
        granufab.read(_file(tmp_path / "a.gsd", schema=b"other"))


@pytest.mark.parametrize("place", [8, 16, 24, 32])
def test_counts_are_not_trusted(tmp_path: Path, place: int) -> None:
    path = _file(tmp_path / "a.gsd")
    data = bytearray(path.read_bytes())
    data[place : place + 8] = struct.pack("<Q", 2**62)
    path.write_bytes(data)
    with pytest.raises(GranufabError, match=r"a\.gsd"):
        granufab.read(path)
