"""Legacy VTK files of points with values: ASCII and binary, versions 1 to 5.

Read are the points and lines of POLYDATA and UNSTRUCTURED_GRID and the arrays of POINT_DATA,
CELL_DATA and FIELD; cells of other kinds are passed over.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.text_rows import number_fault
from granufab.packing import Array, IntArray

__all__ = ["VtkPoints", "is_legacy_vtk", "read_legacy_vtk"]

_TYPES = {
    "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2",
    "unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8",
    "vtktypeint64": "i8", "vtktypeuint64": "u8", "vtkIdType": "i4", "float": "f4", "double": "f8",
}  # fmt: skip
_CELLS = ("VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS", "CELLS")
_WIDTHS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9}
_NEXT_WORD = re.compile(rb"\n[ \t]*(?!nan|inf|NaN|Inf|NAN|INF)[A-Za-z_]")


@dataclass(slots=True, kw_only=True)
class VtkPoints:
    """Points of a file and their values.

    Attributes:
        position: shape (point_count, 3).
        lines: points at the ends of each cell, if all cells have two, shape (cell_count, 2).
        data: of the points by name, shape (point_count, components).
        cells: of the cells by name, shape (cell_count, components).
        field: of the whole data set by name.
    """

    position: Array = field(default_factory=lambda: np.zeros((0, 3)))
    lines: IntArray = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    data: dict[str, Array] = field(default_factory=dict)
    cells: dict[str, Array] = field(default_factory=dict)
    field: dict[str, Array] = field(default_factory=dict)


def is_legacy_vtk(head: bytes) -> bool:
    """Whether a file of points begins so."""
    kinds = (b"POLYDATA", b"UNSTRUCTURED_GRID")
    return head.startswith(b"# vtk DataFile") and any(b"DATASET " + kind in head for kind in kinds)


def read_legacy_vtk(path: Path) -> VtkPoints:
    """Read a file.

    Raises:
        CorruptFile: it ends early or has a section of no known kind; names the place.
    """
    text = _Text(path)
    for _ in range(2):
        text.line()
    encoding = text.line()
    if encoding not in ("ASCII", "BINARY"):
        raise text.wrong(f"{encoding[:40]!r}, expected ASCII or BINARY")
    text.binary = encoding == "BINARY"
    if text.line().split()[:1] != ["DATASET"]:
        raise text.wrong("line 4 is no DATASET")
    found, owner = VtkPoints(), "field"
    while text.more():
        owner = _section(text, found, owner)
    if not text.points:
        raise text.wrong("no POINTS up to the end")
    return found


def _section(text: _Text, found: VtkPoints, owner: str) -> str:
    """Read one section; whose the arrays after it are: points', cells' or the data set's."""
    words = text.line().split()
    word = words[0]
    if word == "POINTS":
        count = text.whole(words, 1)
        text.points = True
        found.position = text.values(3 * count, words[2] if len(words) > 2 else "").reshape(-1, 3)
    elif word in _CELLS:
        lines = _read_cells(text, text.whole(words, 1), text.whole(words, 2))
        if word in ("LINES", "CELLS"):
            found.lines = lines
    elif word == "CELL_TYPES":
        text.values(text.whole(words, 1), "int")
    elif word in ("POINT_DATA", "CELL_DATA"):
        text.items = text.whole(words, 1)
        if word == "POINT_DATA" and text.items != len(found.position):
            raise text.wrong(f"POINT_DATA {text.items}, but there are {len(found.position)} points")
        return word
    elif word == "METADATA":
        text.skip_paragraph()
    elif word == "FIELD":
        _read_field(text, found, owner, text.whole(words, 2))
    else:
        _attribute(text, found, owner, words)
    return owner


def _read_cells(text: _Text, count: int, size: int) -> IntArray:
    """The points of the cells, shape (cell_count, 2); none where a cell has other than two."""
    none = np.zeros((0, 2), np.int64)
    if text.peek().startswith("OFFSETS"):
        offsets, joined = (text.values(n, text.line().split()[-1]) for n in (count, size))
        pairs = len(joined) == 2 * (count - 1) and (np.diff(offsets) == 2).all()
        return joined.astype(np.int64).reshape(-1, 2) if pairs else none
    table = text.values(size, "int")
    if size != 3 * count or (table[::3] != 2).any():
        return none
    return table.reshape(-1, 3)[:, 1:].astype(np.int64)


def _read_field(text: _Text, found: VtkPoints, owner: str, arrays: int) -> None:
    for _ in range(arrays):
        while (words := text.line().split())[0] == "METADATA":
            text.skip_paragraph()
        width, rows = text.whole(words, 1), text.whole(words, 2)
        values = text.values(width * rows, words[3] if len(words) > 3 else "")
        if owner == "POINT_DATA":
            if rows != len(found.position) or width == 0:
                raise text.wrong(f"{words[0]} has {rows} rows, there are {len(found.position)}")
            found.data[words[0]] = values.reshape(rows, width)
        elif owner == "CELL_DATA":
            if rows != text.items or width == 0:
                raise text.wrong(f"{words[0]} has {rows} rows, there are {text.items} cells")
            found.cells[words[0]] = values.reshape(rows, width)
        elif owner == "field":
            found.field[words[0]] = values


def _attribute(text: _Text, found: VtkPoints, owner: str, words: list[str]) -> None:
    """SCALARS, VECTORS, NORMALS, TENSORS or LOOKUP_TABLE."""
    if words[0] == "LOOKUP_TABLE":
        text.values(4 * text.whole(words, 2), "float" if not text.binary else "unsigned_char")
        return
    if (words[0] != "SCALARS" and words[0] not in _WIDTHS) or len(words) < 3 or owner == "field":
        raise text.wrong(f"unknown section {' '.join(words)[:40]!r}")
    width = _WIDTHS.get(words[0]) or (text.whole(words, 3) if len(words) > 3 else 1)
    if words[0] == "SCALARS" and text.peek().startswith("LOOKUP_TABLE"):
        text.line()
    values = text.values(width * text.items, words[2])
    if width:
        arrays = found.data if owner == "POINT_DATA" else found.cells
        arrays[words[1]] = values.reshape(-1, width)


class _Text:
    """A place in a file's bytes."""

    def __init__(self, path: Path) -> None:
        self.path, self.bytes, self.at = path, path.read_bytes(), 0
        self.binary, self.items, self.points = False, 0, False

    def wrong(self, what: str) -> CorruptFile:
        return CorruptFile(f"{self.path}: byte {self.at}: {what}")

    def more(self) -> bool:
        while self.at < len(self.bytes) and self.bytes[self.at : self.at + 1].isspace():
            self.at += 1
        return self.at < len(self.bytes)

    def line(self) -> str:
        """The next line that is not blank."""
        if not self.more():
            raise self.wrong("the file ends early")
        end = self.bytes.find(b"\n", self.at)
        if end < 0:
            raise self.wrong("the file ends within a line")
        line = self.bytes[self.at : min(end, self.at + 1000)].decode(errors="replace")
        self.at = end + 1
        return line.strip()

    def peek(self) -> str:
        start = self.at
        line = self.line()
        self.at = start
        return line

    def skip_paragraph(self) -> None:
        end = self.bytes.find(b"\n\n", self.at - 1)
        self.at = len(self.bytes) if end < 0 else end + 2

    def whole(self, words: list[str], place: int) -> int:
        """A whole number in a section's line, no larger than the file."""
        text = words[place] if place < len(words) else ""
        if not (text.isascii() and text.isdigit() and len(text) < 16):
            raise self.wrong(f"{' '.join(words)[:60]!r} has no whole number at word {place + 1}")
        if int(text) > len(self.bytes):
            raise self.wrong(f"{' '.join(words)[:60]!r} is more than the file can hold")
        return int(text)

    def values(self, count: int, kind: str) -> Array:
        if kind not in _TYPES:
            raise self.wrong(f"values of type {kind[:40]!r}, allowed: {', '.join(_TYPES)}")
        return self._binary(count, _TYPES[kind]) if self.binary else self._ascii(count)

    def _binary(self, count: int, kind: str) -> Array:
        size = count * np.dtype(kind).itemsize
        if size > len(self.bytes) - self.at:
            raise self.wrong(f"{size} bytes expected, the file has {len(self.bytes) - self.at}")
        values = np.frombuffer(self.bytes, ">" + kind, count, self.at).astype(np.float64)
        if not np.isfinite(values).all():
            self.at += int(np.argmin(np.isfinite(values))) * np.dtype(kind).itemsize
            raise self.wrong("this number is not finite")
        self.at += size
        return values

    def _ascii(self, count: int) -> Array:
        if count == 0:
            return np.zeros(0)
        found = _NEXT_WORD.search(self.bytes, max(self.at - 1, 0))
        end = len(self.bytes) if found is None else found.start() + 1
        words = self.bytes[self.at : end].split()
        if len(words) != count:
            raise self.wrong(f"{count} numbers expected, got {len(words)}")
        if not self.bytes[end - 1 : end].isspace():
            raise self.wrong("the file ends within a number")
        try:
            values = np.array(words).astype(np.float64)
        except ValueError:
            values = np.array([np.nan])
        if not np.isfinite(values).all():
            plain = (word.decode(errors="replace") for word in words)
            raise self.wrong(next(filter(None, map(number_fault, plain)), "no numbers"))
        self.at = end
        return values
