"""Grains and contacts in legacy VTK files, as LIGGGHTS writes them: one file a frame, by step.

Points are centres; the arrays ``radius`` (or ``diameter``), ``id``, ``v``, ``omega`` and ``mass``
are read. Files with lines instead hold contacts of ``dump local/gran/vtk``, of grains or with
walls (:mod:`granufab.io.line_contacts`), and belong to the grains of the same step, which is the
last number in a file's name; without them contacts are found by gap. There is no box.
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.legacy_vtk import VtkPoints, is_legacy_vtk, read_legacy_vtk
from granufab.io.line_contacts import joined_contacts, line_contacts
from granufab.io.read_options import ReadOptions
from granufab.packing import Array

__all__ = ["FORMAT"]

_NO_BOX = "there is no box in this format, --cell gives one"
_BY_GAP = "contacts are found by gap"
_NAMES: dict[str, tuple[str, ...]] = {
    "id": ("id", "ID", "particle_id"),
    "radius": ("radius", "Radius", "r"),
    "diameter": ("diameter", "Diameter"),
    "mass": ("mass", "Mass"),
    "velocity": ("v", "velocity", "Velocity"),
    "spin": ("omega", "Omega"),
}
_PASSED = ("type", "i", "f", "ix", "tag")


def _matches(path: Path, head: bytes) -> bool:
    return is_legacy_vtk(head)


def _step(path: Path) -> int | None:
    """The last whole number in a file's name."""
    numbers = re.findall(r"\d+", path.stem)
    return int(numbers[-1]) if numbers and len(numbers[-1]) < 19 else None


def _names(found: VtkPoints, options: ReadOptions) -> dict[str, str]:
    """Array of every quantity that the file has, by the user's map or by usual names."""
    names = {}
    for what, usual in _NAMES.items():
        for name in usual:
            if name in found.data:
                names.setdefault(what, name)
    for what, name in options.columns.get("grains", {}).items():
        if what not in _NAMES or name not in found.data:
            raise InvalidSettings(
                f"columns: grains.{what} = {name!r}, allowed: {', '.join(_NAMES)} from the arrays "
                f"{', '.join(found.data)}"
            )
        names[what] = str(name)
    return names


def _frame(path: Path, contacts: Sequence[Path], options: ReadOptions) -> FoundFrame:
    """The grains of one file with the contacts of others."""
    grains = _grains(path, options)
    if not contacts:
        return grains
    return replace(grains, contacts=joined_contacts([_listed(one, grains) for one in contacts]))


def _listed(path: Path, grains: FoundFrame) -> FoundContacts:
    found = read_legacy_vtk(path)
    if len(found.position) and not (len(found.lines) and found.cells):
        raise CorruptFile(
            f"{path}: has {len(found.position)} points without lines and their values up to its "
            f"end, {path.stat().st_size} bytes; is it cut?"
        )
    return line_contacts(
        str(path), found.position, found.lines, found.cells,
        position=grains.position, radius=grains.radius, number=grains.number,
    )  # fmt: skip


def _grains(path: Path, options: ReadOptions) -> FoundFrame:
    found = read_legacy_vtk(path)
    names = _names(found, options)
    value = {what: found.data[name] for what, name in names.items()}
    for what, array in value.items():
        width = 3 if what in ("velocity", "spin") else 1
        if array.shape[1] != width:
            raise CorruptFile(f"{path}: {names[what]} has {array.shape[1]} columns, not {width}")
    single = {what: array[:, 0] for what, array in value.items() if array.shape[1] == 1}
    radius = single.get("radius")
    if radius is None and "diameter" in single:
        radius = single["diameter"] / 2
    time = found.field.get("TIME")
    return FoundFrame(
        place=str(path),
        position=found.position,
        radius=radius,
        number=_numbers(single.get("id"), path),
        mass=single.get("mass"),
        velocity=value.get("velocity"),
        spin=value.get("spin"),
        time=float(time[0]) if time is not None and len(time) == 1 else None,
        step=_step(path),
    )


def _numbers(column: Array | None, path: Path) -> np.ndarray | None:
    if column is None:
        return None
    if not ((np.abs(column) < 2**53) & (column == np.rint(column))).all():
        raise CorruptFile(f"{path}: an id is not a whole number")
    return column.astype(np.int64)


def _holds_contacts(path: Path) -> bool | None:
    """Whether a file has points for something else than grains; None where it has no points."""
    if path.stat().st_size == 0:
        return None
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if re.search(rb"\nPOINTS[ \t]+0*[1-9]", data) is None:
            return None
        return data.find(b"\nPOINT_DATA") < 0 and data.find(b"\nVERTICES") < 0


def _families(paths: Sequence[Path]) -> tuple[list[Path], list[list[Path]]]:
    """Files of grains in the order of their steps, and those of contacts by name."""
    by_name: dict[str, list[Path]] = {}
    for path in sorted(paths, key=lambda path: (_step(path) or 0, path.name)):
        by_name.setdefault(f"{path.parent}/{re.sub(r'[0-9]+', '#', path.name)}", []).append(path)
    kinds: dict[bool | None, list[list[Path]]] = {False: [], True: [], None: []}
    for family in by_name.values():
        told = (kind for kind in map(_holds_contacts, family) if kind is not None)
        kinds[next(told, None)].append(family)
    contacts = kinds[True]  # files without points are what lacks: grains, else contacts
    (contacts if kinds[False] else kinds[False]).extend(kinds[None])
    grains = [path for family in kinds[False] for path in family]
    return sorted(grains, key=lambda path: (_step(path) or 0, path.name)), contacts


def _beside(grains: Sequence[Path], family: Sequence[Path]) -> dict[Path, Path]:
    """The file of contacts that belongs to each file of grains: of its step, else in order."""
    by_step = {_step(path): path for path in family}
    found = {path: by_step[_step(path)] for path in grains if _step(path) in by_step}
    if found or not grains:
        return found
    if len(family) != len(grains):
        raise MissingData(
            f"{family[0]}: no step of these {len(family)} files of contacts is among those of the "
            f"{len(grains)} files of grains"
        )
    return dict(zip(grains, family, strict=True))


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    grains, families = _families(paths)
    if not grains:
        raise MissingData(f"{paths[0]}: contacts without their grains; give those files too")
    beside = [_beside(grains, family) for family in families]
    order = [path for path in grains if all(path in found for found in beside)]
    notes = [_NO_BOX] if families else [_BY_GAP, _NO_BOX]
    if not order:
        raise MissingData(f"{families[0][0]}: no step has grains and all kinds of contacts")
    if len(order) < len(grains):
        notes.append(f"left out: {len(grains) - len(order)} frames of grains without contacts")
    first = read_legacy_vtk(order[0])
    used = {*_names(first, options).values(), *_PASSED}
    return LazyFrames(
        count=len(order),
        parse=lambda k: _frame(order[k], [found[order[k]] for found in beside], options),
        unknown=[name for name in first.data if name not in used],
        notes=notes,
    )


FORMAT = ForeignFormat(
    key="liggghts_vtk", name="legacy VTK points (LIGGGHTS)", matches=_matches, open=_open
)
