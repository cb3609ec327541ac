"""GSD, HOOMD-blue's binary file: an index of named chunks, a frame's missing ones as in frame 0.

Header (256 bytes): magic, index place and size, name list place and size, versions. Index entries
(32 bytes): frame, rows, place, columns, name, type. The box Lx Ly Lz xy xz yz is centred at the
origin. Positions are float32, so gaps are good to about 1e-7 of the box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, UnknownFormat
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.packing import Array

__all__ = ["FORMAT"]

MAGIC = 0x65DF65DF65DF65DF
HEADER = np.dtype(
    [("magic", "<u8"), ("index", "<u8"), ("entries", "<u8"), ("names", "<u8"),
     ("name_entries", "<u8"), ("schema_version", "<u4"), ("version", "<u4"),
     ("application", "S64"), ("schema", "S64"), ("reserved", "V80")]
)  # fmt: skip
ENTRY = np.dtype(
    [("frame", "<u8"), ("rows", "<u8"), ("place", "<i8"), ("columns", "<u4"), ("name", "<u2"),
     ("type", "u1"), ("flags", "u1")]
)  # fmt: skip
TYPES = {1: "<u1", 2: "<u2", 3: "<u4", 4: "<u8", 5: "<i1", 6: "<i2", 7: "<i4", 8: "<i8",
         9: "<f4", 10: "<f8", 11: "<u1"}  # fmt: skip
NOTE = "positions and radii only, in single precision: contacts are found by gap"


def _matches(path: Path, head: bytes) -> bool:
    return head[:8] == MAGIC.to_bytes(8, "little")


@dataclass(frozen=True, slots=True)
class _Index:
    """Chunks of a file by frame and name."""

    path: Path
    frames: int
    chunks: dict[tuple[int, str], np.void]
    cut: bool

    def read(self, frame: int, name: str) -> NDArray | None:
        """A chunk of a frame, else of the first frame, shape (rows, columns); None: neither."""
        entry = self.chunks.get((frame, name))
        if entry is None:
            entry = self.chunks.get((0, name))
        if entry is None:
            return None
        dtype = np.dtype(TYPES[int(entry["type"])])
        shape = int(entry["rows"]), int(entry["columns"])
        with self.path.open("rb") as stream:
            stream.seek(int(entry["place"]))
            data = stream.read(shape[0] * shape[1] * dtype.itemsize)
        return np.frombuffer(data, dtype).reshape(shape)


def _index(path: Path) -> _Index:
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = np.frombuffer(stream.read(HEADER.itemsize).ljust(HEADER.itemsize, b"\0"), HEADER)[0]
        major = int(head["version"]) >> 16
        if major not in (1, 2):
            raise UnknownFormat(f"{path}: is GSD of version {major}, read are 1 and 2")
        if bytes(head["schema"]) != b"hoomd":
            raise UnknownFormat(f"{path}: is GSD of schema {head['schema']!r}, read is hoomd")
        blocks = []
        for place, count, width in (
            (int(head["index"]), int(head["entries"]), ENTRY.itemsize),
            (int(head["names"]), int(head["name_entries"]), 64),
        ):
            if place < HEADER.itemsize or place + count * width > size:
                raise CorruptFile(
                    f"{path}: is truncated or damaged, its index ends at byte "
                    f"{place + count * width} of {size}"
                )
            stream.seek(place)
            blocks.append(stream.read(count * width))
    entries = np.frombuffer(blocks[0], ENTRY)
    ends = np.flatnonzero(entries["place"] == 0)
    entries = entries[: ends[0]] if len(ends) else entries
    return _checked(path, size, entries, _names(blocks[1], major))


def _names(block: bytes, major: int) -> list[str]:
    parts = block.split(b"\0") if major == 2 else [
        block[k : k + 64].split(b"\0")[0] for k in range(0, len(block), 64)
    ]  # fmt: skip
    count = parts.index(b"") if b"" in parts else len(parts)
    return [part.decode("utf-8", "replace") for part in parts[:count]]


def _checked(path: Path, size: int, entries: NDArray, names: list[str]) -> _Index:
    """Frames whose chunks all lie inside the file."""
    chunks: dict[tuple[int, str], np.void] = {}
    frames = int(entries["frame"].max()) + 1 if len(entries) else 0
    if frames > len(entries) + 1:
        late = int(np.argmax(entries["frame"]))
        raise CorruptFile(
            f"{path}: item {late} of the index is of frame {frames - 1}, but {len(entries)} chunks "
            "cannot make so many"
        )
    whole = frames
    for entry in entries:
        frame, kind, name = int(entry["frame"]), int(entry["type"]), int(entry["name"])
        if kind not in TYPES or name >= len(names):
            raise CorruptFile(
                f"{path}: frame {frame} has a chunk of type {kind}, name {name} of {len(names)}"
            )
        length = int(entry["rows"]) * int(entry["columns"]) * np.dtype(TYPES[kind]).itemsize
        if not 0 < int(entry["place"]) <= size - length:
            whole = min(whole, frame)
        chunks[frame, names[name]] = entry
    if whole == 0:
        raise CorruptFile(
            f"{path}: is truncated or damaged, frame 0 is not complete in its {size} bytes"
        )
    return _Index(path, whole, chunks, whole < frames)


def _frame(index: _Index, frame: int) -> FoundFrame:
    place = f"{index.path}: frame {frame}"
    count = index.read(frame, "particles/N")
    position = index.read(frame, "particles/position")
    if count is None or count.size != 1 or position is None or position.shape[1] != 3:
        raise CorruptFile(f"{place}: particles/N or particles/position are missing or misshapen")
    if len(position) != int(count[0, 0]):
        raise CorruptFile(f"{place}: has {len(position)} positions, expected {int(count[0, 0])}")
    diameter = _per_grain(index, frame, "particles/diameter", len(position), 1)
    mass = _per_grain(index, frame, "particles/mass", len(position), 1)
    dimensions, step = (
        index.read(frame, f"configuration/{name}") for name in ("dimensions", "step")
    )
    flat = dimensions is not None and dimensions.size == 1 and int(dimensions[0, 0]) == 2
    return FoundFrame(
        place=place,
        position=position.astype(float),
        radius=np.full(len(position), 0.5) if diameter is None else diameter[:, 0] / 2,
        mass=None if mass is None else mass[:, 0],
        velocity=_per_grain(index, frame, "particles/velocity", len(position), 3),
        dimension=2 if flat else 3,
        cell=_cell(index, frame, place, flat),
        step=int(step[0, 0]) if step is not None and step.size == 1 else None,
    )


def _per_grain(index: _Index, frame: int, name: str, rows: int, columns: int) -> Array | None:
    """A chunk with a row for each grain; None: all have the default."""
    values = index.read(frame, name)
    if values is None:
        return None
    if values.shape != (rows, columns):
        if (frame, name) not in index.chunks:
            return None  # frame 0 had another number of grains: its values are not theirs
        raise CorruptFile(
            f"{index.path}: frame {frame}: {name} has shape {values.shape}, expected "
            f"{(rows, columns)}"
        )
    return values.astype(float)


def _cell(index: _Index, frame: int, place: str, flat: bool) -> FoundCell | None:
    box = index.read(frame, "configuration/box")
    if box is None:
        return None
    if box.size != 6 or not np.isfinite(box).all():
        raise CorruptFile(f"{place}: configuration/box has {box.size} numbers, expected 6")
    lx, ly, lz, xy, xz, yz = box.astype(float).ravel()
    matrix = np.array([[lx, xy * ly, xz * lz], [0.0, ly, yz * lz], [0.0, 0.0, lz]])
    if flat:
        matrix = matrix[:2, :2]
    return FoundCell(
        matrix=matrix, origin=-0.5 * matrix.sum(axis=1), periodic=(True,) * len(matrix)
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    indices = [_index(path) for path in paths]
    places = [(index, frame) for index in indices for frame in range(index.frames)]
    cut = [f"{index.path}: read up to its last complete frame" for index in indices if index.cut]
    return LazyFrames(count=len(places), parse=lambda k: _frame(*places[k]), notes=(NOTE, *cut))


FORMAT = ForeignFormat(key="gsd", name="GSD (HOOMD-blue)", matches=_matches, open=_open)
"""Trajectories of HOOMD-blue."""
