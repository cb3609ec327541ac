"""Make, or open again for writing, the HDF5 file behind a run file writer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granufab.errors import InvalidSettings
from granufab.io.schema import Entry
from granufab.io.unclosed_hdf5 import close_left_open

__all__ = ["RAGGED", "create_file", "growing", "number", "reopen_file", "set_text"]

RAGGED = ("contacts", "wall_contacts")
"""What grows by the pairs of a frame."""

_COMPRESSION: dict[str, Any] = {
    "compression": "gzip",
    "compression_opts": 1,
    "shuffle": True,
    "fletcher32": True,
}
_LARGEST_CHUNK = 16384
_OPENING: dict[str, Any] = {
    "libver": ("v110", "latest"),
    "locking": "best-effort",
    "rdcc_nbytes": 2**20,  # kept of each dataset; HDF5 2.0 would keep 8 MiB, never read again
}


def create_file(path: Path, force: bool) -> h5py.File:
    """A new file.

    Raises:
        InvalidSettings: it exists, or cannot be written.
    """
    if path.is_dir():
        raise InvalidSettings(f"{path}: is a folder, expected a file name")
    try:
        if force:
            path.unlink(missing_ok=True)
        return h5py.File(path, "x", **_OPENING)
    except FileExistsError:
        raise InvalidSettings(f"{path}: exists already; use force to replace it") from None
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise InvalidSettings(f"{path}: cannot be written ({reason})") from None


def reopen_file(path: Path) -> h5py.File:
    """A file that was closed, or whose writer was killed, open for writing.

    Raises:
        OSError: HDF5 cannot open it so.
    """
    close_left_open(path)
    return h5py.File(path, "r+", **_OPENING)


def set_text(file: h5py.File, name: str, text: str) -> None:
    """An attribute of fixed length: it lies in the header, which HDF5 guards by a checksum."""
    content = text.encode()
    file.attrs.create(name, content, dtype=h5py.string_dtype("utf-8", len(content)))


def number(file: h5py.File, entry: Entry) -> h5py.Dataset:
    """A dataset of one number, 0 at first."""
    return file.create_dataset(entry.name, data=0, dtype=entry.dtype)


def growing(file: h5py.File, entry: Entry, dimension: int, grain_count: int) -> h5py.Dataset:
    """An empty dataset that can grow; large ones are compressed and checked by a checksum."""
    row_shape = entry.row_shape(dimension, grain_count)
    large = entry.growth in RAGGED or "grains" in entry.shape
    if entry.growth in RAGGED:
        chunk = (min(max(grain_count // 4, 64), _LARGEST_CHUNK), *row_shape)
    elif "grains" in entry.shape:
        chunk = (1, min(row_shape[0], _LARGEST_CHUNK), *row_shape[1:])
    else:
        chunk = (256, *row_shape)
    return file.create_dataset(
        entry.name,
        shape=(0, *row_shape),
        maxshape=(None, *row_shape),
        chunks=chunk,
        dtype=entry.dtype,
        fillvalue=np.nan if entry.dtype == "float64" else None,
        **(_COMPRESSION if large else {}),
    )
