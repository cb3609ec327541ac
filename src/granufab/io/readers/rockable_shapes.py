"""Shapes of Rockable: blocks ``< name … radius … volume … nv … >`` of a ``.shp`` file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from granufab.errors import CorruptFile
from granufab.io.readers.keyword_lines import Lines

__all__ = ["Shape", "read_shapes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A sphero-polyhedron.

    Attributes:
        radius: of the sphere of equal volume.
        volume: of the body.
        round: whether it is one sphere.
    """

    radius: float
    volume: float
    round: bool


def read_shapes(path: Path) -> dict[str, Shape]:
    """The shapes of a file by name.

    Raises:
        CorruptFile: a block is cut off or lacks its radius.
    """
    lines = Lines(path)
    shapes: dict[str, Shape] = {}
    values: dict[str, str] | None = None
    while (words := lines.next_words()) is not None:
        if words[:1] == ["<"]:
            values = {}
        elif words[:1] == [">"] and values is not None:
            shapes[values.get("name", "")] = _shape(values, lines)
            values = None
        elif values is not None and len(words) == 2:
            values.setdefault(words[0], words[1])
    if values is not None or not shapes:
        raise CorruptFile(f"{path}: line {lines.at}: the last shape does not end with '>'")
    return shapes


def _shape(values: dict[str, str], lines: Lines) -> Shape:
    for name in ("name", "radius", "nv"):
        if name not in values:
            raise CorruptFile(f"{lines.place}: the shape that ends here has no {name!r}")
    single = lines.integer(lines.number(values["nv"]), "nv") == 1
    radius = lines.number(values["radius"])
    volume = lines.number(values["volume"]) if "volume" in values else 0.0
    if not volume > 0:
        if not single:
            raise CorruptFile(f"{lines.place}: shape {values['name']} has no volume > 0")
        volume = 4.0 / 3.0 * math.pi * radius**3
    if not single:
        radius = (3.0 * volume / (4.0 * math.pi)) ** (1.0 / 3.0)
    return Shape(radius=radius, volume=volume, round=single)
