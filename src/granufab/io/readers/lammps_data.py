"""Data files that LAMMPS' ``read_data`` reads and ``write_data`` writes: one state.

Rows of ``Atoms # sphere`` are ``id type diameter density x y z [ix iy iz]``, those of Velocities
``id vx vy vz wx wy wz``. Boundaries are not in such a file: they are LAMMPS' default, periodic,
unless the user says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundFrame, LazyFrames, Source
from granufab.io.lammps.box import bounds_cell, tilted_cell
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import whole_text
from granufab.io.text_table import parse_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_NOTE = "contacts are found by gap: a data file has none"
_PERIODIC = "boundaries are not in a data file: all periodic, unless --periodic says otherwise"
_STYLES = {
    "sphere": 7, "granular": 7, "disc": 7,
    "atomic": 5, "charge": 6, "molecular": 6, "bond": 6, "angle": 6, "full": 7,
}  # fmt: skip
"""Columns of a row of Atoms up to z; three more are counts of boundary crossings."""
_ROUND = ("sphere", "granular", "disc")
_SECTION = re.compile(r"^([A-Z][A-Za-z ]*?)\s*(?:#\s*(.*))?$")
_HEAD = re.compile(rb"^[ \t]*\d+[ \t]+atoms[ \t]*(?:#.*)?\r?$", re.MULTILINE)
_BOX = re.compile(rb"^.*(?:xlo[ \t]+xhi|avec)[ \t]*(?:#.*)?\r?$", re.MULTILINE)


def _matches(path: Path, head: bytes) -> bool:
    return _HEAD.search(head) is not None and _BOX.search(head) is not None


@dataclass(slots=True)
class _File:
    """How many lines, header lines by their words, sections: hint, text, first line of each."""

    path: Path
    lines: int
    header: dict[str, list[str]]
    sections: dict[str, tuple[str, str, int]]


def _parse(path: Path) -> _File:
    lines = whole_text(path).split("\n")
    parsed = _File(path, len(lines) - 1, {}, {})
    starts = [k for k, line in enumerate(lines) if k and _SECTION.match(line.strip())]
    for line in lines[1 : starts[0] if starts else len(lines)]:
        words = line.partition("#")[0].split()
        keys = [word for word in words if word[:1].isalpha()]
        parsed.header[" ".join(keys)] = words[: len(words) - len(keys)]
    for start, stop in pairwise([*starts, len(lines)]):
        name = _SECTION.match(lines[start].strip())
        if name is not None:
            body = "\n".join(line.partition("#")[0] for line in lines[start + 1 : stop])
            parsed.sections[name[1]] = (name[2] or "", body, start + 2)
    return parsed


def _state(path: Path, options: ReadOptions) -> FoundFrame:
    parsed = _parse(path)
    count = _count(parsed)
    hint, style = _style(parsed)
    _check_widths(parsed, "Atoms", (style, style + 3))
    table = _rows(parsed, "Atoms", (0, *range(2, style)), count)
    columns = {word: k for k, word in enumerate(range(2, style), 1)}
    position = table[:, [columns[style - 3], columns[style - 2], columns[style - 1]]]
    radius = table[:, 1] / 2 if hint in _ROUND else None
    mass = None
    if radius is not None:
        mass = table[:, 2] * 4 / 3 * np.pi * radius**3
    number = _numbers(table[:, 0], path)
    velocity, spin = _velocities(parsed, number)
    return FoundFrame(
        place=str(path), position=position, radius=radius, number=number, mass=mass,
        velocity=velocity, spin=spin, cell=_cell(parsed, options),
    )  # fmt: skip


def _count(parsed: _File) -> int:
    words = parsed.header.get("atoms", [])
    if len(words) != 1 or not words[0].isdecimal() or len(words[0]) > 15:
        raise CorruptFile(f"{parsed.path}: the header has no number of atoms")
    return int(words[0])


def _style(parsed: _File) -> tuple[str, int]:
    """The atom style and its columns; without a hint it is taken to be sphere."""
    if "Atoms" not in parsed.sections:
        raise CorruptFile(f"{parsed.path}: there is no section Atoms up to line {parsed.lines}")
    hint = (parsed.sections["Atoms"][0].split() or ["sphere"])[0]
    if hint not in _STYLES:
        raise MissingData(
            f"{parsed.path}: atom style {hint[:40]!r} cannot be read, only {', '.join(_STYLES)}; "
            "dump the state instead"
        )
    return hint, _STYLES[hint]


def _check_widths(parsed: _File, name: str, allowed: tuple[int, ...]) -> None:
    _, text, first = parsed.sections[name]
    for number, row in enumerate(text.split("\n"), first):
        words = len(row.split())
        if words and words not in allowed:
            raise CorruptFile(
                f"{parsed.path}: line {number} has {words} columns, expected "
                f"{' or '.join(map(str, allowed))}"
            )


def _rows(parsed: _File, name: str, use: Sequence[int], count: int) -> Array:
    _, text, line = parsed.sections[name]
    table = parse_table(text, use, place=str(parsed.path), first_line=line)
    if len(table) != count:
        raise CorruptFile(
            f"{parsed.path}: line {line - 1}: {name} has {len(table)} rows, the header says {count}"
        )
    return table


def _numbers(column: Array, path: Path) -> np.ndarray:
    if not ((np.abs(column) < 2**53) & (column == np.rint(column))).all():
        raise CorruptFile(f"{path}: an atom's id is not a whole number")
    return column.astype(np.int64)


def _velocities(parsed: _File, number: np.ndarray) -> tuple[Array | None, Array | None]:
    """Velocities and spins in the order of the atoms."""
    if "Velocities" not in parsed.sections:
        return None, None
    words = next((row.split() for row in parsed.sections["Velocities"][1].splitlines() if row), [])
    _check_widths(parsed, "Velocities", (4, 7))
    table = _rows(parsed, "Velocities", range(7 if len(words) >= 7 else 4), len(number))
    ids = _numbers(table[:, 0], parsed.path)
    order = np.argsort(ids, kind="stable")
    rank = np.argsort(np.argsort(number, kind="stable"), kind="stable")
    if not (np.sort(ids) == np.sort(number)).all():
        raise CorruptFile(f"{parsed.path}: Velocities are of other atoms than Atoms")
    table = table[order][rank]
    return table[:, 1:4], table[:, 4:7] if table.shape[1] == 7 else None


def _cell(parsed: _File, options: ReadOptions) -> FoundCell:
    place, header = str(parsed.path), parsed.header
    periodic = "xyz" if options.periodic is None else options.periodic
    if "avec" in header:
        lines = [header.get(f"{name}vec", []) for name in "abc"]
        origin = header.get("abc origin", ["0", "0", "0"])
        lines = [[*line, corner] for line, corner in zip(lines, origin, strict=False)]
        return bounds_cell(("abc", "origin"), lines, place, periodic)
    try:
        low, high = np.array([_pair(header, axis) for axis in "xyz"]).T
        tilts = tuple(float(word) for word in header.get("xy xz yz", ("0", "0", "0")))
    except ValueError:
        raise CorruptFile(
            f"{place}: the header has no three lines of two numbers and xlo xhi, ylo yhi, zlo zhi"
        ) from None
    if len(tilts) != 3:
        raise CorruptFile(f"{place}: the header has {len(tilts)} tilts xy xz yz, expected 3")
    return tilted_cell(low, high, tilts, tuple(axis in periodic for axis in "xyz"), place)


def _pair(header: dict[str, list[str]], axis: str) -> tuple[float, float]:
    low, high = header.get(f"{axis}lo {axis}hi", ["", ""])
    return float(low), float(high)


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    notes = (_NOTE,) if options.periodic is not None else (_NOTE, _PERIODIC)
    return LazyFrames(
        count=len(paths), parse=lambda index: _state(paths[index], options), notes=notes
    )


FORMAT = ForeignFormat(key="lammps_data", name="LAMMPS data file", matches=_matches, open=_open)
