"""Simulations in RigidLibrary's layout: ``PosVel<k>.dat``, ``Contact<k>.dat``, ``posinit.dat``.

Rows of PosVel are ``x y angle vx vy omega contacts``, velocities without the mean shear; of Contact
``i j nx ny fully_mobilised f_n`` and two columns whose sum is the tangential force (elastic,
viscous), counted from 0; column 4 of posinit is the radius. n points from i to j; the force on j is
f_n n − f_t t with t = (−n_y, n_x), which is what balances the forces. The box is in
``Parameters_final.dat`` (or ``Parameters_LE.par``), else the user's; how far its upper image has
moved is found by :class:`granufab.io.readers.lees_edwards.Offsets`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.readers.lees_edwards import Offsets
from granufab.io.text_rows import integers, number_fault, whole_text
from granufab.io.text_table import parse_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_NAME = re.compile(r"(PosVel|Contact)(\d+)\.dat")
_PARAMETERS = {"Parameters_final.dat": 1, "Parameters_LE.par": 2}
"""Parameter files, and the column of the value."""


def _matches(path: Path, head: bytes) -> bool:
    if path.is_dir():
        return (path / "posinit.dat").is_file() and any(path.glob("PosVel*.dat"))
    return bool(_NAME.fullmatch(path.name)) or path.name in ("posinit.dat", *_PARAMETERS)


@dataclass(slots=True, kw_only=True)
class _Files:
    """The files of one simulation."""

    position: dict[int, Path] = field(default_factory=dict)
    contact: dict[int, Path] = field(default_factory=dict)
    start: Path | None = None
    parameters: Path | None = None


def _files(paths: Sequence[Path]) -> _Files:
    found = _Files()
    for path in chain.from_iterable(one.iterdir() if one.is_dir() else [one] for one in paths):
        named = _NAME.fullmatch(path.name)
        if named:
            kind = found.position if named[1] == "PosVel" else found.contact
            kind[int(named[2])] = path
        elif path.name == "posinit.dat":
            found.start = path
        elif path.name in _PARAMETERS:
            found.parameters = path
    return found


def _parameters(path: Path | None) -> dict[str, str]:
    if path is None:
        return {}
    column = _PARAMETERS[path.name]
    rows = (line.split() for line in whole_text(path).split("\n"))
    return {row[0]: row[column] for row in rows if len(row) > column}


def _value(given: dict[str, str], name: str, path: Path | None) -> float | None:
    if name not in given:
        return None
    if fault := number_fault(given[name]):
        raise CorruptFile(f"{path}: the value of {name}: {fault}")
    return float(given[name])


def _table(path: Path, columns: int) -> Array:
    return parse_table(whole_text(path), range(columns), columns=columns, place=str(path))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Simulation:
    """A simulation whose frames are parsed on demand."""

    files: _Files
    snapshots: tuple[int, ...]
    radius: Array
    edges: Array
    offsets: Offsets | None
    interval: float | None

    def frame(self, k: int) -> FoundFrame:
        snapshot = self.snapshots[k]
        path = self.files.position[snapshot]
        table = _table(path, 7)
        if len(table) != len(self.radius):
            raise CorruptFile(
                f"{path}: ends with row {len(table)}, but posinit.dat has {len(self.radius)} grains"
            )
        contacts = self._contacts(snapshot, table)
        tilt = 0.0
        if self.offsets is not None:
            tilt = self.offsets.of(k, table[:, :2], contacts, str(path))
        matrix = np.array([[self.edges[0], tilt], [0.0, self.edges[1]]])
        return FoundFrame(
            place=str(path),
            position=table[:, :2],
            radius=self.radius,
            velocity=table[:, 3:5],
            spin=table[:, 5:6],
            dimension=2,
            cell=FoundCell(matrix=matrix, origin=-0.5 * self.edges, periodic=(True, True)),
            contacts=contacts,
            time=None if self.interval is None else snapshot * self.interval,
            step=snapshot,
        )

    def _contacts(self, snapshot: int, grains: Array) -> FoundContacts | None:
        path = self.files.contact.get(snapshot)
        if path is None:
            return None
        table = _table(path, 8)
        pair = integers(table[:, :2].ravel(), str(path), "grain").reshape(-1, 2)
        if grains[:, 6].sum() != 2 * len(table):
            raise CorruptFile(
                f"{path}: ends with row {len(table)}, but the grains of "
                f"{self.files.position[snapshot].name} count {grains[:, 6].sum() / 2:g} contacts"
            )
        wrong = (pair < 0) | (pair >= len(grains))
        if wrong.any():
            row = int(np.argwhere(wrong)[0, 0])
            raise CorruptFile(
                f"{path}: line {row + 1} joins grains {pair[row, 0]} and {pair[row, 1]}, but there "
                f"are {len(grains)} (0..{len(grains) - 1})"
            )
        return FoundContacts(
            place=str(path),
            first=pair[:, 0],
            second=pair[:, 1],
            normal=table[:, 2:4],
            normal_force=table[:, 5],
            tangential_size=-(table[:, 6] + table[:, 7]),
        )


def _edges(given: dict[str, str], path: Path | None, options: ReadOptions, place: Path) -> Array:
    """Edges of the box, from the parameters or else the user."""
    found = [_value(given, name, path) for name in ("boxVec1x", "boxVec2y")]
    if found[0] is not None and found[1] is not None:
        edges = np.array(found, float)
    elif options.cell is not None:
        if len(options.cell) not in (2, 4):
            raise InvalidSettings(f"cell has {len(options.cell)} numbers, a 2D one needs 2 or 4")
        edges = np.array(options.cell[-2:], float)
    else:
        raise MissingData(
            f"{place}: no Parameters_final.dat, so the box is unknown; give --cell LX,LY"
        )
    if not (edges > 0).all():
        raise CorruptFile(
            f"{path or place}: column 2 of boxVec1x, boxVec2y: the box has edges "
            f"{edges.tolist()}, must be > 0"
        )
    return edges


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    files = _files(paths)
    if files.start is None or not files.position:
        lacks = "posinit.dat, which has the radii" if files.start is None else "a PosVel file"
        raise MissingData(f"{paths[0]}: give the whole folder: it lacks {lacks}")
    notes: list[str] = []
    snapshots = sorted(files.position)
    if files.contact:
        snapshots = [k for k in snapshots if k in files.contact]
        if len(snapshots) < len(files.position):
            notes.append(f"{len(files.position) - len(snapshots)} frames without contacts left out")
    if not snapshots:
        raise MissingData(f"{paths[0]}: no PosVel file has the number of a Contact file")
    given = _parameters(files.parameters)
    edges = _edges(given, files.parameters, options, files.position[snapshots[0]])
    interval = _value(given, "tprint", files.parameters)
    rate = _value(given, "strain_rate", files.parameters)
    radius = parse_table(whole_text(files.start), (3,), columns=4, place=str(files.start))[:, 0]
    sheared = given.get("BCtype", "Periodic_Edwards").endswith("Edwards")
    offsets = None
    if sheared:
        told = None
        if interval is not None and rate is not None:
            told = [edges[1] * rate * interval * k for k in snapshots]
        offsets = Offsets(edges=edges, radius=radius, told=told)
        notes.append(
            "Lees–Edwards offset: from the contacts across the upper edge"
            + ("" if told is None else ", with strain_rate and tprint of the parameters")
        )
    simulation = _Simulation(
        files=files, snapshots=tuple(snapshots), radius=radius, edges=edges, offsets=offsets,
        interval=interval,
    )  # fmt: skip
    return LazyFrames(count=len(snapshots), parse=simulation.frame, notes=tuple(notes))


FORMAT = ForeignFormat(
    key="rigidlib", name="RigidLibrary simulation folder", matches=_matches, open=_open
)
