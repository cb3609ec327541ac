"""Extended XYZ: a count, a line of ``key=value``, then as many rows; frame after frame.

``Lattice`` lists the lattice vectors one after another, ``pbc`` the periodic axes, ``Origin`` the
lower corner, ``Properties`` the columns as name:type:width.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import integers, plain_text
from granufab.io.text_table import parse_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_PAIR = re.compile(r"(\w+)\s*=\s*(\"[^\"]*\"|'[^']*'|\[[^\]]*\]|\{[^}]*\}|\S+)")
_NAMES = {
    "position": ("pos", "position", "r"),
    "radius": ("radius", "radii", "rad"),
    "diameter": ("diameter",),
    "number": ("id", "number", "particle_id"),
    "mass": ("mass", "masses"),
    "velocity": ("velo", "vel", "velocity", "v"),
    "spin": ("angular_velocity", "omega", "angvel", "spin"),
}
_IGNORED = ("species", "type", "Z")


@dataclass(frozen=True, slots=True)
class _Block:
    """Where the rows of one frame lie, or why they cannot be found."""

    start: int
    end: int
    rows: int
    line: int
    comment: str
    broken: str = ""


def _matches(path: Path, head: bytes) -> bool:
    lines = head.split(b"\n", 2)
    return (
        len(lines) > 1 and lines[0].strip().isdigit()
        and (b"Properties=" in lines[1] or b"Lattice=" in lines[1])
    )  # fmt: skip


def _blocks(path: Path) -> tuple[list[_Block], str]:
    """Complete frames, and what is wrong after them."""
    blocks: list[_Block] = []
    size, line, last = path.stat().st_size, 0, b""
    with path.open("rb") as stream:
        while first := stream.readline():
            line += 1
            if not first.strip():
                continue
            wrong, rows = "", int(first[:40]) if first[:40].strip().isdigit() else -1
            if rows < 0 or not first.endswith(b"\n"):
                wrong = f"line {line} is no count of rows: {first[:40]!r}"
            elif rows > (size - stream.tell()) // 2 + 1:
                wrong = f"line {line} declares {rows} rows, the file is too short"
            if wrong:
                next_one = _next_frame(stream, line)
                if next_one is None:
                    return blocks, wrong
                if not _is_row(first, last):
                    blocks.append(_Block(0, 0, 0, line, "", wrong))
                elif blocks:  # of a frame whose count is too small
                    blocks[-1] = _Block(0, 0, 0, line, "", wrong)
                start, line = next_one
                stream.seek(start)
                last = b""
                continue
            comment = stream.readline()
            start = stream.tell()
            last = comment
            for _ in range(rows):
                last = stream.readline()
            if not last.endswith(b"\n"):
                return blocks, f"the frame at line {line} is cut"
            text = comment.decode("utf-8", "replace")
            blocks.append(_Block(start, stream.tell(), rows, line + 2, text))
            line += rows + 1
    return blocks, ""


def _is_row(line: bytes, row: bytes) -> bool:
    """Whether a line where a frame should begin looks like the row before it."""
    words = len(line.split())
    return words > 1 and words == len(row.split()) and b"=" not in line


def _next_frame(stream: BinaryIO, line: int) -> tuple[int, int] | None:
    """Where the next frame begins after a line that is none, and the number of the line before."""
    place, before = stream.tell(), b""
    count_place = place
    for text in stream:
        line += 1
        if before.strip().isdigit() and (b"Properties=" in text or b"Lattice=" in text):
            return count_place, line - 2
        count_place, before = place, text
        place += len(text)
    return None


def _columns(text: str, place: str) -> dict[str, list[int]]:
    """Columns of each property."""
    words = text.split(":")
    columns: dict[str, list[int]] = {}
    place_now = 0
    if len(words) % 3 or not all(re.fullmatch(r"[0-9]{1,3}", width) for width in words[2::3]):
        raise CorruptFile(f"{place}: Properties={text!r} is no list of name:type:width")
    for name, width in zip(words[::3], words[2::3], strict=True):
        columns[name] = list(range(place_now, place_now + int(width)))
        place_now += int(width)
    return columns


def _frame(path: Path, block: _Block) -> FoundFrame:
    if block.broken:
        raise CorruptFile(f"{path}: {block.broken}")
    place = f"{path}: frame at line {block.line - 2}"
    header = {k: v.strip("\"'[]{}") for k, v in _PAIR.findall(block.comment)}
    columns = _columns(header.get("Properties", "species:S:1:pos:R:3"), place)
    use = {
        what: next((columns[name] for name in names if name in columns), [])
        for what, names in _NAMES.items()
    }
    if len(use["position"]) not in (2, 3):
        raise CorruptFile(f"{place}: no property pos of three columns in {list(columns)}")
    with path.open("rb") as stream:
        stream.seek(block.start)
        text = plain_text(stream.read(block.end - block.start), path, block.line)
    wanted = [column for group in use.values() for column in group]
    table = parse_table(text, wanted, place=str(path), first_line=block.line)
    if len(table) != block.rows:
        raise CorruptFile(f"{place}: has {len(table)} rows, expected {block.rows}")
    ends = np.cumsum([len(group) for group in use.values()])
    values = dict(zip(use, np.split(table, ends[:-1], axis=1), strict=True))
    radius = _single(values["radius"])
    if radius is None and values["diameter"].shape[1] == 1:
        radius = values["diameter"][:, 0] / 2
    number = _single(values["number"])
    return FoundFrame(
        place=place,
        position=values["position"],
        radius=radius,
        number=None if number is None else integers(number, place, "id"),
        mass=_single(values["mass"]),
        velocity=values["velocity"] if values["velocity"].shape[1] == 3 else None,
        spin=values["spin"] if values["spin"].shape[1] == 3 else None,
        dimension=2 if header.get("dimension") == "2" else None,
        cell=_cell(header, place),
        time=_time(header, place),
    )


def _single(values: Array) -> Array | None:
    return values[:, 0] if values.shape[1] == 1 else None


def _numbers(header: dict[str, str], name: str, count: int, place: str) -> Array | None:
    if name not in header:
        return None
    try:
        values = np.array([float(w) for w in header[name].replace(",", " ").split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not np.isfinite(values).all():
        raise CorruptFile(f"{place}: {name}={header[name]!r}, expected {count} numbers")
    return values


def _time(header: dict[str, str], place: str) -> float | None:
    name = next((name for name in ("Time", "time") if name in header), "")
    values = _numbers(header, name, 1, place)
    return None if values is None else float(values[0])


def _cell(header: dict[str, str], place: str) -> FoundCell | None:
    lattice = _numbers(header, "Lattice", 9, place)
    if lattice is None:
        return None
    origin = _numbers(header, "Origin", 3, place)
    words = header.get("pbc", "T T T").replace(",", " ").split()
    if len(words) != 3:
        raise CorruptFile(f"{place}: pbc={header['pbc']!r}, expected three of T and F")
    return FoundCell(
        matrix=np.ascontiguousarray(lattice.reshape(3, 3).T),
        origin=np.zeros(3) if origin is None else origin,
        periodic=tuple(word.upper() in ("T", "TRUE", "1") for word in words),
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    frames: list[tuple[Path, _Block]] = []
    notes = ["positions and radii only: contacts are found by gap"]
    unknown: dict[str, None] = {}
    for path in paths:
        blocks, wrong = _blocks(path)
        if wrong and not blocks:
            raise CorruptFile(f"{path}: {wrong}")
        if wrong:
            notes.append(f"{path}: read up to the last complete frame ({wrong})")
        frames += [(path, block) for block in blocks]
        if blocks:
            begun = next((b for b in blocks if b.comment), blocks[0])
            header = dict(_PAIR.findall(begun.comment or ""))
            place = f"{path}: line {begun.line - 1}"
            names = _columns(header.get("Properties", "").strip("\"'") or "pos:R:3", place)
            known = {*_IGNORED, *(name for group in _NAMES.values() for name in group)}
            unknown |= dict.fromkeys(name for name in names if name not in known)
    if not frames:
        raise CorruptFile(f"{paths[0]}: holds no frame in {paths[0].stat().st_size} bytes")
    return LazyFrames(
        count=len(frames),
        parse=lambda index: _frame(*frames[index]),
        unknown=tuple(unknown),
        notes=tuple(notes),
    )


FORMAT = ForeignFormat(key="extxyz", name="extended XYZ", matches=_matches, open=_open)
"""Frames of extended XYZ, as OVITO and ASE write them."""
