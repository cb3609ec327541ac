"""LAMMPS data files of spheres (``atom_style sphere``, ``read_data``), without contacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from granufab.errors import InvalidSettings
from granufab.io.foreign_writer import ForeignWriter
from granufab.io.writers.columns import in_space, numbers, only_state, rows, spins
from granufab.packing import Array, Packing

__all__ = ["LAMMPS_DATA", "write_lammps_data"]


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    packing = only_state(states)
    grains = packing.grains
    # LAMMPS numbers atoms from 1.
    number = numbers(packing)
    number = number + (1 - min(int(number.min()), 1))
    kind = np.ones(grains.count, np.int64)
    volume = 4.0 / 3.0 * np.pi * grains.radius**3
    density = np.ones(grains.count) if grains.mass is None else grains.mass / volume
    with files[0].open("w", encoding="utf-8", newline="\n") as stream:
        stream.write("LAMMPS data file of granufab\n\n")
        stream.write(f"{grains.count} atoms\n1 atom types\n\n{_box(packing)}\nAtoms # sphere\n\n")
        place = in_space(grains.position)
        stream.writelines(rows([number, kind, 2.0 * grains.radius, density, place]))
        if grains.velocity is not None or grains.spin is not None:
            zero = np.zeros((grains.count, 3))
            speed = zero if grains.velocity is None else in_space(grains.velocity)
            turning = zero if grains.spin is None else spins(grains.spin)
            stream.write("\nVelocities\n\n")
            stream.writelines(rows([number, speed, turning]))


def _box(packing: Packing) -> str:
    """Bounds, and tilts where the cell has any; without a cell the smallest box around all."""
    matrix, origin = _lattice(packing)
    if np.abs(np.tril(matrix, -1)).max() > 1e-12 * np.abs(matrix).max():
        raise InvalidSettings(
            "the cell cannot be written for LAMMPS: its first lattice vector must lie along x and "
            "its second in the xy plane"
        )
    text = "".join(
        f"{low!r} {low + edge!r} {axis}lo {axis}hi\n"
        for axis, low, edge in zip("xyz", origin.tolist(), np.diag(matrix).tolist(), strict=True)
    )
    tilts = [float(matrix[0, 1]), float(matrix[0, 2]), float(matrix[1, 2])]
    if any(tilts):
        text += f"{tilts[0]!r} {tilts[1]!r} {tilts[2]!r} xy xz yz\n"
    return text


def _lattice(packing: Packing) -> tuple[Array, Array]:
    grains, size = packing.grains, packing.dimension
    thick = 2.0 * float(grains.radius.max())
    matrix, origin = np.diag([0.0, 0.0, thick]), np.array([0.0, 0.0, -thick / 2])
    if packing.cell is not None:
        matrix[:size, :size] = packing.cell.matrix
        origin[:size] = 0.0 if packing.cell.origin is None else packing.cell.origin
        return matrix, origin
    low = (grains.position - grains.radius[:, None]).min(axis=0)
    high = (grains.position + grains.radius[:, None]).max(axis=0)
    matrix[:size, :size], origin[:size] = np.diag(high - low), low
    return matrix, origin


LAMMPS_DATA = ForeignWriter(
    key="lammps_data",
    name="LAMMPS data (spheres)",
    suffixes=(".data", ".lmp"),
    fill=_fill,
    left_out="contacts, and which axes have walls",
)
"""For ``read_data`` with ``atom_style sphere``."""


def write_lammps_data(
    packing: Packing, path: Path | str, *, force: bool = False
) -> tuple[Path, ...]:
    """Grains and box for LAMMPS' ``read_data``; see :meth:`ForeignWriter.save`.

    Densities are m / (4/3 π R³), also in 2D, so that LAMMPS finds the masses again; without
    masses they are 1.

    Raises:
        InvalidSettings: the cell is tilted in a way that LAMMPS does not take.
    """
    return LAMMPS_DATA.save([packing], path, force=force)
