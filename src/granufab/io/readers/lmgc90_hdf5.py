"""LMGC90 HDF5: ``Evolution/ID_k`` with rigid bodies and contacts, columns named by ``Help``.

The file holds displacements only: BODIES.DAT, given with it, supplies reference positions and
radii. Columns differ between versions, so all of them are looked up in ``Help`` (1-based bounds).
Conventions are those of the text files (:mod:`granufab.io.readers.lmgc90_text`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.errors import MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.plain_hdf5 import PlainHdf5, holds_groups, open_plain
from granufab.io.read_options import ReadOptions
from granufab.io.readers.lmgc90_records import Bodies, read_bodies
from granufab.io.readers.lmgc90_text import NO_CELL, points_apart
from granufab.io.text_rows import integers

__all__ = ["FORMAT"]


def _matches(path: Path, head: bytes) -> bool:
    return holds_groups(path, head, "Evolution", "Help")


class _Table:
    """Two datasets of one group, columns by the names that Help gives them."""

    def __init__(self, file: PlainHdf5, place: str, group: str) -> None:
        self._file, self._group = file, group
        self._data = {name: file.array(f"{place}/{group}/{name}") for name in ("idata", "rdata")}
        self.rows = len(self._data["rdata"])
        for name, data in self._data.items():
            if data.ndim != 2 or len(data) != self.rows:
                raise file.corrupt(f"{place}/{group}/{name} has shape {data.shape}")

    def columns(self, name: str, field: str) -> NDArray:
        """Columns of a field, shape (rows, width)."""
        help_ = f"Help/{self._group}/{name}/{field}/bound"
        bound = self._file.array(help_).ravel()
        width = self._data[name].shape[1]
        if len(bound) != 2 or not 1 <= bound[0] <= bound[1] <= width:
            raise self._file.corrupt(f"{help_} is {bound.tolist()}, allowed: within 1..{width}")
        return self._data[name][:, int(bound[0]) - 1 : int(bound[1])]

    def named(self, field: str) -> dict[str, NDArray]:
        """Columns of a real field by their components, as in ``rl (t,n,s)``."""
        values = self.columns("rdata", field)
        text = self._file.text(f"Help/{self._group}/rdata/{field}/name")
        inside = re.search(r"\((.*)\)", text)
        names = [part.strip() for part in inside[1].split(",")] if inside else [field]
        if len(names) != values.shape[1]:
            raise self._file.corrupt(
                f"Help of {field} names {len(names)} components of {values.shape[1]}"
            )
        return {name: values[:, k] for k, name in enumerate(names)}


def _contacts(file: PlainHdf5, place: str, bodies: Bodies) -> FoundContacts:
    dimension = bodies.dimension
    table = _Table(file, place, "VlocRloc")
    numbers = table.columns("idata", "ibdyty")
    kinds = table.columns("idata", "bdyty")
    if numbers.shape[1] != 2 or kinds.shape[1] != 2:
        raise file.corrupt(f"{place}: pairs have {numbers.shape[1]} columns, expected 2")
    numbers = integers(numbers.ravel(), f"{file.path}: {place}", "body").reshape(-1, 2)
    normal, force = _forces(table, dimension)
    point = table.columns("rdata", "coor")
    return FoundContacts(
        first=numbers[:, 0],
        second=numbers[:, 1],
        wall=(kinds != _rigid(file, dimension)).any(axis=1),
        normal=normal,
        point=point if point.shape[1] == dimension else None,
        gap=table.columns("rdata", "gapTT")[:, 0],
        force=force,
        force_on="first",
        normal_to="first",
        part=None if bodies.round else points_apart(len(numbers)),
    )


def _forces(table: _Table, dimension: int) -> tuple[NDArray, NDArray]:
    """Normals, and forces on the candidates."""
    local = table.named("rl")
    frame = table.columns("rdata", "uc").astype(float)
    if dimension == 2:
        normal = frame[:, :2]
        tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
        return normal, local["n"][:, None] * normal + local["t"][:, None] * tangent
    t, normal, s = frame[:, 0:3], frame[:, 3:6], frame[:, 6:9]
    force = local["n"][:, None] * normal + local["t"][:, None] * t
    return normal, force + local["s"][:, None] * s


def _rigid(file: PlainHdf5, dimension: int) -> int:
    """The number that stands for rigid bodies among the body types."""
    if file.has("Help/parameters/bdyty/id"):
        names = file.texts("Help/parameters/bdyty/name")
        numbers = file.array("Help/parameters/bdyty/id").ravel()
        if f"RBDY{dimension}" in names[: len(numbers)]:
            return int(numbers[names.index(f"RBDY{dimension}")])
    return dimension - 1


def _frame(path: Path, step: str, bodies: Bodies) -> FoundFrame:
    dimension = bodies.dimension
    place, group = f"Evolution/{step}", f"RBDY{dimension}"
    with open_plain(path) as file:
        table = _Table(file, place, group)
        if table.rows != len(bodies.number):
            raise file.corrupt(
                f"{place} has {table.rows} bodies {group}, BODIES.DAT describes "
                f"{len(bodies.number)}"
            )
        move, speed = table.columns("rdata", "X"), table.columns("rdata", "V")
        if min(move.shape[1], speed.shape[1]) < dimension + 1:
            raise file.corrupt(f"{place}/{group} has {move.shape[1]} coordinates a body")
        order = np.argsort(np.argsort(bodies.number))
        hidden = table.columns("idata", "visible")[order, 0] == 0
        has = {name: file.has(f"{place}/{name}") for name in ("VlocRloc", "TPS", "NStep")}
        return FoundFrame(
            place=f"{path}: {place}",
            position=bodies.position + move[order, :dimension],
            radius=bodies.radius,
            number=bodies.number,
            wall=bodies.wall | hidden,
            velocity=speed[order, :dimension],
            spin=speed[order, dimension:],
            dimension=dimension,
            contacts=_contacts(file, place, bodies) if has["VlocRloc"] else None,
            round=bodies.round,
            time=float(file.array(f"{place}/TPS")) if has["TPS"] else None,
            step=int(file.array(f"{place}/NStep")) if has["NStep"] else None,
        )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    data, described = [], []
    for path in paths:
        with path.open("rb") as stream:
            (data if _matches(path, stream.read(4096)) else described).append(path)
    if len(data) != 1 or len(described) != 1:
        raise MissingData(
            f"{paths[0]}: LMGC90's HDF5 file holds displacements only; give BODIES.DAT with it "
            f"for reference positions and radii (got {len(described)} such files)"
        )
    bodies = read_bodies(described[0])
    with open_plain(data[0]) as file:
        steps = [name for name in file.children("Evolution") if re.fullmatch(r"ID_\d+", name)]
        steps.sort(key=lambda name: int(name[3:]))
        if not steps:
            raise file.corrupt("Evolution holds no ID_1, ID_2, …")
    return LazyFrames(
        count=len(steps),
        parse=lambda index: _frame(data[0], steps[index], bodies),
        notes=(NO_CELL,),
    )


FORMAT = ForeignFormat(
    key="lmgc90_hdf5",
    name="LMGC90 HDF5",
    matches=_matches,
    open=_open,
    completed_by=("lmgc90",),
)
"""HDF5 files of LMGC90."""
