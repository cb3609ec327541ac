"""Ten grains in the formats that are XML, binary, or both."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from one_of_each import COUNT, EDGE, RADIUS, Example, Part, grid, row
from one_of_each_text import TEXT, fortran, lmgc90_bodies

__all__ = ["EXAMPLES"]

Arrays = dict[str, np.ndarray]
_KINDS = {"f8": "Float64", "i8": "Int64"}


def _legacy(folder: Path, *, binary: bool) -> Example:
    s = grid(3)

    def numbers(values: np.ndarray, kind: str) -> bytes:
        if binary:
            return np.asarray(values).astype(kind).tobytes() + b"\n"
        return row(np.asarray(values)).encode()

    (folder / "a_30.vtk").write_bytes(
        f"# vtk DataFile Version 3.0\ngrains\n{'BINARY' if binary else 'ASCII'}\nDATASET POLYDATA\n"
        f"FIELD FieldData 1\nTIME 1 1 double\n".encode()
        + numbers(np.array([2.5]), ">f8")
        + f"POINTS {COUNT} double\n".encode()
        + numbers(s.position, ">f8")
        + f"VERTICES {COUNT} {2 * COUNT}\n".encode()
        + numbers(np.column_stack([np.ones(COUNT, int), np.arange(COUNT)]), ">i4")
        + f"POINT_DATA {COUNT}\nSCALARS id int 1\nLOOKUP_TABLE default\n".encode()
        + numbers(np.arange(COUNT), ">i4")
        + b"VECTORS v double\n"
        + numbers(0.5 * s.position, ">f8")
        + f"FIELD FieldData 1\nradius 1 {COUNT} double\n".encode()
        + numbers(s.radius, ">f8")
    )
    counts = (r"POINTS (\d+)", r"POINT_DATA (\d+)", r"VERTICES \d+ (\d+)", r"SCALARS id int (\d+)",
              r"radius (\d+)", r"radius \d+ (\d+)", r"FieldData (\d)\nrad",
              r"TIME (\d)")  # fmt: skip
    part = Part(name="a_30.vtk", number="" if binary else f"{RADIUS}", text=not binary,
                counts=counts)  # fmt: skip
    return Example(key="liggghts_vtk", folder=folder, parts=(part,))


class _Xml:
    """A VTK file whose arrays are ascii, base64 within, or raw at the end, packed or not."""

    def __init__(self, form: str, *, packed: bool = False) -> None:
        self.form, self.packed, self.tail = form, packed, b""

    def array(self, name: str, values: np.ndarray) -> str:
        kind = values.dtype.str[1:]
        width = 1 if values.ndim == 1 else values.shape[1]
        tag = f'<DataArray type="{_KINDS[kind]}" Name="{name}" NumberOfComponents="{width}" '
        if self.form == "ascii":
            return f'{tag}format="ascii">\n{row(values)}</DataArray>\n'
        data = values.tobytes()
        parts = [struct.pack("<Q", len(data)) + data]
        if self.packed:
            squeezed = zlib.compress(data)
            parts = [struct.pack("<4Q", 1, len(data), len(data), len(squeezed)), squeezed]
        if self.form == "binary":
            coded = b"".join(map(base64.b64encode, parts)).decode()
            return f'{tag}format="binary">\n{coded}\n</DataArray>\n'
        tag += f'format="appended" offset="{len(self.tail)}"/>\n'
        self.tail += b"".join(parts)
        return tag

    def group(self, tag: str, **arrays: np.ndarray) -> str:
        return f"<{tag}>\n{''.join(self.array(*one) for one in arrays.items())}</{tag}>\n"

    def write(self, path: Path, kind: str, inside: str) -> None:
        packing = ' compressor="vtkZLibDataCompressor"' if self.packed else ""
        text = (
            f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" '
            f'byte_order="LittleEndian" header_type="UInt64"{packing}>\n<{kind}>\n{inside}</{kind}>'
        ).encode()
        if self.form == "raw":
            text += b'<AppendedData encoding="raw">\n_' + self.tail + b"\n</AppendedData>"
        path.write_bytes(text + b"\n</VTKFile>\n")


def _vtk_xml(folder: Path, form: str, kind: str = "PolyData", *, packed: bool = False) -> Example:
    s, ending = grid(3), "vtp" if kind == "PolyData" else "vtu"
    file = _Xml(form, packed=packed)
    inside = f'<Piece NumberOfPoints="{COUNT}" NumberOfVerts="0" NumberOfCells="0">\n'
    inside += file.group("PointData", radius=s.radius, id=np.arange(COUNT))
    inside += file.group("Points", Points=s.position) + "</Piece>\n"
    file.write(folder / f"g.{ending}", kind, inside)
    file, count = _Xml(form, packed=packed), len(s.pair)
    inside = f'<Piece NumberOfPoints="{2 * count}" NumberOfLines="{count}">\n'
    inside += file.group("CellData", force=s.force, i=s.pair[:, 0].copy(), j=s.pair[:, 1].copy())
    inside += file.group("Points", Points=s.position[s.pair].reshape(-1, 3))
    inside += file.group(
        "Lines", connectivity=np.arange(2 * count), offsets=2 * np.arange(1, count + 1)
    )
    file.write(folder / f"c.{ending}", "PolyData", inside + "</Piece>\n")
    points = (r'Points="(\d+)"', r'NumberOfComponents="(\d+)"')
    number = f"{s.force[2, 0]:.10g}"
    text = form == "ascii"
    return Example(
        key="vtp", folder=folder,
        parts=(Part(name=f"g.{ending}", number=f"{RADIUS}" * text, text=text, counts=points),
               Part(name=f"c.{ending}", number=number * text, text=text,
                    counts=(r'Lines="(\d+)"', r'NumberOfComponents="(\d+)"'))),
    )  # fmt: skip


def _gsd(folder: Path) -> Example:
    """Header, names, chunks, index; diameters in frame 0 only."""
    s, data = grid(3), b""
    names = ("configuration/step", "configuration/box", "particles/N", "particles/position",
             "particles/diameter")  # fmt: skip
    entries: list[bytes] = []

    def put(frame: int, name: int, kind: int, values: np.ndarray) -> None:
        nonlocal data
        count, width = (*values.shape, 1)[:2]
        entries.append(struct.pack("<QQqIHBB", frame, count, 512 + len(data), width, name, kind, 0))
        data += values.tobytes()

    for frame in range(3):
        put(frame, 0, 4, np.array([10 * frame], "u8"))
        if frame == 0:
            put(frame, 2, 3, np.array([COUNT], "u4"))
            put(frame, 4, 9, (2 * s.radius).astype("f4"))
        put(frame, 1, 9, np.array([EDGE + frame, EDGE, EDGE, 0.25, 0, 0], "f4"))
        put(frame, 3, 9, (s.position - 3).astype("f4"))
    head = struct.pack(
        "<QQQQQII64s64s80s", 0x65DF65DF65DF65DF, 512 + len(data), len(entries) + 2, 256, 4,
        (1 << 16) | 4, 2 << 16, b"test", b"hoomd", b"",
    )  # fmt: skip
    listed = b"".join(name.encode() + b"\0" for name in names).ljust(256, b"\0")
    (folder / "a.gsd").write_bytes(head + listed + data + b"".join(entries) + bytes(64))
    return Example(key="gsd", folder=folder, series=True, parts=(Part(name="a.gsd", text=False),))


def _vtkhdf(folder: Path) -> Example:
    s = grid(3)
    with h5py.File(folder / "a.vtkhdf", "w") as file:
        file["VTKHDF/Points"] = s.position
        file["VTKHDF/PointData/radius"] = s.radius
        file["VTKHDF/PointData/body_id"] = np.arange(COUNT, dtype=np.int32)
        pairs = file.create_group("ONDEM/Interactions")
        pairs["id1"], pairs["id2"] = s.pair.astype(np.int32).T
        pairs["normal"], pairs["normal_force"] = s.normal, s.push
        pairs["overlap"] = s.overlap
        file.create_group("ONDEM/Scene").attrs["time"] = 0.25
    part = Part(name="a.vtkhdf", text=False)
    return Example(key="vtkhdf", folder=folder, parts=(part,))


def _lmgc90_hdf5(folder: Path) -> Example:
    s = grid(2)
    lmgc90_bodies(folder / "BODIES.DAT")
    with h5py.File(folder / "lmgc90.h5", "w") as file:
        for group, table, fields in (
            ("RBDY2", "rdata", {"X (x,y,theta)": 3, "V (x,y,rot)": 3}),
            ("RBDY2", "idata", {"visible": 1}),
            ("VlocRloc", "idata", {"bdyty (cd,an)": 2, "ibdyty (cd,an)": 2}),
            ("VlocRloc", "rdata", {"rl (t,n)": 2, "gapTT": 1, "coor (x,y)": 2, "uc (nx,ny)": 2}),
        ):
            start = 1
            for name, width in fields.items():
                place = file.create_group(f"Help/{group}/{table}/{name.split()[0]}")
                place["bound"] = np.array([start, start + width - 1], np.int32)
                place["name"] = np.bytes_(name.encode())
                start += width
        for step in (1, 2):
            at, count = file.create_group(f"Evolution/ID_{step}"), len(s.pair)
            at["RBDY2/rdata"] = np.full((COUNT + 1, 6), 0.01 * step)
            at["RBDY2/idata"] = np.ones((COUNT + 1, 1), np.int32)
            at["TPS"], at["NStep"] = 0.5 * step, np.int32(step)
            kinds = np.ones((count, 2), np.int32)
            at["VlocRloc/idata"] = np.hstack([kinds, s.pair[:, ::-1] + 1]).astype(np.int32)
            at["VlocRloc/rdata"] = np.column_stack(
                [np.full(count, 0.25), s.push, -s.overlap, s.point, s.normal]
            )
    return Example(
        key="lmgc90_hdf5", folder=folder, series=True,
        parts=(Part(name="lmgc90.h5", text=False),
               Part(name="BODIES.DAT", number=fortran(RADIUS).strip())),
    )  # fmt: skip


def _labels(folder: Path, ending: str) -> Example:
    image = np.kron(np.arange(1, 13).reshape(3, 2, 2), np.ones((3, 3, 3), int)).astype(np.int16)
    path = folder / f"labels.{ending}"
    if ending == "npy":
        np.save(path, image)
    elif ending == "npz":
        np.savez_compressed(path, labels=image)
    else:
        tifffile: Any = pytest.importorskip("tifffile", reason="granufab[ct] is not installed")
        tifffile.imwrite(path, image)
    part = Part(name=path.name, text=False)
    return Example(key="labels", folder=folder, parts=(part,))


EXAMPLES: dict[str, Callable[[Path], Example]] = {
    **TEXT,
    "liggghts_vtk_ascii": partial(_legacy, binary=False),
    "liggghts_vtk_binary": partial(_legacy, binary=True),
    "vtp_ascii": partial(_vtk_xml, form="ascii"),
    "vtu_ascii": partial(_vtk_xml, form="ascii", kind="UnstructuredGrid"),
    "vtp_binary": partial(_vtk_xml, form="binary"),
    "vtp_appended": partial(_vtk_xml, form="raw"),
    "vtp_zlib": partial(_vtk_xml, form="raw", packed=True),
    "gsd": _gsd,
    "vtkhdf": _vtkhdf,
    "lmgc90_hdf5": _lmgc90_hdf5,
    "labels_npy": partial(_labels, ending="npy"),
    "labels_npz": partial(_labels, ending="npz"),
    "labels_tif": partial(_labels, ending="tif"),
}
"""What writes each into a folder."""
