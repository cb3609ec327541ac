"""VTK's XML files: arrays in ascii, base64 or appended raw bytes, plain or in compressed blocks."""

from __future__ import annotations

import base64
import binascii
import lzma
import re
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, UnknownFormat
from granufab.io.checked_hdf5 import LARGEST_RATIO
from granufab.io.text_rows import number_fault

__all__ = ["TYPES", "VtkFile", "is_vtk_xml"]

TYPES = {f"{kind}{8 * size}": f"{letter}{size}"
         for kind, letter, sizes in (("Int", "i", (1, 2, 4, 8)), ("UInt", "u", (1, 2, 4, 8)),
                                     ("Float", "f", (4, 8)))
         for size in sizes}  # fmt: skip
_APPENDED = re.compile(rb"<AppendedData\b[^>]*>\s*_")
_COMPRESSORS = ("vtkZLibDataCompressor", "vtkLZMADataCompressor")
_BASE64 = re.compile(rb"[A-Za-z0-9+/]+={0,2}")


def is_vtk_xml(head: bytes, *kinds: str) -> bool:
    """Whether a file begins as VTK XML of one of these kinds ("PolyData")."""
    found = re.search(rb"<VTKFile\b[^>]*\btype=[\"'](\w+)[\"']", head)
    return found is not None and found[1].decode() in kinds


class VtkFile:
    """A file held in memory, its arrays decoded when asked for.

    Args:
        path: the file.
    Raises:
        CorruptFile: it is no complete XML.
        UnknownFormat: its arrays are compressed in a way that is not read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        data = path.read_bytes()
        mark = _APPENDED.search(data)
        text = data if mark is None else data[: mark.start()] + b"</VTKFile>"
        self._raw = mark is not None and b"raw" in mark[0]
        self._appended = b"" if mark is None else self._tail(data, mark.end())
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise self.corrupt("has a document type, which VTK files have not")
        try:
            self.root = ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise self.corrupt(f"is truncated or no XML ({error})") from None
        self._order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        self._header = "u8" if self.root.get("header_type") == "UInt64" else "u4"
        self._compressor = self.root.get("compressor")
        if self._compressor and self._compressor not in _COMPRESSORS:
            raise UnknownFormat(
                f"{path}: arrays compressed by {self._compressor} are not read; write it with zlib"
            )

    def corrupt(self, text: str) -> CorruptFile:
        """The exception for a contradiction in this file."""
        return CorruptFile(f"{self.path}: {text}")

    def pieces(self) -> Iterator[ElementTree.Element]:
        """The pieces of the data set."""
        yield from self.root.iter("Piece")

    def count(self, piece: ElementTree.Element, name: str) -> int:
        """A count that a piece declares, 0 where it does not."""
        text = piece.get(name, "0")
        if not re.fullmatch(r"[0-9]{1,15}", text):
            raise self.corrupt(f"array lengths: {name} is {text[:40]!r}, expected a whole number")
        return int(text)

    def array(self, element: ElementTree.Element, rows: int | None = None) -> NDArray:
        """Numbers of a DataArray, shape (rows,) or (rows, components).

        Args:
            element: the DataArray.
            rows: how many it must have.
        Raises:
            CorruptFile: it has other rows, or its data cannot be decoded.
        """
        name = element.get("Name", "array")
        kind = TYPES.get(element.get("type", ""))
        width = element.get("NumberOfComponents", "1")
        if kind is None or not re.fullmatch(r"[1-9][0-9]{0,2}", width):
            kind = element.get("type")
            raise self.corrupt(f"array {name} has type {kind!r} of {width[:40]} components")
        values = self._decoded(element, np.dtype(self._order + kind), name)
        if len(values) % int(width) or rows not in (None, len(values) // int(width)):
            raise self.corrupt(
                f"array {name} has {len(values)} numbers, expected {rows} rows of {width}"
            )
        return values.reshape(-1, int(width)) if int(width) > 1 else values

    def _tail(self, data: bytes, start: int) -> bytes:
        end = data.rfind(b"</AppendedData>")
        if end < start:
            raise self.corrupt(f"byte {len(data)}: is truncated, its appended data do not end")
        return data[start:end]

    def _decoded(self, element: ElementTree.Element, dtype: np.dtype, name: str) -> NDArray:
        form = element.get("format", "ascii")
        text = element.text or ""
        if form == "ascii":
            return self._ascii(text, dtype, name)
        try:
            if form == "appended" and self._raw:
                offset = int(element.get("offset", "-1"))
                if not 0 <= offset < len(self._appended):
                    raise ValueError(f"offset {offset} lies outside the appended data")
                data = self._blocks(self._appended, offset)
            else:
                coded = self._coded(element) if form == "appended" else text.encode()
                data = self._blocks(_from_base64(coded), 0)
            return np.frombuffer(data, dtype)
        except (ValueError, IndexError, binascii.Error, zlib.error, lzma.LZMAError) as error:
            raise self.corrupt(f"array {name} cannot be decoded ({error})") from None

    def _ascii(self, text: str, dtype: np.dtype, name: str) -> NDArray:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            try:
                return np.fromstring(text, np.float64 if dtype.kind == "f" else np.int64, sep=" ")
            except (DeprecationWarning, ValueError):
                fault = next(filter(None, map(number_fault, text.split())), "no numbers")
                raise self.corrupt(f"array {name}: {fault}") from None

    def _coded(self, element: ElementTree.Element) -> bytes:
        """The base64 text of one array among the appended ones, up to the next."""
        offset = int(element.get("offset", "-1"))
        places = [int(one.get("offset", "-1")) for one in self.root.iter("DataArray")
                  if one.get("format") == "appended"]  # fmt: skip
        later = [place for place in places if place > offset]
        if offset < 0:
            raise ValueError("no offset")
        return self._appended[offset : min(later, default=len(self._appended))]

    def _blocks(self, data: bytes, start: int) -> bytes:
        """The bytes of an array: its header says how many, or how they are compressed."""
        size = np.dtype(self._header).itemsize
        head = self._integers(data, start, 1)
        if not self._compressor:
            return _piece(data, start + size, head[0])
        count = head[0]
        if count == 0:
            return b""
        if count * size > len(data):
            raise ValueError(f"{count} blocks do not fit")
        block, last, *sizes = self._integers(data, start + size, 2 + count)
        total = block * (count - 1) + (last or block)
        if total > LARGEST_RATIO * len(data):
            raise ValueError(f"{total} bytes are declared, {len(data)} are stored")
        place, parts = start + (3 + count) * size, []
        for number, stored in enumerate(sizes):
            wanted = last if last and number == count - 1 else block
            parts.append(self._unpacked(_piece(data, place, stored), wanted))
            place += stored
        return b"".join(parts)

    def _unpacked(self, data: bytes, wanted: int) -> bytes:
        if self._compressor == _COMPRESSORS[0]:
            tool = zlib.decompressobj()
            plain = tool.decompress(data, wanted + 1)
            complete = tool.eof or not tool.decompress(tool.unconsumed_tail, 1)
        else:
            reader = lzma.LZMADecompressor()
            plain = reader.decompress(data, wanted + 1)
            complete = True
        if len(plain) != wanted or not complete:
            raise ValueError(f"a block has {len(plain)} bytes, expected {wanted}")
        return plain

    def _integers(self, data: bytes, start: int, count: int) -> list[int]:
        dtype = np.dtype(self._order + self._header)
        return np.frombuffer(_piece(data, start, count * dtype.itemsize), dtype).tolist()


def _piece(data: bytes, start: int, size: int) -> bytes:
    if start + size > len(data):
        raise ValueError(f"{size} bytes are declared, {max(len(data) - start, 0)} are there")
    return data[start : start + size]


def _from_base64(text: bytes) -> bytes:
    """Base64 in one or several padded parts: VTK codes a compressed array's header apart."""
    coded = b"".join(text.split())
    parts = _BASE64.findall(coded)
    if sum(map(len, parts)) != len(coded):
        raise ValueError("characters that are no base64")
    return b"".join(base64.b64decode(part, validate=True) for part in parts)
