"""Tell whether HDF5 can walk the global heaps of a file, before it is let to.

Text of variable length lies in global heaps, which carry no checksum; where the length of one or
of a free piece in it is damaged, HDF5 turns in a loop without end. The layout is that of the HDF5
File Format Specification, "Disk Format: Level 1E".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

__all__ = ["heaps_are_sound"]

_SIGNATURE = b"GCOL\x01"
_HEADER, _OBJECT, _SMALLEST = 16, 16, 4096
_BLOCK = 2**24
_known: dict[Path, tuple[tuple[int, int, int], bool]] = {}


def heaps_are_sound(path: Path) -> bool:
    """Whether each global heap of a file ends where it says; the answer is kept for its next use.

    Args:
        path: the file, which is read once.
    """
    path = path.absolute()
    about = path.stat()
    state = (about.st_ino, about.st_size, about.st_mtime_ns)
    if path in _known and _known[path][0] == state:
        return _known[path][1]
    with path.open("rb") as stream:
        sound = all(_can_be_walked(stream, place, about.st_size) for place in _places(path))
    _known[path] = (state, sound)
    return sound


def _places(path: Path) -> Iterator[int]:
    """Where heaps begin."""
    start, rest = 0, b""
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            data = rest + block
            found = data.find(_SIGNATURE)
            while found >= 0:
                yield start - len(rest) + found
                found = data.find(_SIGNATURE, found + 1)
            start += len(block)
            rest = data[-(len(_SIGNATURE) - 1) :]


def _can_be_walked(stream: BinaryIO, place: int, file_size: int) -> bool:
    stream.seek(place + 8)
    (size,) = struct.unpack("<Q", stream.read(8).ljust(8, b"\0"))
    if not _SMALLEST <= size <= file_size - place:
        return False
    at = _HEADER
    while at + _OBJECT <= size:
        stream.seek(place + at)
        index, _, _, length = struct.unpack("<HHIQ", stream.read(_OBJECT))
        room = _OBJECT + (length + 7) // 8 * 8 if index else length
        if room < _OBJECT or at + room > size:
            return False
        at += room
    return True
