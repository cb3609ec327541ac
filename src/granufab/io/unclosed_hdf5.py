"""Read an HDF5 file whose writer was killed, or is still at work, as if it had been closed.

HDF5 marks a file that is open for writing in its superblock and then refuses to open it. Its own
way round, reading as a concurrent reader, waits without end where it meets a broken checksum.
Here the file stays as it is and only the superblock that HDF5 is shown has the mark removed; the
layout is that of the HDF5 File Format Specification, "Disk Format: Level 0A", version 3.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

__all__ = [
    "SUPERBLOCK_BYTES",
    "UnclosedFile",
    "close_left_open",
    "is_truncated",
    "is_unclosed",
    "lookup3",
]

SUPERBLOCK_BYTES = 48
_VERSION, _FLAGS, _END, _CHECKSUM = 8, 11, 28, 44
_WORD = 0xFFFFFFFF


def is_unclosed(head: bytes) -> bool:
    """Whether the first bytes of an HDF5 file carry the mark of a writer."""
    return len(head) >= SUPERBLOCK_BYTES and head[_VERSION] == 3 and head[_FLAGS] != 0


def is_truncated(head: bytes, size: int) -> bool:
    """Whether a file of ``size`` bytes with these first bytes was longer when it was closed."""
    if len(head) < SUPERBLOCK_BYTES or head[_VERSION] != 3:
        return False
    return _is_sound(head) and size < struct.unpack_from("<Q", head, _END)[0]


def close_left_open(path: Path) -> None:
    """Remove the mark from a file whose writer was killed; others are left as they are.

    Raises:
        OSError: the file cannot be written, or its superblock is damaged.
    """
    with path.open("r+b") as stream:
        head = stream.read(SUPERBLOCK_BYTES)
        if is_unclosed(head):
            clean = _closed(head, stream.seek(0, io.SEEK_END))
            stream.seek(0)
            stream.write(clean)


class UnclosedFile(io.FileIO):
    """A file object for ``h5py.File``; its superblock has no mark and its true length.

    A truncated file seems as long as it was, with zeros where it is cut off: so HDF5 opens what
    is there, and checksums tell what is not.

    Raises:
        OSError: the superblock is damaged.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "rb")
        head = super().read(SUPERBLOCK_BYTES)
        self._size = super().seek(0, io.SEEK_END)
        if is_truncated(head, self._size) and not is_unclosed(head):
            self._size = struct.unpack_from("<Q", head, _END)[0]
        try:
            self._head = _closed(head, self._size)
        except OSError:
            self.close()
            raise

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Move to a byte, also behind the end of what is there."""
        if whence == io.SEEK_END:
            offset, whence = offset + self._size, io.SEEK_SET
        return super().seek(offset, whence)

    def readinto(self, buffer: Any, /) -> int:
        """Read from the current position; the superblock comes out clean."""
        start = self.tell()
        view = memoryview(buffer).cast("B")
        count = super().readinto(buffer) or 0
        missing = max(0, min(len(view), self._size - start) - count)
        view[count : count + missing] = bytes(missing)
        stop = min(start + count, SUPERBLOCK_BYTES)
        if start < stop:
            view[: stop - start] = self._head[start:stop]
        return count + missing


def _closed(head: bytes, size: int) -> bytes:
    """The superblock of a closed file of that size."""
    if not _is_sound(head):
        raise OSError("the superblock at byte 0 does not match its checksum")
    clean = bytearray(head[:SUPERBLOCK_BYTES])
    clean[_FLAGS] = 0
    struct.pack_into("<Q", clean, _END, size)
    struct.pack_into("<I", clean, _CHECKSUM, lookup3(bytes(clean[:_CHECKSUM])))
    return bytes(clean)


def _is_sound(head: bytes) -> bool:
    return struct.unpack_from("<I", head, _CHECKSUM)[0] == lookup3(head[:_CHECKSUM])


def lookup3(data: bytes) -> int:
    """Checksum of HDF5's metadata: Bob Jenkins' lookup3 ("hashlittle") with seed 0."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    if not data:
        return c
    blocks = (len(data) - 1) // 12
    words = struct.unpack(f"<{3 * blocks + 3}I", data.ljust(12 * (blocks + 1), b"\0"))
    for k in range(0, 3 * blocks, 3):
        a, b, c = (a + words[k]) & _WORD, (b + words[k + 1]) & _WORD, (c + words[k + 2]) & _WORD
        for turn in (4, 6, 8, 16, 19, 4):
            a = (a - c) & _WORD ^ _turned(c, turn)
            c = (c + b) & _WORD
            a, b, c = b, c, a
    a, b, c = (a + words[-3]) & _WORD, (b + words[-2]) & _WORD, (c + words[-1]) & _WORD
    for turn in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, turn)) & _WORD
        a, b, c = b, c, a
    return b


def _turned(word: int, turn: int) -> int:
    return (word << turn | word >> (32 - turn)) & _WORD
