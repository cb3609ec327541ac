"""ON-DEM VTKHDF, draft 0.1: spheres as points of VTKHDF, interactions under /ONDEM.

As the draft says, ``normal_force`` is positive in traction; its attribute ``positive_in`` repeats
that, since files of other programs do otherwise. ``shear_force`` acts on id2. The cell, which the
draft has no place for, lies under /ONDEM/Cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from granufab.io.foreign_writer import ForeignWriter
from granufab.io.readers.ondem_vtkhdf import CELL, PAIRS, POINTS
from granufab.io.writers.columns import force_parts, gaps, in_space, numbers, only_state, spins
from granufab.packing import Contacts, Packing

__all__ = ["VTKHDF", "write_vtkhdf"]

_TOPOLOGY = ("Vertices", "Lines", "Polygons", "Strips")


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    packing = only_state(states)
    with h5py.File(files[0], "w") as file:
        file.attrs["file_format"] = "ON-DEM VTKHDF"
        file.attrs["file_format_version"] = "0.1-draft"
        file.attrs["source_code"] = "granufab"
        _points(file, packing)
        scene = file.create_group("ONDEM/Scene")
        scene.attrs["dimension"] = packing.dimension
        if packing.time is not None:
            scene.attrs["time"] = packing.time
        if packing.cell is not None:
            cell = packing.cell
            origin = np.zeros(cell.dimension) if cell.origin is None else cell.origin
            _put(file, f"{CELL}/matrix", cell.matrix)
            _put(file, f"{CELL}/origin", origin)
            _put(file, f"{CELL}/periodic", np.array(cell.periodic, np.int8))
        if packing.contacts is not None:
            _interactions(file, packing, packing.contacts)


def _points(file: h5py.File, packing: Packing) -> None:
    grains = packing.grains
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0])
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", 8))
    _put(file, "VTKHDF/NumberOfPoints", np.array([grains.count]))
    _put(file, "VTKHDF/Points", in_space(grains.position))
    for kind in _TOPOLOGY:
        count = grains.count if kind == "Vertices" else 0
        _put(file, f"VTKHDF/{kind}/NumberOfCells", np.array([count]))
        _put(file, f"VTKHDF/{kind}/NumberOfConnectivityIds", np.array([count]))
        _put(file, f"VTKHDF/{kind}/Connectivity", np.arange(count))
        _put(file, f"VTKHDF/{kind}/Offsets", np.arange(count + 1))
    _put(file, f"{POINTS}/radius", grains.radius)
    _put(file, f"{POINTS}/body_id", numbers(packing))
    if grains.mass is not None:
        _put(file, f"{POINTS}/mass", grains.mass)
    if grains.velocity is not None:
        _put(file, f"{POINTS}/velocity", in_space(grains.velocity))
    if grains.spin is not None:
        _put(file, f"{POINTS}/angular_velocity", spins(grains.spin))


def _interactions(file: h5py.File, packing: Packing, contacts: Contacts) -> None:
    number, radius = numbers(packing)[contacts.pair], packing.grains.radius
    gap = gaps(packing, contacts)
    reach = radius[contacts.pair[:, 0]] + 0.5 * gap
    first = packing.grains.position[contacts.pair[:, 0]]
    _put(file, f"{PAIRS}/id1", number[:, 0])
    _put(file, f"{PAIRS}/id2", number[:, 1])
    _put(file, f"{PAIRS}/normal", in_space(contacts.normal))
    _put(file, f"{PAIRS}/contact_point", in_space(first + reach[:, None] * contacts.normal))
    _put(file, f"{PAIRS}/overlap", -gap)
    _put(file, f"{PAIRS}/virtual", np.zeros(contacts.count, np.int8))
    file[PAIRS].attrs["count"] = contacts.count
    parts = force_parts(contacts)
    if parts is not None:
        _put(file, f"{PAIRS}/normal_force", -parts[0])
        _put(file, f"{PAIRS}/shear_force", in_space(parts[1]))
        file[f"{PAIRS}/normal_force"].attrs["positive_in"] = "traction"
        file[f"{PAIRS}/shear_force"].attrs["acts_on"] = "id2"


def _put(file: h5py.File, name: str, values: NDArray) -> None:
    """A dataset with a checksum, compressed where it is large."""
    if values.size == 0:
        file.create_dataset(name, data=values)
    else:
        rows = max(1, min(len(values), 2**20 // max(values[0].nbytes, 1)))
        file.create_dataset(
            name, data=values, chunks=(rows, *values.shape[1:]), fletcher32=True,
            compression="gzip" if values.nbytes > 4096 else None,
        )  # fmt: skip


VTKHDF = ForeignWriter(key="vtkhdf", name="ON-DEM VTKHDF", suffixes=(".vtkhdf", ".hdf"), fill=_fill)
"""The exchange format of ON-DEM, which ParaView opens as points."""


def write_vtkhdf(packing: Packing, path: Path | str, *, force: bool = False) -> tuple[Path, ...]:
    """Grains, contacts and forces in the draft of ON-DEM; see :meth:`ForeignWriter.save`."""
    return VTKHDF.save([packing], path, force=force)
