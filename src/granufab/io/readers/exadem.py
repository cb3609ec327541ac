"""exaDEM: extxyz frames of grains, and interactions of the same step as comma-separated rows.

Rows of interactions are ``i j sub_i sub_j type overlap point(3) f_n(3) f_t(3) r_i(3) r_j(3)``.
Types 0 to 3 join two grains (vertices, edges, faces), 4 to 12 a grain and a driver, 13 are bonds
inside a grain. The forces act on i; the normal is along f_n, whose sense viscous pull can turn, so
it is turned to point from i to j. Polyhedra may touch at several parts: each is a contact. They
have no radius.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import checked_count, first_bytes, in_order, integers, whole_text
from granufab.io.text_table import parse_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_NAME = re.compile(r"InteractionOutputDir-(\d+)(_\d+)?\.txt")
_KIND = re.compile(r"(\w+)=(?:\"([^\"]*)\"|(\S+))")
_PART = 1 << 40
_SIDES = ((0, 0), (0, 1), (0, 2), (1, 1))


def _is_frame(head: bytes) -> bool:
    lines = head.split(b"\n", 2)
    return len(lines) > 2 and lines[0].strip().isdigit() and b"vrot:R:3" in lines[1]


def _matches(path: Path, head: bytes) -> bool:
    if path.is_dir():
        first = in_order(path.glob("*.xyz"))[:1]
        return any(_is_frame(first_bytes(one)) for one in first)
    return bool(_NAME.fullmatch(path.name)) or _is_frame(head)


def _step(path: Path) -> int | None:
    """The step in a name: its last number, or the one after InteractionOutputDir."""
    named = _NAME.fullmatch(path.name)
    numbers = re.findall(r"\d+", path.stem)
    return int(named[1]) if named else int(numbers[-1]) if numbers else None


def _frame(path: Path, listed: Sequence[Path]) -> FoundFrame:
    text = whole_text(path)
    lines = text.split("\n", 2)
    if len(lines) < 3:
        raise CorruptFile(f"{path}: line {len(lines)}: cut off before the grains")
    count = checked_count(lines[0].strip(), len(text), f"{path}: line 1", "grains")
    heading = {name: quoted or bare for name, quoted, bare in _KIND.findall(lines[1])}
    place, width = _columns(heading, path)
    rows = lines[2].count("\n")
    if rows != count:
        raise CorruptFile(f"{path}: has {rows} grains, line 1 announces {count}")
    wanted = [k for name in ("pos", "id", "vel", "vrot", "mass", "radius") for k in place[name]]
    table = parse_table(lines[2], wanted, columns=width, place=str(path), first_line=3)
    part = _split(table, [len(place[name]) for name in place])
    time = _time(heading, path)
    return FoundFrame(
        place=str(path),
        position=part[0],
        number=integers(part[1][:, 0], str(path), "id") if part[1].size else None,
        velocity=part[2] if part[2].size else None,
        spin=part[3] if part[3].size else None,
        mass=part[4][:, 0] if part[4].size else None,
        radius=part[5][:, 0] if part[5].size else None,
        dimension=3,
        cell=_cell(heading, path),
        contacts=_contacts(listed) if listed else None,
        round=False,
        time=time,
        step=_step(path),
    )


def _split(table: Array, sizes: Sequence[int]) -> list[Array]:
    return np.split(table, np.cumsum(sizes)[:-1], axis=1)


def _columns(heading: dict[str, str], path: Path) -> tuple[dict[str, list[int]], int]:
    """Columns of what is used, by name, and how many a row has."""
    fields = heading.get("Properties", "").split(":")
    sizes = fields[2::3]
    if not sizes or len(fields) % 3 or not all(re.fullmatch(r"[1-9]\d?", size) for size in sizes):
        raise CorruptFile(f"{path}: line 2: Properties has no name:kind:columns")
    place: dict[str, list[int]] = {
        name: [] for name in ("pos", "id", "vel", "vrot", "mass", "radius")
    }
    width = {"pos": 3, "vel": 3, "vrot": 3}
    at = 0
    for name, size in zip(fields[0::3], sizes, strict=True):
        if name in place and int(size) == width.get(name, 1):
            place[name] = list(range(at, at + int(size)))
        at += int(size)
    if not place["pos"]:
        raise CorruptFile(f"{path}: line 2: Properties has no pos:R:3")
    return place, at


def _time(heading: dict[str, str], path: Path) -> float | None:
    try:
        return float(heading["Time"]) if "Time" in heading else None
    except ValueError:
        raise CorruptFile(f"{path}: line 2: Time is {heading['Time']!r}, no number") from None


def _cell(heading: dict[str, str], path: Path) -> FoundCell | None:
    if "Lattice" not in heading:
        return None
    try:
        matrix = np.array([float(word) for word in heading["Lattice"].split()]).reshape(3, 3).T
        corner = [float(word) for word in heading.get("Origin", "0 0 0").split()]
        origin = np.array(corner).reshape(3)
    except ValueError:
        raise CorruptFile(f"{path}: line 2: Lattice has no 9 numbers") from None
    wraps = [word in ("T", "1", "True") for word in heading.get("pbc", "F F F").split()]
    return FoundCell(matrix=matrix, origin=origin, periodic=tuple((wraps + [False] * 3)[:3]))


def _contacts(paths: Sequence[Path]) -> FoundContacts:
    table = np.concatenate([_interactions(path) for path in paths])
    place = str(paths[0])
    table = table[table[:, 4] < 13]
    wall = table[:, 4] >= len(_SIDES)
    kind = integers(table[:, 4], place, "type")
    sides = np.array(_SIDES, np.int64)[np.where(wall, 0, kind)]
    part = np.where(wall[:, None], 0.0, table[:, 2:4])  # a driver has none
    number = integers(np.concatenate([table[:, :2], part]).ravel(), place, "body").reshape(2, -1, 2)
    return FoundContacts(
        place=place,
        first=number[0][:, 0],
        second=number[0][:, 1],
        wall=wall,
        part=number[1] + sides * _PART,
        normal=table[:, 9:12],
        normal_to=None,
        gap=table[:, 5],
        point=table[:, 6:9],
        force=table[:, 9:12] + table[:, 12:15],
        force_on="first",
    )


def _interactions(path: Path) -> Array:
    text = whole_text(path)
    table = parse_table(text, range(21), columns=21, place=str(path), delimiter=",")
    bad = ~((table[:, 4] >= 0) & (table[:, 4] <= 13))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise CorruptFile(
            f"{path}: line {row + 1}: type is {table[row, 4]:g}, known: 0..3 (grains), 4..12 "
            "(drivers), 13 (bonds)"
        )
    return table


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            listed = [*path.glob("InteractionOutputDir-*.txt"), *path.glob("Inter*/Inter*.txt")]
            files += in_order([*path.glob("*.xyz"), *listed])
        else:
            files.append(path)
    frames = [path for path in files if not _NAME.fullmatch(path.name)]
    steps: dict[int | None, list[Path]] = {}
    for path in files:
        if _NAME.fullmatch(path.name):
            steps.setdefault(_step(path), []).append(path)
    notes: list[str] = []
    if options.periodic is None and frames and b"pbc=" not in first_bytes(frames[0]):
        notes.append("the lattice does not say where it is periodic; give --periodic, else nowhere")
    if not frames:
        raise MissingData(f"{paths[0]}: interactions only; give the .xyz file of the step too")
    pairs = [(path, steps.get(_step(path), [])) for path in frames]
    if steps:
        if len(frames) == len(steps) == 1 and not pairs[0][1]:
            pairs = [(frames[0], next(iter(steps.values())))]
        pairs = [pair for pair in pairs if pair[1]]
        if not pairs:
            raise MissingData(f"{paths[0]}: no frame has the step of an interaction file")
        if len(pairs) < len(frames):
            notes.append(f"{len(frames) - len(pairs)} frames without interactions left out")
    return LazyFrames(count=len(pairs), parse=lambda k: _frame(*pairs[k]), notes=tuple(notes))


FORMAT = ForeignFormat(
    key="exadem", name="exaDEM frames and interactions", matches=_matches, open=_open
)
