"""Rockable's conf files and the shapes that they name.

Rows of particles are ``shape group cluster homothety pos(3) vel(3) acc(3) Q(4) vrot(3) arot(3)``;
the first ``nDriven`` are walls. Rows of interactions are ``i j type isub jsub n(3) dn pos(3) vel(3)
f_n f_t(3) mom(3) damp``: n points from j to i, f_n > 0 pushes, the forces act on i. Two
sphero-polyhedra may touch at several vertices, edges and faces: each is a contact. The radius of a
shape that is no sphere is that of equal volume. Several conf files, or a folder of them, are a
series.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from sys import intern

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.readers.keyword_lines import Lines
from granufab.io.readers.rockable_shapes import Shape, read_shapes
from granufab.io.text_rows import first_bytes, in_order, number_fault
from granufab.packing import Array

__all__ = ["FORMAT"]

_KINDS = ((0, 0), (0, 1), (0, 2), (1, 1))
"""Vertex (0), edge (1) or face (2) of i and of j, by the type of the interaction."""
_PART = 1 << 40
_WORDS = ("t", "nDriven", "usePeriodicCell", "h")
"""Keywords whose values are used."""


def _is_conf(head: bytes) -> bool:
    return head.startswith(b"Rockable ")


def _matches(path: Path, head: bytes) -> bool:
    if path.is_dir():
        return any(_is_conf(first_bytes(one)) for one in sorted(path.glob("*conf*"))[:1])
    return _is_conf(head) or head.lstrip().startswith(b"<\nname ")


@dataclass(slots=True)
class _Conf:
    """What one file says."""

    words: dict[str, list[str]] = field(default_factory=dict)
    density: dict[int, float] = field(default_factory=dict)
    shape: list[str] = field(default_factory=list)
    body: array[float] = field(default_factory=lambda: array("d"))
    contact: array[float] = field(default_factory=lambda: array("d"))
    listed: bool = False


def _parse(path: Path) -> _Conf:
    conf, lines = _Conf(), Lines(path)
    while (words := lines.next_words()) is not None:
        if len(words) < 2 or words[0].startswith(("#", "!")):
            continue
        if words[0] == "Particles":
            for _ in range(lines.count(words[1], "particles")):
                _add_body(conf, lines)
        elif words[0] == "Interactions":
            conf.listed = True
            for _ in range(lines.count(words[1], "interactions")):
                row = [lines.number(word) for word in lines.needed("interactions")]
                if len(row) != 23:
                    raise CorruptFile(f"{lines.place} has {len(row)} columns, expected 23")
                conf.contact.extend(row)
        elif words[0] == "density" and len(words) == 3:
            group = lines.integer(lines.number(words[1]), "group")
            conf.density[group] = lines.number(words[2])
        elif conf.body and len(words) == 23 and (words[0].isdecimal() or words[0] in conf.shape):
            raise CorruptFile(f"{lines.place} is a row more than the list before it announces")
        elif not conf.body and words[0] in _WORDS:
            conf.words[words[0]] = words[1:]
    if not conf.body or not conf.listed:
        lacks = "Interactions" if conf.body else "Particles"
        raise CorruptFile(f"{path}: line {lines.at}: no {lacks} up to the end: it is cut off")
    return conf


def _add_body(conf: _Conf, lines: Lines) -> None:
    """One row of the particles; rows beginning with # are not counted, with ! not there."""
    words = lines.needed("particles")
    while words[0].startswith("#"):
        words = lines.needed("particles")
    if words[0].startswith("!"):
        return
    if len(words) not in (23, 32):
        raise CorruptFile(f"{lines.place} has {len(words)} columns, expected 23")
    conf.shape.append(intern(words[0]))
    conf.body.extend(lines.number(word) for word in words[1:23])


def _frame(path: Path, shapes_file: Path) -> FoundFrame:
    conf, shapes = _parse(path), read_shapes(shapes_file)
    for name in conf.shape:
        if name not in shapes:
            raise MissingData(f"{path}: shape {name!r} is not in {shapes_file.name}; give its .shp")
    of_body = [shapes[name] for name in conf.shape]
    body = np.array(conf.body).reshape(-1, 22)
    driven = int(_number(conf, "nDriven", path, 0.0))
    if driven > len(body):
        raise CorruptFile(
            f"{path}: the header's nDriven is {driven}, but there are {len(body)} bodies"
        )
    wall = np.arange(len(body)) < driven
    return FoundFrame(
        place=str(path),
        position=body[:, 3:6],
        radius=body[:, 2] * np.array([shape.radius for shape in of_body]),
        wall=wall,
        mass=_mass(conf, body, of_body),
        velocity=body[:, 6:9],
        spin=body[:, 16:19],
        dimension=3,
        cell=_cell(conf, path),
        contacts=_contacts(conf, path),
        round=all(shape.round for shape, fixed in zip(of_body, wall, strict=True) if not fixed),
        time=_number(conf, "t", path, 0.0),
    )


def _number(conf: _Conf, name: str, path: Path, default: float) -> float:
    words = conf.words.get(name)
    if words is None:
        return default
    fault = number_fault(words[0])
    if not fault and abs(float(words[0])) > 1e15:
        fault = f"{words[0][:40]} is too large"
    if fault:
        raise CorruptFile(f"{path}: the header's {name}: {fault}")
    return float(words[0])


def _mass(conf: _Conf, body: Array, shapes: Sequence[Shape]) -> Array | None:
    """Density times volume, where every group has a density."""
    density = [conf.density.get(int(group)) for group in body[:, 0]]
    if any(value is None for value in density):
        return None
    volume = body[:, 2] ** 3 * np.array([shape.volume for shape in shapes])
    return np.array(density, float) * volume


def _cell(conf: _Conf, path: Path) -> FoundCell | None:
    if _number(conf, "usePeriodicCell", path, 0.0) != 1.0:
        return None
    try:
        matrix = np.array([float(word) for word in conf.words.get("h", [])]).reshape(3, 3)
    except ValueError:
        raise CorruptFile(f"{path}: the periodic cell h has no 9 numbers") from None
    return FoundCell(matrix=matrix, origin=np.zeros(3), periodic=(True, True, True))


def _contacts(conf: _Conf, path: Path) -> FoundContacts:
    table = np.array(conf.contact).reshape(-1, 23)
    whole = table[:, :5]
    bad = (whole != np.floor(whole)) | (whole < 0) | (whole >= _PART)
    bad[:, 2] |= whole[:, 2] >= len(_KINDS)
    if bad.any():
        row = int(np.argwhere(bad)[0, 0])
        raise CorruptFile(f"{path}: interaction {row} joins {whole[row].tolist()}: no such parts")
    number = whole.astype(np.int64)
    kind = np.array(_KINDS, np.int64)[number[:, 2]]
    return FoundContacts(
        first=number[:, 0],
        second=number[:, 1],
        part=number[:, 3:5] + kind * _PART,
        normal=table[:, 5:8],
        gap=table[:, 8],
        point=table[:, 9:12],
        normal_force=table[:, 15],
        tangential_force=table[:, 16:19],
        force_on="first",
        normal_to="first",
    )


def _shapes_file(conf: Path, given: Sequence[Path]) -> tuple[Path, str | None]:
    """The shapes: given, else named by the conf and beside it, else the only ones beside it."""
    if given:
        return given[0], None
    named = _named_shapes(conf)
    if named is not None and (conf.parent / named).is_file():
        return conf.parent / named, None
    beside = sorted(conf.parent.glob("*.shp"))
    if len(beside) == 1:
        return beside[0], f"shapes from {beside[0].name}, the only ones beside the conf file"
    raise MissingData(
        f"{conf}: its shapes are in {named or 'a .shp file'}, which is not beside it; give it too"
    )


def _named_shapes(conf: Path) -> str | None:
    """Name of the file of shapes; folders in it are those of another machine."""
    with conf.open("rb") as stream:
        for raw in stream.readlines(1 << 16):
            words = raw.decode("utf-8", errors="replace").split()
            if words[:1] == ["shapeFile"] and len(words) == 2:
                return Path(words[1]).name
    return None


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    files: list[Path] = []
    for path in paths:
        files += in_order([*path.glob("*conf*"), *path.glob("*.shp")]) if path.is_dir() else [path]
    shapes = [path for path in files if path.suffix == ".shp"]
    confs = [path for path in files if path.suffix != ".shp"]
    if not confs:
        raise MissingData(f"{paths[0]}: shapes only; give the conf file too")
    shapes_file, note = _shapes_file(confs[0], shapes)
    return LazyFrames(
        count=len(confs),
        parse=lambda k: _frame(confs[k], shapes_file),
        notes=() if note is None else (note,),
    )


FORMAT = ForeignFormat(key="rockable", name="Rockable conf", matches=_matches, open=_open)
