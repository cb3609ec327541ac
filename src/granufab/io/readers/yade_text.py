"""Packings that YADE's text export writes: rows ``x y z r``, with more columns after them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from granufab.errors import MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.text_table import number_table

__all__ = ["FORMAT"]

NOTE = "positions and radii only: contacts are found by gap"
_SUFFIXES = ("", ".txt", ".spheres", ".dat")


def _matches(path: Path, head: bytes) -> bool:
    """``#format x_y_z_r…``, or rows of four or more numbers, the fourth positive."""
    if head.startswith(b"#format"):
        return b"x_y_z_r" in head.splitlines()[0]
    lines = [line for line in head.splitlines()[:-1] if line and not line.startswith(b"#")]
    if path.suffix not in _SUFFIXES or not lines:
        return False
    try:
        rows = [[float(word) for word in line.split()] for line in lines]
    except ValueError:
        return False
    widths = {len(row) for row in rows}
    return len(widths) == 1 and widths <= {4, 5} and all(row[3] > 0 for row in rows)


def _packing(path: Path) -> FoundFrame:
    table = number_table(path, range(4))
    return FoundFrame(place=str(path), position=table[:, :3], radius=table[:, 3])


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    if len(paths) != 1:
        raise MissingData(f"{paths[1]}: a YADE text export is one file, got {len(paths)}")
    return LazyFrames(count=1, parse=lambda _: _packing(paths[0]), notes=(NOTE,))


FORMAT = ForeignFormat(key="yade", name="YADE text export", matches=_matches, open=_open)
