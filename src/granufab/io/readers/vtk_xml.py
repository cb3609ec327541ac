"""VTK's XML files .vtp and .vtu: grains as points with a radius, contacts as lines or cells.

Grains are a file whose points have an array radius, radii, r or diameter. Contacts are a second
file: cells or points with two numbers (id1, id2), else lines whose ends lie at centres of grains.
Several files of grains are the frames of a series, each with its file of contacts, both in the
order given. Conventions of the listed forces are ours: on the second grain, compression positive;
lines with id1 and id2 but without normals are those of LIGGGHTS (:mod:`granufab.io.line_contacts`).
"""

from __future__ import annotations

import mmap
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.line_contacts import line_contacts
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import integers
from granufab.io.vtk_arrays import VtkFile, is_vtk_xml
from granufab.packing import Array, IntArray

__all__ = ["FORMAT"]

RADIUS = ("radius", "radii", "r")
DIAMETER = ("diameter", "diameters", "d")
NUMBER = ("id", "ids", "body_id", "number", "particleid")
PAIR = (("id1", "id2"), ("id_1", "id_2"), ("i", "j"), ("particle1", "particle2"))
NEAR = 1e-3
"""Largest distance, in radii, of a line's end from the centre that it stands for."""

_NAME = re.compile(rb"\bName=[\"']([^\"'<>]*)[\"']")

Columns = dict[str, NDArray]


def _matches(path: Path, head: bytes) -> bool:
    return is_vtk_xml(head, "PolyData", "UnstructuredGrid")


def _pieces(file: VtkFile, tag: str, counts: Sequence[str]) -> Columns:
    """The arrays of one kind, all pieces together, by their names in lower case."""
    found: dict[str, list[NDArray]] = {}
    for piece in file.pieces():
        rows = sum(file.count(piece, name) for name in counts)
        for element in piece.findall(f"{tag}/DataArray"):
            if element.get("type") != "String":
                name = (element.get("Name") or tag).lower()
                found.setdefault(name, []).append(file.array(element, rows))
    try:
        return {name: np.concatenate(parts) for name, parts in found.items()}
    except ValueError:
        raise file.corrupt(f"the pieces' arrays of {tag} differ in their components") from None


def _points(file: VtkFile) -> Array:
    columns = list(_pieces(file, "Points", ("NumberOfPoints",)).values())
    if not columns or columns[0].ndim != 2 or columns[0].shape[1] != 3:
        raise file.corrupt("array Points is missing, or has no three coordinates")
    return columns[0].astype(float)


def _cells(file: VtkFile) -> Columns:
    counts = ("NumberOfCells", "NumberOfVerts", "NumberOfLines", "NumberOfStrips", "NumberOfPolys")
    return _pieces(file, "CellData", counts)


def _first(columns: Columns, names: Sequence[str], width: int, count: int) -> NDArray | None:
    """The first of these arrays that has this width."""
    for name in names:
        if name in columns:
            values = columns[name]
            if values.shape == ((count,) if width == 1 else (count, width)):
                return values
    return None


def _is_grains(path: Path) -> bool:
    """Whether points have a radius, from the names alone: nothing is decoded."""
    if path.stat().st_size == 0:
        return False
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = data.find(b"<PointData")
        end = data.find(b"</PointData>", start)
        if start < 0 or end < 0:
            return False
        names = {one[1].decode("utf-8", "replace").lower()
                 for one in _NAME.finditer(data, start, end)}  # fmt: skip
    return bool(names & {*RADIUS, *DIAMETER})


def _field(file: VtkFile, name: str) -> NDArray | None:
    for element in file.root.iter("FieldData"):
        for one in element.findall("DataArray"):
            if one.get("Name") == name:
                return file.array(one).ravel()
    return None


def _cell(file: VtkFile) -> FoundCell | None:
    """The cell that our own writer adds."""
    matrix, origin = _field(file, "cell_matrix"), _field(file, "cell_origin")
    periodic = _field(file, "cell_periodic")
    if matrix is None or origin is None or periodic is None:
        return None
    size = len(origin)
    if size not in (2, 3) or len(matrix) != size * size or len(periodic) != size:
        raise file.corrupt(f"the cell has {len(matrix)} numbers and an origin of {size}")
    return FoundCell(
        matrix=matrix.astype(float).reshape(size, size),
        origin=origin.astype(float),
        periodic=tuple(bool(p) for p in periodic),
    )


def _grains(path: Path, contacts: Path | None) -> FoundFrame:
    file = VtkFile(path)
    position, columns = _points(file), _pieces(file, "PointData", ("NumberOfPoints",))
    count = len(position)
    radius = _first(columns, RADIUS, 1, count)
    if radius is None:
        diameter = _first(columns, DIAMETER, 1, count)
        radius = None if diameter is None else diameter / 2
    number = _first(columns, NUMBER, 1, count)
    if number is not None and len(np.unique(number)) != count:
        number = None  # a colour or a cluster, not an identity
    dimension, time = _field(file, "dimension"), _field(file, "TimeValue")
    flat = dimension is not None and dimension.tolist() == [2]
    velocity = _first(columns, ("velocity", "linvelvec", "v"), 3, count)
    spin = _first(columns, ("spin", "angular_velocity", "angvelvec", "omega"), 3, count)
    return FoundFrame(
        place=str(path),
        position=position,
        radius=radius,
        number=None if number is None else integers(number, str(path), "id"),
        mass=_first(columns, ("mass",), 1, count),
        velocity=velocity,
        spin=spin,
        dimension=2 if flat else None,
        cell=_cell(file),
        contacts=None if contacts is None else _contacts(contacts, position, radius, number),
        time=None if time is None or len(time) != 1 else float(time[0]),
    )


def _contacts(
    path: Path, position: Array, radius: NDArray | None, number: NDArray | None
) -> FoundContacts:
    file = VtkFile(path)
    columns = _cells(file)
    pair = _pair(columns, path)
    if {"id1", "id2"} <= set(columns) and "normal" not in columns:
        points, lines = _lines(file)
        if len(lines) == len(columns["id1"]):
            cells = {name: values.astype(float).reshape(len(values), -1)
                     for name, values in columns.items()}  # fmt: skip
            return line_contacts(
                str(path), points, lines, cells, position=position, radius=radius, number=number
            )
    if pair is None:
        points = _pieces(file, "PointData", ("NumberOfPoints",))
        pair = _pair(points, path)
        columns = columns if pair is None else points
    if pair is None:
        pair = _ends(file, position, radius)
        if number is not None:
            pair = integers(number, str(path), "id")[pair]
    count = len(pair)
    gap, overlap = (_first(columns, (name,), 1, count) for name in ("gap", "overlap"))
    if gap is None and overlap is not None:
        gap = -overlap
    return FoundContacts(
        place=str(path),
        first=pair[:, 0],
        second=pair[:, 1],
        normal=_first(columns, ("normal", "n"), 3, count),
        gap=gap,
        force=_first(columns, ("force", "f"), 3, count),
        normal_force=_first(columns, ("normal_force", "forcen", "fn"), 1, count),
        tangential_force=_first(columns, ("shear_force", "tangential_force", "ft"), 3, count),
    )


def _pair(columns: Columns, path: Path) -> IntArray | None:
    for one, two in PAIR:
        if one in columns and two in columns:
            both = [columns[one], columns[two]]
            if all(column.ndim == 1 for column in both):
                return np.stack([integers(ids, str(path), one) for ids in both], axis=1)
    return None


def _ends(file: VtkFile, position: Array, radius: NDArray | None) -> IntArray:
    """The grains at the two ends of each line."""
    points, line = _lines(file)
    if len(line) == 0:
        raise MissingData(
            f"{file.path}: has neither points with a radius, nor contacts with id1 and id2, nor "
            "lines between centres"
        )
    if line.min() < 0 or line.max() >= len(points):
        raise file.corrupt(f"a line joins point {int(line.max())}, there are {len(points)}")
    if not np.isfinite(points).all():
        raise file.corrupt("a point is not finite")
    distance, grain = cKDTree(position).query(points[line.ravel()])
    reach = NEAR * (1.0 if radius is None else float(np.min(radius)))
    far = np.asarray(distance) > reach
    if far.any():
        raise CorruptFile(
            f"{file.path}: line {int(np.argmax(far)) // 2} ends at no centre of a "
            "grain; contacts need id1 and id2, or lines between centres"
        )
    return np.asarray(grain, np.int64).reshape(-1, 2)


def _lines(file: VtkFile) -> tuple[Array, IntArray]:
    """The points, and those at the ends of each line."""
    ends, start = [], 0
    for piece in file.pieces():
        ends.append(_line_ends(file, piece) + start)
        start += file.count(piece, "NumberOfPoints")
    return _points(file), np.concatenate(ends) if ends else np.zeros((0, 2), np.int64)


def _line_ends(file: VtkFile, piece: Element) -> IntArray:
    for tag, rows in (("Lines", "NumberOfLines"), ("Cells", "NumberOfCells")):
        count = file.count(piece, rows)
        parts = {one.get("Name"): one for one in piece.findall(f"{tag}/DataArray")}
        if count and {"connectivity", "offsets"} <= set(parts):
            ends = integers(file.array(parts["offsets"], count), str(file.path), "offset")
            joined = integers(file.array(parts["connectivity"]), str(file.path), "point")
            if not (np.diff(ends, prepend=0) == 2).all() or ends[-1] != len(joined):
                raise file.corrupt("its cells do not have two points each")
            return joined.reshape(-1, 2)
    return np.zeros((0, 2), np.int64)


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    grains, contacts = [], []
    for path in paths:
        (grains if _is_grains(path) else contacts).append(path)
    if not grains:
        raise MissingData(f"{paths[0]}: no points with a radius or diameter; give that file too")
    if contacts and len(contacts) != len(grains):
        raise MissingData(
            f"{paths[0]}: got {len(grains)} files of grains and {len(contacts)} of contacts; "
            "each state needs one of both"
        )
    return LazyFrames(
        count=len(grains),
        parse=lambda index: _grains(grains[index], contacts[index] if contacts else None),
    )


FORMAT = ForeignFormat(key="vtp", name="VTK XML (.vtp, .vtu)", matches=_matches, open=_open)
"""Points and lines of VTK."""
