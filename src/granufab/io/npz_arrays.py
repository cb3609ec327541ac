"""Arrays in .npy files and .npz archives: nothing is unpickled, no declared size is trusted."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from granufab.io.checked_hdf5 import LARGEST_RATIO

__all__ = ["BROKEN_ARRAYS", "archived_array", "mapped_array"]

BROKEN_ARRAYS = (
    *(ValueError, OSError, EOFError, KeyError, MemoryError, SyntaxError, TypeError),
    *(OverflowError, RuntimeError, zipfile.BadZipFile, zlib.error, TokenError),
)
"""What damaged files end in, here and in the standard library."""

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def archived_array(archive: zipfile.ZipFile, member: str) -> NDArray[Any]:
    """One array of numbers, its declared size checked against what the archive stores.

    Args:
        archive: opened.
        member: its name there, with ``.npy``.
    Raises:
        ValueError: it declares more than is stored, or holds no numbers.
    """
    entry, name = archive.getinfo(member), member.removesuffix(".npy")
    if entry.file_size > LARGEST_RATIO * max(entry.compress_size, 1):
        raise ValueError(f"{name} declares {entry.file_size} bytes, too many for the archive")
    with archive.open(entry) as stream:
        shape, order, kind = _header(stream, name, entry.file_size)
        data = stream.read(_count(shape) * kind.itemsize)
    return np.frombuffer(data, kind).reshape(shape, order=order)


def mapped_array(path: Path) -> NDArray[Any]:
    """The array of an .npy file, left on the disk.

    Raises:
        ValueError: as for :func:`archived_array`.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        shape, order, kind = _header(stream, "the array", size)
        start = stream.tell()
        if start + _count(shape) * kind.itemsize > size:
            raise ValueError(f"it ends at byte {size} of {start + _count(shape) * kind.itemsize}")
    if _count(shape) == 0:
        return np.zeros(shape, kind)
    return np.memmap(path, kind, "r", start, shape, order)


def _header(stream: IO[bytes], name: str, size: int) -> tuple[tuple[int, ...], Any, np.dtype]:
    version = npy.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"{name} has an unknown header version {version}")
    shape, fortran, kind = _HEADERS[version](stream)
    if kind.kind not in "iuf" or any(edge < 0 for edge in shape):
        raise ValueError(f"{name} has type {kind} and shape {shape}")
    if _count(shape) * kind.itemsize > size:
        raise ValueError(f"{name} declares {_count(shape)} items that are not stored")
    return shape, "F" if fortran else "C", kind


def _count(shape: tuple[int, ...]) -> int:
    count = 1
    for edge in shape:
        count *= edge
    return count
