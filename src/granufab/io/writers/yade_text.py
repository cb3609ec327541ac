"""YADE's text packings: ``#format x_y_z_r`` and one row a sphere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from granufab.io.foreign_writer import ForeignWriter
from granufab.io.writers.columns import in_space, only_state, rows
from granufab.packing import Packing

__all__ = ["YADE", "write_yade_text"]


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    grains = only_state(states).grains
    with files[0].open("w", encoding="utf-8", newline="\n") as stream:
        stream.write("#format x_y_z_r\n")
        stream.writelines(rows([in_space(grains.position), grains.radius]))


YADE = ForeignWriter(
    key="yade",
    name="YADE text",
    suffixes=(".txt", ".spheres"),
    fill=_fill,
    left_out="contacts, velocities, cell",
)
"""Positions and radii for YADE's ``ymport.text``."""


def write_yade_text(packing: Packing, path: Path | str, *, force: bool = False) -> tuple[Path, ...]:
    """Positions and radii as YADE's ``ymport.text`` reads them; see :meth:`ForeignWriter.save`."""
    return YADE.save([packing], path, force=force)
