"""ON-DEM VTKHDF, draft 0.1: points of /VTKHDF with radius and body_id, pairs of /ONDEM.

Normals point from id1 to id2 and shear forces act on id2. The draft calls normal forces positive
in traction, the files that its own exporter writes are positive in compression: an attribute
``positive_in`` of ``normal_force`` decides, else the sign of the listed overlaps, else the draft.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.plain_hdf5 import PlainHdf5, holds_groups, open_plain
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import integers
from granufab.packing import Array, IntArray

__all__ = ["CELL", "FORMAT", "PAIRS", "POINTS"]

POINTS = "VTKHDF/PointData"
PAIRS = "ONDEM/Interactions"
CELL = "ONDEM/Cell"
"""Our own addition: matrix, origin and periodic of the cell, which the draft has no place for."""

NOTE = (
    "normal forces: the draft says positive in traction; where overlaps are listed their sign "
    "decides"
)


def _matches(path: Path, head: bytes) -> bool:
    return holds_groups(path, head, "VTKHDF")


def _numbers(file: PlainHdf5, name: str, count: int) -> Array | None:
    """An optional dataset of as many rows; None where it is missing or not finite."""
    if not file.has(name):
        return None
    values = file.array(name, rows=count).astype(float)
    return values if np.isfinite(values).all() else None


def _whole(file: PlainHdf5, name: str, count: int | None = None) -> IntArray:
    """A dataset of whole numbers."""
    return integers(file.array(name, rows=count).ravel(), f"{file.path}: {name}", "the number")


def _compression(file: PlainHdf5, force: Array, overlap: Array | None) -> Literal[1, -1]:
    """The sign of ``normal_force`` in a squeezed contact."""
    said = file.attributes(f"{PAIRS}/normal_force").get("positive_in")
    if said in ("traction", "compression"):
        return 1 if said == "compression" else -1
    together = 0.0 if overlap is None else float(np.nansum(np.sign(overlap) * force))
    return 1 if together > 0 else -1


def _others(file: PlainHdf5, spheres: IntArray) -> IntArray:
    """Numbers of bodies that are no spheres: walls, facets."""
    known = [np.zeros(0, np.int64)]
    for group in file.children("ONDEM/Bodies"):
        name = f"ONDEM/Bodies/{group}/body_id"
        if file.has(name):
            known.append(_whole(file, name))
    return np.setdiff1d(np.concatenate(known), spheres)


def _contacts(file: PlainHdf5, spheres: IntArray) -> FoundContacts:
    first = _whole(file, f"{PAIRS}/id1")
    count = len(first)
    second = _whole(file, f"{PAIRS}/id2", count)
    virtual = _numbers(file, f"{PAIRS}/virtual", count)
    keep = np.ones(count, bool) if virtual is None else virtual.reshape(count) == 0
    values = {
        name: _numbers(file, f"{PAIRS}/{name}", count)
        for name in ("normal", "normal_force", "shear_force", "contact_point", "overlap")
    }
    for name, width in (("normal", 3), ("shear_force", 3), ("contact_point", 3)):
        value = values[name]
        if value is not None and value.shape != (count, width):
            raise file.corrupt(f"{PAIRS}/{name} has shape {value.shape}, expected {(count, width)}")
    chosen = {name: None if v is None else v[keep] for name, v in values.items()}
    force, overlap = chosen["normal_force"], chosen["overlap"]
    for name, value in (("normal_force", force), ("overlap", overlap)):
        if value is not None and value.ndim != 1:
            raise file.corrupt(f"{PAIRS}/{name} has {value.ndim} dimensions, expected 1")
    others = _others(file, spheres)
    return FoundContacts(
        first=first[keep],
        second=second[keep],
        wall=(np.isin(first, others) | np.isin(second, others))[keep],
        normal=chosen["normal"],
        point=chosen["contact_point"],
        gap=None if overlap is None else -overlap,
        normal_force=force,
        tangential_force=chosen["shear_force"],
        compression=-1 if force is None else _compression(file, force, overlap),
    )


def _cell(file: PlainHdf5) -> FoundCell | None:
    if not file.has(CELL):
        return None
    matrix = file.array(f"{CELL}/matrix").astype(float)
    origin = file.array(f"{CELL}/origin").astype(float)
    periodic = file.array(f"{CELL}/periodic").ravel()
    if matrix.shape != (len(origin), len(origin)) or len(periodic) != len(origin):
        raise file.corrupt(f"{CELL} has a matrix of shape {matrix.shape}")
    return FoundCell(matrix=matrix, origin=origin, periodic=tuple(bool(p) for p in periodic))


def _frame(path: Path) -> FoundFrame:
    with open_plain(path) as file:
        position = file.array("VTKHDF/Points").astype(float)
        count = len(position)
        if position.ndim != 2 or position.shape[1] != 3:
            raise file.corrupt(f"VTKHDF/Points has shape {position.shape}, expected (count, 3)")
        number = np.arange(count, dtype=np.int64)
        if file.has(f"{POINTS}/body_id"):
            number = _whole(file, f"{POINTS}/body_id", count)
        if len(np.unique(number)) != count:
            raise file.corrupt(f"{POINTS}/body_id: a number is given twice")
        values = {
            name: _numbers(file, f"{POINTS}/{name}", count)
            for name in ("radius", "mass", "velocity", "angular_velocity")
        }
        for name, value in values.items():
            shape = (count, 3) if "velocity" in name else (count,)
            if value is not None and value.shape != shape:
                raise file.corrupt(f"{POINTS}/{name} has shape {value.shape}, expected {shape}")
        scene = file.attributes("ONDEM/Scene")
        time, dimension = scene.get("time"), scene.get("dimension")
        return FoundFrame(
            place=str(path),
            position=position,
            radius=values["radius"],
            number=number,
            mass=values["mass"],
            velocity=values["velocity"],
            spin=values["angular_velocity"],
            dimension=int(dimension) if dimension in (2, 3) else None,
            cell=_cell(file),
            contacts=_contacts(file, number) if file.has(PAIRS) else None,
            time=float(time) if isinstance(time, float) else None,
        )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    return LazyFrames(count=len(paths), parse=lambda index: _frame(paths[index]), notes=(NOTE,))


FORMAT = ForeignFormat(key="vtkhdf", name="ON-DEM VTKHDF", matches=_matches, open=_open)
"""The exchange format of ON-DEM; several files are the frames of a series, in the order given."""
