"""Named arrays and a small JSON header in one block of bytes, little-endian.

Layout: 4 bytes ``GFV1``, the length of the header as uint32, the header as UTF-8 JSON filled up
with spaces to a multiple of 8 bytes, then the arrays, each at a multiple of 8 bytes. The header
names them: ``arrays: {name: {type, shape, offset}}``, where ``offset`` counts from the end of the
header and ``type`` is float32, float64, uint32 or int32, in saved pages also uint16, int16, uint8
or int8.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile
from granufab.io.summary import plain

__all__ = ["MAGIC", "pack", "unpack"]

MAGIC = b"GFV1"
"""First bytes of every block."""
_PLACE = 8
_TYPES = {
    "float32": "<f4", "float64": "<f8", "uint32": "<u4", "int32": "<i4",
    "uint16": "<u2", "int16": "<i2", "uint8": "<u1", "int8": "<i1",
}  # fmt: skip


def pack(header: Mapping[str, Any], arrays: Mapping[str, NDArray]) -> bytes:
    """One block of bytes.

    Args:
        header: plain data; NaN and ±∞ become null.
        arrays: of the types named above.
    """
    listed, parts, offset = {}, [], 0
    for name, array in arrays.items():
        kind = array.dtype.name
        data = np.ascontiguousarray(array, dtype=_TYPES[kind]).tobytes()
        listed[name] = {"type": kind, "shape": list(array.shape), "offset": offset}
        parts.append(_filled(data, b"\0"))
        offset += len(parts[-1])
    words = plain({**header, "arrays": listed})
    text = json.dumps(words, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    head = _filled(text.encode(), b" ")
    return b"".join([MAGIC, struct.pack("<I", len(head)), head, *parts])


def unpack(block: bytes) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """The header and the arrays of a block; the page does the same in its own language.

    Raises:
        CorruptFile: it is no such block.
    """
    if block[:4] != MAGIC or len(block) < 8:
        raise CorruptFile(f"these {len(block)} bytes are no frame of the viewer")
    begin = 8 + struct.unpack("<I", block[4:8])[0]
    header = json.loads(block[8:begin])
    arrays = {}
    for name, item in header.pop("arrays").items():
        count = int(np.prod(item["shape"], dtype=np.int64))
        found = np.frombuffer(block, _TYPES[item["type"]], count, begin + item["offset"])
        arrays[name] = found.reshape(item["shape"])
    return header, arrays


def _filled(data: bytes, blank: bytes) -> bytes:
    return data + blank * (-len(data) % _PLACE)
