"""Grains in legacy VTK files, as LIGGGHTS writes them: one file a frame, sorted by step.

Points are centres; the arrays ``radius`` (or ``diameter``), ``id``, ``v``, ``omega`` and ``mass``
are read. Contacts are found by gap. There is no box in such files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundFrame, LazyFrames, Source
from granufab.io.legacy_vtk import VtkPoints, is_legacy_vtk, read_legacy_vtk
from granufab.io.read_options import ReadOptions
from granufab.packing import Array

__all__ = ["FORMAT"]

_NOTE = "contacts are found by gap; there is no box in this format, --cell gives one"
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


def _frame(path: Path, options: ReadOptions) -> FoundFrame:
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


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    order = sorted(paths, key=lambda path: (_step(path) or 0, path.name))
    first = read_legacy_vtk(order[0])
    used = {*_names(first, options).values(), *_PASSED}
    return LazyFrames(
        count=len(order),
        parse=lambda index: _frame(order[index], options),
        unknown=[name for name in first.data if name not in used],
        notes=(_NOTE,),
    )


FORMAT = ForeignFormat(
    key="liggghts_vtk", name="legacy VTK points (LIGGGHTS)", matches=_matches, open=_open
)
