"""MercuryDPM's ``.data`` (grains) and ``.fstat`` (contacts): series matched by time.

A frame of ``.data`` is ``N time xmin ymin xmax ymax`` and N rows ``x y vx vy r angle omega
species`` in 2D, or ``N time xmin ymin zmin xmax ymax zmax`` and N rows of 14 columns in 3D.
A frame of ``.fstat`` is three # lines, the first with the time, and rows ``time i j c(3) overlap
tangential_overlap f_n f_t n(3) t(3)``: i and j are rows of ``.data``, from 0. A pair of grains is
listed from both sides, a wall once with a negative number. n points to i, the forces act on i and
f_n > 0 pushes. The box does not say where it is periodic: an axis counts as periodic where a listed
contact reaches across it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.readers.mercury_blocks import Block, data_blocks, fstat_blocks
from granufab.io.text_rows import first_bytes, first_words, integers
from granufab.io.text_table import parse_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_ROW = {2: 8, 3: 14}
_SAME_TIME = 1e-6
"""Largest difference of times that are the same, as a share of the larger one."""


def _matches(path: Path, head: bytes) -> bool:
    return _is_fstat(head) or _is_data(head)


def _is_fstat(head: bytes) -> bool:
    lines = first_words(head)[:3]
    return [len(words) for words in lines] == [3, 7, 7] and all(w[0] == "#" for w in lines)


def _is_data(head: bytes) -> bool:
    """Headers of 6 or 8 words, with as many rows of 8 or 14 after each as it announces."""
    lines = first_words(head)
    if not lines or len(lines[0]) not in (6, 8) or not lines[0][0].isdecimal():
        return False
    wide = _ROW[2] if len(lines[0]) == 6 else _ROW[3]
    at, seen = 0, False
    while at < len(lines):
        if len(lines[at]) != len(lines[0]) or not lines[at][0].isdecimal():
            return False
        count = int(lines[at][0])
        rows = lines[at + 1 : at + 1 + count]
        if any(len(row) != wide for row in rows):
            return False
        seen, at = seen or bool(rows), at + 1 + count
    return seen


def _frame(block: Block, listed: Block | None) -> FoundFrame:
    dimension = 2 if len(block.header) == 6 else 3
    table = _table(block, _ROW[dimension])
    corners = np.array([float(word) for word in block.header[2:]])
    lower, upper = corners[:dimension], corners[dimension:]
    position, radius = table[:, :dimension], table[:, 2 * dimension]
    contacts = None if listed is None else _contacts(listed, len(table))
    edges = upper - lower
    cell = None
    if (edges > 0).all() and np.isfinite(corners).all():
        reaches = np.zeros(dimension, bool)
        if contacts is not None:
            reaches = _reaches_across(contacts, position, radius, edges)
        cell = FoundCell(
            matrix=np.diag(edges), origin=lower, periodic=tuple(bool(wraps) for wraps in reaches)
        )
    return FoundFrame(
        place=f"{block.path}: t = {block.time:.6g}",
        position=position,
        radius=radius,
        velocity=table[:, dimension : 2 * dimension],
        spin=table[:, 6:7] if dimension == 2 else table[:, 10:13],
        dimension=dimension,
        cell=cell,
        contacts=contacts,
        time=block.time,
    )


def _table(block: Block, columns: int) -> Array:
    text = block.text()
    return parse_table(
        text, range(columns), columns=columns, place=str(block.path), first_line=block.line + 1
    )


def _contacts(block: Block, bodies: int) -> FoundContacts:
    table = _table(block, 16)
    place = f"{block.path}: t = {block.time:.6g}"
    first = integers(table[:, 1], place, "grain i")
    second = integers(table[:, 2], place, "grain j")
    for name, number in (("i", first), ("j", np.maximum(second, 0))):
        wrong = (number < 0) | (number >= bodies)
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise CorruptFile(
                f"{place}: line {block.line + 1 + row}: grain {name} is {number[row]}, but there "
                f"are {bodies} grains (0..{bodies - 1})"
            )
    return FoundContacts(
        place=place,
        first=first,
        second=second,
        wall=second < 0,
        normal=table[:, 10:13],
        point=table[:, 3:6],
        gap=-table[:, 6],
        normal_force=table[:, 8],
        tangential_force=table[:, 9:10] * table[:, 13:16],
        force_on="first",
        normal_to="first",
    )


def _reaches_across(
    contacts: FoundContacts, position: Array, radius: Array, edges: Array
) -> np.ndarray:
    """Axes along which two grains in contact are further apart than they can reach."""
    pair = np.column_stack([contacts.first, contacts.second])[contacts.second >= 0]
    if len(pair) == 0:
        return np.zeros(len(edges), bool)
    apart = np.abs(position[pair[:, 1]] - position[pair[:, 0]])
    reach = 1.5 * radius[pair].sum(axis=1)
    return ((apart > reach[:, None]) & (apart > 0.5 * edges)).any(axis=0)


def _same_times(data: Sequence[Block], fstat: Sequence[Block]) -> list[tuple[Block, Block | None]]:
    """Frames of grains with the contacts of the same time."""
    times = np.array([block.time for block in fstat])
    pairs: list[tuple[Block, Block | None]] = []
    for block in data:
        nearest = int(np.argmin(np.abs(times - block.time)))
        scale = max(abs(block.time), abs(times[nearest]))
        if abs(times[nearest] - block.time) <= _SAME_TIME * scale:
            pairs.append((block, fstat[nearest]))
    return pairs


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    data: list[Block] = []
    fstat: list[Block] = []
    notes: list[str] = []
    without: list[Path] = []
    grains = 0
    for path in paths:
        if first_bytes(path).lstrip().startswith(b"#"):
            blocks, whole = fstat_blocks(path)
            fstat += blocks
        else:
            blocks, whole = data_blocks(path)
            data += blocks
            grains += 1
        without += [] if blocks else [path]
        if not whole:
            notes.append(f"{path}: the last frame is cut off and left out")
    if not grains:
        raise MissingData(f"{paths[0]}: holds contacts only; give the .data file with the grains")
    if without:
        end = f"up to the end at byte {without[0].stat().st_size}"
        raise CorruptFile(f"{without[0]}: no frame is complete {end}: it is cut off")
    pairs: list[tuple[Block, Block | None]] = [(block, None) for block in data]
    if fstat:
        pairs = _same_times(data, fstat)
        if not pairs:
            raise MissingData(f"{paths[0]}: no frame has the time of a frame of the contacts")
        if len(pairs) < len(data):
            notes.append(f"{len(data) - len(pairs)} frames without contacts at their time left out")
    else:
        notes.append("no .fstat given: contacts are found by gap")
    return LazyFrames(count=len(pairs), parse=lambda k: _frame(*pairs[k]), notes=tuple(notes))


FORMAT = ForeignFormat(
    key="mercury", name="MercuryDPM data and fstat", matches=_matches, open=_open
)
