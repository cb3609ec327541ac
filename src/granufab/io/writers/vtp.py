"""A pair of VTK PolyData files for ParaView: grains as points, contacts as lines.

Lines run from the centre of grain i to the image of grain j that it touches. Arrays are compressed
by zlib, base64 inside the XML. The cell and the time are field data.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from granufab.io.foreign_writer import ForeignWriter
from granufab.io.vtk_arrays import TYPES
from granufab.io.writers.columns import (
    force_parts,
    gaps,
    in_space,
    numbers,
    only_state,
    spins,
    starts,
)
from granufab.packing import Contacts, Packing

__all__ = ["VTP", "write_vtp"]

_BLOCK = 2**18
_NAMES = {code: name for name, code in TYPES.items()}


def _files(path: Path) -> tuple[Path, ...]:
    return tuple(path.with_name(f"{path.stem}_{part}{path.suffix}")
                 for part in ("grains", "contacts"))  # fmt: skip


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    packing = only_state(states)
    grains = packing.grains
    columns: dict[str, NDArray] = {"radius": grains.radius, "id": numbers(packing)}
    if grains.mass is not None:
        columns["mass"] = grains.mass
    if grains.velocity is not None:
        columns["velocity"] = in_space(grains.velocity)
    if grains.spin is not None:
        columns["spin"] = spins(grains.spin)
    points = in_space(grains.position)
    verts = np.arange(grains.count)[:, None]
    _poly_data(files[0], _fields(packing), points, ("Verts", verts), columns, {})
    contacts = packing.contacts
    if contacts is None:
        none = np.zeros((0, packing.dimension))
        contacts = Contacts(pair=np.zeros((0, 2), np.int64), normal=none)
    first, second = starts(packing, contacts) if contacts.count else (contacts.normal,) * 2
    points = np.stack([in_space(first), in_space(second)], axis=1).reshape(-1, 3)
    lines = np.arange(2 * contacts.count).reshape(-1, 2)
    cells = _contact_columns(packing, contacts)
    _poly_data(files[1], _fields(packing), points, ("Lines", lines), {}, cells)


def _contact_columns(packing: Packing, contacts: Contacts) -> dict[str, NDArray]:
    number = numbers(packing)[contacts.pair]
    columns: dict[str, NDArray] = {"id1": number[:, 0], "id2": number[:, 1]}
    columns["normal"] = in_space(contacts.normal)
    columns["gap"] = gaps(packing, contacts)
    parts = force_parts(contacts)
    if contacts.force is not None and parts is not None:
        columns["force"] = in_space(contacts.force)
        columns["normal_force"] = parts[0]
    return columns


def _fields(packing: Packing) -> dict[str, NDArray]:
    fields: dict[str, NDArray] = {"dimension": np.array([packing.dimension])}
    if packing.time is not None:
        fields["TimeValue"] = np.array([packing.time])
    if packing.cell is not None:
        cell = packing.cell
        fields["cell_matrix"] = cell.matrix.ravel()
        fields["cell_origin"] = np.zeros(cell.dimension) if cell.origin is None else cell.origin
        fields["cell_periodic"] = np.array(cell.periodic, np.int8)
    return fields


def _poly_data(
    path: Path,
    fields: dict[str, NDArray],
    points: NDArray,
    topology: tuple[str, NDArray],
    point_data: dict[str, NDArray],
    cell_data: dict[str, NDArray],
) -> None:
    kind, cells = topology
    ends = np.arange(1, len(cells) + 1) * cells.shape[1]
    with path.open("w", encoding="ascii", newline="\n") as out:
        out.write('<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" ')
        out.write('byte_order="LittleEndian" header_type="UInt64" ')
        out.write('compressor="vtkZLibDataCompressor">\n<PolyData>\n')
        _group(out, "FieldData", fields, tuples=True)
        out.write(f'<Piece NumberOfPoints="{len(points)}" NumberOf{kind}="{len(cells)}">\n')
        _group(out, "PointData", point_data)
        _group(out, "CellData", cell_data)
        _group(out, "Points", {"Points": points})
        _group(out, kind, {"connectivity": cells.ravel(), "offsets": ends})
        out.write("</Piece>\n</PolyData>\n</VTKFile>\n")


def _group(out: TextIO, tag: str, columns: dict[str, NDArray], *, tuples: bool = False) -> None:
    out.write(f"<{tag}>\n")
    for name, values in columns.items():
        kind = _NAMES[values.dtype.str.lstrip("<|=")]
        width = 1 if values.ndim == 1 else values.shape[1]
        count = f' NumberOfTuples="{len(values)}"' if tuples else ""
        out.write(f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}"{count} ')
        out.write(f'format="binary">{_coded(values)}</DataArray>\n')
    out.write(f"</{tag}>\n")


def _coded(values: NDArray) -> str:
    """Blocks by zlib: number of blocks, block size, last partial size, packed sizes; then all."""
    data = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    blocks = [zlib.compress(data[k : k + _BLOCK]) for k in range(0, len(data), _BLOCK)]
    head = [len(blocks), _BLOCK, len(data) % _BLOCK, *map(len, blocks)]
    coded = base64.b64encode(np.array(head, "<u8").tobytes()) + base64.b64encode(b"".join(blocks))
    return coded.decode()


VTP = ForeignWriter(
    key="vtp", name="VTK PolyData (grains, contacts)", suffixes=(".vtp",), fill=_fill, files=_files
)
"""``name_grains.vtp`` and ``name_contacts.vtp``."""


def write_vtp(packing: Packing, path: Path | str, *, force: bool = False) -> tuple[Path, ...]:
    """Grains, contacts and forces for ParaView; see :meth:`ForeignWriter.save`.

    ``name.vtp`` gives ``name_grains.vtp`` (glyph by ``radius``) and ``name_contacts.vtp`` (tube by
    ``normal_force``).
    """
    return VTP.save([packing], path, force=force)
