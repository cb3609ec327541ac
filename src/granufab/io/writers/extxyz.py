"""Extended XYZ for OVITO and ASE: frame after frame, without contacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.io.foreign_writer import ForeignWriter
from granufab.io.writers.columns import in_space, numbers, rows, spins
from granufab.packing import Array, Packing

__all__ = ["EXTXYZ", "write_extxyz"]


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    with files[0].open("w", encoding="utf-8", newline="\n") as stream:
        for packing in states:
            columns = _columns(packing)
            stream.write(f"{packing.grains.count}\n{_header(packing, columns)}\n")
            stream.writelines("X " + row for row in rows(list(columns.values())))


def _columns(packing: Packing) -> dict[str, NDArray]:
    grains = packing.grains
    columns: dict[str, NDArray] = {"pos": in_space(grains.position), "radius": grains.radius}
    columns["id"] = numbers(packing)
    if grains.mass is not None:
        columns["mass"] = grains.mass
    if grains.velocity is not None:
        columns["velo"] = in_space(grains.velocity)
    if grains.spin is not None:
        columns["angular_velocity"] = spins(grains.spin)
    return columns


def _header(packing: Packing, columns: dict[str, NDArray]) -> str:
    kinds = [
        f"{name}:{'I' if values.dtype.kind == 'i' else 'R'}:{values.size // len(values)}"
        for name, values in columns.items()
    ]
    words = ["Properties=" + ":".join(["species:S:1", *kinds]), *_cell(packing)]
    if packing.dimension == 2:
        words.append("dimension=2")
    if packing.time is not None:
        words.append(f"Time={packing.time!r}")
    return " ".join(words)


def _cell(packing: Packing) -> list[str]:
    """Lattice, origin and periodic axes; flat cells are one largest diameter thick."""
    cell = packing.cell
    if cell is None:
        return []
    size, thick = packing.dimension, 2.0 * float(packing.grains.radius.max())
    matrix, origin = np.diag([0.0, 0.0, thick]), np.array([0.0, 0.0, -thick / 2])
    matrix[:size, :size] = cell.matrix
    origin[:size] = 0.0 if cell.origin is None else cell.origin
    wraps = ["T" if wrap else "F" for wrap in (*cell.periodic, *(False,) * (3 - size))]
    return [f'Lattice="{_text(matrix.T)}"', f'Origin="{_text(origin)}"', f'pbc="{" ".join(wraps)}"']


def _text(values: Array) -> str:
    return " ".join(map(repr, values.ravel().tolist()))


EXTXYZ = ForeignWriter(
    key="extxyz",
    name="extended XYZ",
    suffixes=(".xyz", ".extxyz"),
    fill=_fill,
    series=True,
    left_out="contacts",
)
"""One file of all frames."""


def write_extxyz(
    packings: Packing | Iterable[Packing], path: Path | str, *, force: bool = False
) -> tuple[Path, ...]:
    """Positions, radii, numbers, masses and velocities of one or many states.

    See :meth:`ForeignWriter.save`. The format has no contacts.
    """
    states = [packings] if isinstance(packings, Packing) else packings
    return EXTXYZ.save(states, path, force=force)
