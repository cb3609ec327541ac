"""Photoelastic experiments as PeGS leaves them: ``particle_positions``, ``Adjacency_list``.

Rows of positions are ``frame,id,x,y,r,edge`` (6 columns) or ``id,x,y,r,frame`` (5); of the list
``frame,id1,id2,tangential,normal``. A pair may be listed from both sides. The list tells who
touches: measured positions and radii do not. Normals are along the branches, f_n > 0 pushes; the
sense of the tangential force is not documented and taken along t = (−n_y, n_x).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import integers, whole_text
from granufab.io.text_table import parse_table
from granufab.packing import Array, IntArray

__all__ = ["FORMAT"]

_POSITIONS, _LIST = "particle_positions.txt", "Adjacency_list.txt"
_ROW = re.compile(rb"[-+0-9.eEnaN]+(,[-+0-9.eEnaN]+){4,5}")


def _matches(path: Path, head: bytes) -> bool:
    if path.is_dir():
        return (path / _POSITIONS).is_file()
    lines = head.splitlines()[: max(1, head.count(b"\n"))]
    return bool(lines) and bool(_kind(path)) and all(_ROW.fullmatch(line.strip()) for line in lines)


def _kind(path: Path) -> str:
    """Which of the two files a name says; empty for neither."""
    name = path.name.lower()
    return "positions" if "position" in name else "list" if "adjacency" in name else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Rows of a file by frame: the files are small."""

    path: Path
    frame: IntArray
    table: Array

    def of(self, frame: int) -> Array:
        return self.table[self.frame == frame]


def _read(path: Path) -> tuple[Array, int]:
    text = whole_text(path)
    columns = text.split("\n", 1)[0].count(",") + 1
    if columns not in (5, 6):
        raise CorruptFile(
            f"{path}: line 1 has {columns} columns, expected 5 or 6 (numbers with a decimal point)"
        )
    place = str(path)
    return parse_table(text, range(columns), columns=columns, place=place, delimiter=","), columns


def _positions(path: Path) -> _Rows:
    """Rows ``id x y r`` with their frame."""
    table, columns = _read(path)
    if columns == 6:
        frame, table = table[:, 0], table[:, 1:5]
    else:
        frame, table = table[:, 4], table[:, :4]
    return _Rows(path=path, frame=integers(frame, str(path), "frame"), table=table)


def _listed(path: Path) -> _Rows:
    """Rows ``id1 id2 tangential normal`` with their frame."""
    table, columns = _read(path)
    if columns != 5:
        raise CorruptFile(f"{path}: line 1 has {columns} columns, expected 5")
    frame = integers(table[:, 0], str(path), "frame")
    return _Rows(path=path, frame=frame, table=table[:, 1:])


def _frame(number: int, positions: _Rows, listed: _Rows | None) -> FoundFrame:
    place = f"{positions.path}: frame {number}"
    table = positions.of(number)
    return FoundFrame(
        place=place,
        position=table[:, 1:3],
        radius=table[:, 3],
        number=integers(table[:, 0], place, "particle"),
        dimension=2,
        contacts=None if listed is None else _contacts(listed, number, table[:, 0], place),
        step=number,
    )


def _contacts(listed: _Rows, number: int, known: Array, place: str) -> FoundContacts:
    table = listed.of(number)
    here = f"{listed.path}: frame {number}"
    pair = integers(table[:, :2].ravel(), here, "particle").reshape(-1, 2)
    lost = ~np.isin(pair, known)
    if lost.any():
        row, side = np.argwhere(lost)[0]
        line = int(np.flatnonzero(listed.frame == number)[row]) + 1
        raise CorruptFile(
            f"{place} has no particle {pair[row, side]}, which touches {pair[row, 1 - side]} in "
            f"line {line} of {listed.path.name}"
        )
    return FoundContacts(
        place=here,
        first=pair[:, 0],
        second=pair[:, 1],
        normal_force=table[:, 3],
        tangential_size=table[:, 2],
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    files = [
        one
        for path in paths
        for one in ([path / _POSITIONS, path / _LIST] if path.is_dir() else [path])
        if one.is_file()
    ]
    found = {
        kind: [path for path in files if _kind(path) == kind] for kind in ("positions", "list")
    }
    if len(found["positions"]) != 1 or len(found["list"]) > 1:
        raise MissingData(
            f"{paths[0]}: an experiment is one file of positions and at most one adjacency list, "
            f"got {len(found['positions'])} and {len(found['list'])}"
        )
    positions = _positions(found["positions"][0])
    listed = _listed(found["list"][0]) if found["list"] else None
    frames = list(dict.fromkeys(positions.frame.tolist()))
    notes = ["listed contacts, whatever the measured positions and radii say"]
    if listed is None:
        notes = [f"no {_LIST} given: contacts are found by gap"]
    else:
        here = set(listed.frame.tolist())
        alone = [frame for frame in frames if frame not in here]
        frames = [frame for frame in frames if frame in here]
        if alone:
            notes.append(f"frames without listed contacts left out: {', '.join(map(str, alone))}")
    if not frames:
        raise MissingData(f"{paths[0]}: no frame of the positions has listed contacts")
    return LazyFrames(
        count=len(frames),
        parse=lambda k: _frame(frames[k], positions, listed),
        notes=tuple(notes),
    )


FORMAT = ForeignFormat(
    key="pegs", name="PeGS experiment (positions, adjacency list)", matches=_matches, open=_open
)
