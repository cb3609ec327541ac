"""MercuryDPM restart files, of the keyword layouts and of the older ones by position.

A restart is one state; several are a series. Keyword layouts name what follows: ``position``,
``velocity``, ``angularVelocity``, ``radius``, ``invMass``; ``particleIds i j … force …`` or
``particleWallIds``. Older rows (``restart_version`` 1 to 3) are ``[BP] x y z v(3) r angle(3)
omega(3) invMass invInertia [species]``. Forces act on i. Grains of infinite mass are fixed and
count as walls. Periodic and Lees–Edwards boundaries give the cell.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.readers.keyword_lines import Lines, numbers_after
from granufab.io.readers.mercury_boundaries import (
    Boundary,
    parse_boundary,
    restart_cell,
    whole_turns,
)
from granufab.packing import Array

__all__ = ["FORMAT"]


def _matches(path: Path, head: bytes) -> bool:
    return head.startswith((b"MercuryDPM ", b"restart_version "))


@dataclass(slots=True)
class _Restart:
    """What was found in one file."""

    words: dict[str, str] = field(default_factory=dict)
    boundaries: list[Boundary] = field(default_factory=list)
    rows: array[float] = field(default_factory=lambda: array("d"))
    number: array[int] = field(default_factory=lambda: array("q"))
    round: bool = True
    listed: bool = False
    pair: array[int] = field(default_factory=lambda: array("q"))
    force: array[float] = field(default_factory=lambda: array("d"))


_HEADER = {"xmin", "xmax", "ymin", "ymax", "zmin", "zmax", "time", "t", "systemdimensions", "dim"}
_ROW = (("position", 3), ("velocity", 3), ("angularVelocity", 3), ("radius", 1), ("invMass", 1))


def _parse(path: Path) -> _Restart:
    found = _Restart()
    lines = Lines(path)
    seen = False
    while (words := lines.next_words()) is not None:
        if not words:
            continue
        if words[0] in ("Boundaries", "WallsPeriodic") and len(words) == 2:
            for _ in range(lines.count(words[1], "boundaries")):
                boundary = parse_boundary(lines.needed("boundaries"), lines)
                found.boundaries += [] if boundary is None else [boundary]
        elif words[0] == "Particles" and len(words) >= 2 and not seen:
            seen = True
            for _ in range(lines.count(words[1], "particles")):
                _add_particle(found, lines.needed("particles"), lines)
        elif words[0] == "Interactions" and len(words) >= 2:
            found.listed = True
            for _ in range(lines.count(words[1], "interactions")):
                _add_interaction(found, lines.needed("interactions"), lines)
        elif seen and {"particleIds", "particleWallIds", "BaseParticle"} & set(words):
            raise CorruptFile(f"{lines.place} is a row more than the list before it announces")
        elif not seen:
            for name, value in pairwise(words):
                if name.lower() in _HEADER:
                    found.words.setdefault(name.lower(), value)
    if not seen:
        end = f"up to line {lines.at}"
        raise CorruptFile(f"{path}: has no line 'Particles N' {end}: it is cut off")
    return found


def _add_particle(found: _Restart, words: list[str], lines: Lines) -> None:
    if "position" in words:
        row = [x for name, count in _ROW for x in numbers_after(words, name, count, lines.place)]
        number = numbers_after(words, "id", 1, lines.place)[0]
        found.number.append(lines.integer(number, "id"))
        found.round &= "SuperQuadric" not in words[0]
    else:
        values = words[1:] if words[0][0].isalpha() else words
        if len(values) not in (15, 16):
            raise CorruptFile(f"{lines.place}: has {len(values)} numbers, expected 15 or 16")
        v = [lines.number(word) for word in values]
        row = [*v[0:3], *v[3:6], *v[10:13], v[6], v[13]]
        found.number.append(len(found.number))
    found.rows.extend(row)


def _add_interaction(found: _Restart, words: list[str], lines: Lines) -> None:
    wall = "particleIds" not in words
    name = "particleWallIds" if wall else "particleIds"
    i, j = (lines.integer(x, name) for x in numbers_after(words, name, 2, lines.place))
    found.pair.extend((i, j, wall))
    found.force.extend(numbers_after(words, "force", 3, lines.place))


def _frame(path: Path, found: _Restart, turns: int, options: ReadOptions) -> FoundFrame:
    row = np.array(found.rows).reshape(-1, 11)
    fixed = row[:, 10] <= 0.0
    dimension = _dimension(found, path)
    flat = row[:, 0:2] if dimension == 2 else row[:, 0:3]
    return FoundFrame(
        place=str(path),
        position=flat,
        radius=row[:, 9],
        number=np.array(found.number, np.int64),
        wall=fixed,
        mass=_mass(row[:, 10], fixed, options),
        velocity=row[:, 3 : 3 + dimension],
        spin=row[:, 8:9] if dimension == 2 else row[:, 6:9],
        dimension=dimension,
        cell=_cell(found, dimension, turns, path),
        contacts=_contacts(found, dimension),
        round=found.round,
        time=_header(found, ("time", "t"), path),
    )


def _dimension(found: _Restart, path: Path) -> int:
    value = _header(found, ("systemdimensions", "dim"), path)
    if value not in (2.0, 3.0):
        what = "missing" if value is None else f"{value:g}"
        raise CorruptFile(f"{path}: the header's systemDimensions is {what}, expected 2 or 3")
    return int(value)


def _header(found: _Restart, names: Sequence[str], path: Path) -> float | None:
    for name in names:
        if name in found.words:
            try:
                value = float(found.words[name])
            except ValueError:
                value = float("nan")
            if not np.isfinite(value):
                raise CorruptFile(
                    f"{path}: the header's {name} is {found.words[name]!r}, expected a number"
                )
            return value
    return None


def _mass(inverse: Array, fixed: np.ndarray, options: ReadOptions) -> Array | None:
    """Masses; a fixed grain that is kept has none, and then nobody has."""
    if fixed.any() and options.walls:
        return None
    return np.where(fixed, np.nan, 1.0 / np.where(fixed, 1.0, inverse))


def _cell(found: _Restart, dimension: int, turns: int, path: Path) -> FoundCell | None:
    ends = [_header(found, (f"{axis}{end}",), path) for end in ("min", "max") for axis in "xyz"]
    if any(end is None for end in ends):
        return None
    lower, upper = np.array(ends[:3], float)[:dimension], np.array(ends[3:], float)[:dimension]
    return restart_cell(lower, upper, found.boundaries, turns, str(path))


def _contacts(found: _Restart, dimension: int) -> FoundContacts | None:
    if not found.listed:
        return None
    pair = np.array(found.pair, np.int64).reshape(-1, 3)
    return FoundContacts(
        first=pair[:, 0],
        second=pair[:, 1],
        wall=pair[:, 2].astype(bool),
        force=np.array(found.force).reshape(-1, 3)[:, :dimension],
        force_on="first",
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    turns: list[int] = []

    def frame(k: int) -> FoundFrame:
        found = _parse(paths[k])
        if not turns:
            turns.append(whole_turns((found if k == 0 else _parse(paths[0])).boundaries))
        return _frame(paths[k], found, turns[0], options)

    return LazyFrames(count=len(paths), parse=frame)


FORMAT = ForeignFormat(
    key="mercury_restart", name="MercuryDPM restart", matches=_matches, open=_open
)
