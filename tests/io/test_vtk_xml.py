"""VTK XML: every way of storing an array, contacts by numbers or by the ends of lines, damage."""

from __future__ import annotations

import base64
import lzma
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.errors import CorruptFile, GranufabError, MissingData, UnknownFormat

PLACE = np.array([[0, 0, 0], [0.9, 0, 0.1], [0.3, 0.8, 0], [2, 2, 2]], float)
RADIUS = np.array([0.5, 0.5, 0.4, 0.3])
Store = Callable[[str, str, np.ndarray], str]


class Storage:
    """Arrays as one of VTK's writers stores them, written from its description alone."""

    def __init__(self, form: str, pack: str, head: str) -> None:
        self.form, self.pack, self.head = form, pack, head
        self.tail = b""

    def coded(self, data: bytes) -> list[bytes]:
        """Header and data of an array."""
        code = "<" + self.head
        if not self.pack:
            return [struct.pack(code, len(data)) + data]
        squeeze = zlib.compress if self.pack == "ZLib" else lzma.compress
        blocks = [squeeze(data[k : k + 40]) for k in range(0, len(data), 40)]
        numbers = [len(blocks), 40, len(data) % 40, *map(len, blocks)]
        return [struct.pack(f"<{len(numbers)}{self.head}", *numbers), b"".join(blocks)]

    def array(self, kind: str, name: str, values: np.ndarray) -> str:
        width = 1 if values.ndim == 1 else values.shape[1]
        tag = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" '
        if self.form == "ascii":
            return (
                tag + f'format="ascii">{" ".join(map(repr, values.ravel().tolist()))}</DataArray>'
            )
        parts = self.coded(values.tobytes())
        if self.form == "raw":
            tag += f'format="appended" offset="{len(self.tail)}"/>'
            self.tail += b"".join(parts)
            return tag
        coded = b"".join(map(base64.b64encode, parts))
        if self.form == "binary":
            return tag + f'format="binary">\n{coded.decode()}\n</DataArray>'
        tag += f'format="appended" offset="{len(self.tail)}"/>'
        self.tail += coded
        return tag

    def file(self, path: Path, kind: str, inside: str) -> Path:
        packing = f' compressor="vtk{self.pack}DataCompressor"' if self.pack else ""
        header = "UInt64" if self.head == "Q" else "UInt32"
        text = (
            f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" '
            f'byte_order="LittleEndian" header_type="{header}"{packing}>\n<{kind}>{inside}</{kind}>'
        ).encode()
        if self.form in ("raw", "base64"):
            text += f'<AppendedData encoding="{self.form}">\n_'.encode() + self.tail
            text += b"\n</AppendedData>"
        path.write_bytes(text + b"\n</VTKFile>\n")
        return path


def _grains(path: Path, form: str = "ascii", pack: str = "", head: str = "I", **more: str) -> Path:
    store = Storage(form, pack, head)
    kind, name = more.get("kind", "PolyData"), more.get("name", "radius")
    values = RADIUS * (2 if name == "Diameter" else 1)
    inside = (
        f'<Piece NumberOfPoints="4" NumberOfVerts="0" NumberOfCells="0"><PointData>'
        f"{store.array('Float64', name, values)}"
        f"{store.array('Int32', 'id', np.array([7, 3, 5, 9], np.int32))}</PointData>"
        f"<Points>{store.array('Float32', 'Points', PLACE.astype('f4'))}</Points></Piece>"
    )
    return store.file(path, kind, inside)


def _lines(path: Path, ends: np.ndarray, points: np.ndarray) -> Path:
    store = Storage("ascii", "", "I")
    joined = store.array("Int64", "connectivity", ends.ravel())
    stops = store.array("Int64", "offsets", 2 * np.arange(1, len(ends) + 1))
    inside = (
        f'<Piece NumberOfPoints="{len(points)}" NumberOfLines="{len(ends)}">'
        f"<CellData>{store.array('Float64', 'forceN', np.arange(1.0, len(ends) + 1))}</CellData>"
        f"<Points>{store.array('Float64', 'Points', points)}</Points>"
        f"<Lines>{joined}{stops}</Lines></Piece>"
    )
    return store.file(path, "PolyData", inside)


@pytest.mark.parametrize("form", ["ascii", "binary", "raw", "base64"])
@pytest.mark.parametrize("pack", ["", "ZLib", "LZMA"])
@pytest.mark.parametrize("head", ["I", "Q"])
def test_every_storage(tmp_path: Path, form: str, pack: str, head: str) -> None:
    packing = granufab.read(_grains(tmp_path / "a.vtp", form, pack, head)).frames[0].packing
    np.testing.assert_allclose(packing.grains.position, PLACE, rtol=1e-7)
    np.testing.assert_array_equal(packing.grains.radius, RADIUS)
    assert packing.grains.number.tolist() == [7, 3, 5, 9]


def test_an_unstructured_grid_with_diameters(tmp_path: Path) -> None:
    path = _grains(tmp_path / "a.vtu", kind="UnstructuredGrid", name="Diameter")
    packing = granufab.read(path).frames[0].packing
    np.testing.assert_array_equal(packing.grains.radius, RADIUS)


def test_contacts_as_lines_between_centres(tmp_path: Path) -> None:
    grains = _grains(tmp_path / "a.vtp")
    lines = _lines(tmp_path / "b.vtp", np.array([[0, 1], [2, 0]]), PLACE[[2, 0, 1]])
    packing = granufab.read(lines, grains).frames[0].packing
    assert packing.contacts is not None
    assert packing.grains.number[packing.contacts.pair].tolist() == [[5, 7], [3, 5]]
    along = np.einsum("ci,ci->c", packing.contacts.force, packing.contacts.normal)
    np.testing.assert_allclose(along, [1.0, 2.0])
    _lines(lines, np.array([[0, 1]]), PLACE[:2] + 0.3)
    with pytest.raises(CorruptFile, match=r"b\.vtp: line 0 ends at no centre"):
        granufab.read(lines, grains)


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    lines = _lines(tmp_path / "b.vtp", np.array([[0, 1]]), PLACE[:2])
    with pytest.raises(MissingData, match="give that file too"):
        granufab.read(lines)
    path = _grains(tmp_path / "a.vtp", "binary", "ZLib")
    path.write_bytes(path.read_bytes().replace(b"vtkZLib", b"vtkLZ4"))
    with pytest.raises(UnknownFormat, match="write it with zlib"):
        granufab.read(path)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'NumberOfPoints="4"', b'NumberOfPoints="400000000000"'),
        (b"<?xml version", b"<!DOCTYPE a [<!ENTITY b 'c'>]><?xml version"),
        (b'type="Float64"', b'type="Float80"'),
        (b'offset="0"', b'offset="99999"'),
    ],
)
def test_contradictions(tmp_path: Path, old: bytes, new: bytes) -> None:
    path = _grains(tmp_path / "a.vtp", "raw")
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(GranufabError, match=r"a\.vtp"):
        granufab.read(path)


def test_a_bomb_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.vtp"
    store = Storage("raw", "ZLib", "Q")
    squeezed = zlib.compress(bytes(2**22))
    store.coded = lambda data: [struct.pack("<4Q", 1, 8, 8, len(squeezed)), squeezed]  # type: ignore[method-assign]
    inside = (
        f'<Piece NumberOfPoints="1"><PointData>{store.array("Float64", "radius", RADIUS[:1])}'
        f"</PointData><Points>{store.array('Float64', 'Points', PLACE[:1])}</Points></Piece>"
    )
    store.file(path, "PolyData", inside)
    with pytest.raises(CorruptFile, match="expected 8"):
        granufab.read(path)
