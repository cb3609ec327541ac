"""HDF5 files of other programs: plain datasets under hard links, trusting nothing declared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError
from granufab.io.checked_hdf5 import BROKEN, HDF5_SIGNATURE, LARGEST_RATIO, storage_fault
from granufab.io.global_heap import heaps_are_sound

__all__ = ["PlainHdf5", "holds_groups", "open_plain"]

_SMALL_BYTES = 65536  # what a dataset without storage may declare


def holds_groups(path: Path, head: bytes, *names: str) -> bool:
    """Whether a file is HDF5 with these groups at its root.

    Args:
        path: the file.
        head: its first bytes.
        names: of the groups.
    """
    if not head.startswith(HDF5_SIGNATURE):
        return False
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            return all(isinstance(file.get(name), h5py.Group) for name in names)
    except BROKEN:
        return False


@contextmanager
def open_plain(path: Path) -> Iterator[PlainHdf5]:
    """Open an HDF5 file for reading.

    Raises:
        CorruptFile: it cannot be opened, or what the block meets shows that it is damaged.
    """
    checked: PlainHdf5 | None = None
    try:
        with h5py.File(path, "r", locking="best-effort") as file:
            checked = PlainHdf5(file, path)
            yield checked
    except GranufabError:
        raise
    except BROKEN as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        size = path.stat().st_size
        where = f", {size} bytes long" if checked is None else f" at {checked.at}"
        raise CorruptFile(f"{path}: is truncated or damaged{where} ({reason})") from None


class PlainHdf5:
    """An open file; reads numbers in datasets that lie in the file itself.

    Args:
        file: the open file.
        path: for messages.
    Attributes:
        at: what was looked up last, for messages.
    """

    def __init__(self, file: h5py.File, path: Path) -> None:
        self._file = file
        self._hard: dict[str, bool] = {}
        self.path, self.at = path, "dataset /"

    def corrupt(self, text: str) -> CorruptFile:
        """The exception for a contradiction in this file."""
        return CorruptFile(f"{self.path}: {text}")

    def has(self, name: str) -> bool:
        """Whether there is a group or dataset of this name, as hard links all the way."""
        return self._node(name) is not None

    def children(self, name: str) -> list[str]:
        """Names in a group; none where there is no such group."""
        node = self._node(name)
        return list(node) if isinstance(node, h5py.Group) else []

    def attributes(self, name: str) -> dict[str, Any]:
        """Attributes of a group or dataset; bytes become text."""
        node = self._node(name)
        if node is None:
            return {}
        kinds = (h5py.check_string_dtype(node.attrs.get_id(key).dtype) for key in node.attrs)
        if any(kind and kind.length is None for kind in kinds) and not heaps_are_sound(self.path):
            raise self.corrupt(f"a heap with the attributes of dataset {name} is damaged")
        plain = {key: node.attrs[key] for key in node.attrs}
        return {k: v.decode("utf-8", "replace") if isinstance(v, bytes) else v
                for k, v in plain.items()}  # fmt: skip

    def array(self, name: str, *, rows: int | None = None) -> NDArray:
        """Numbers of a dataset.

        Args:
            name: path inside the file.
            rows: length that it must have.
        Raises:
            CorruptFile: it is missing, holds no numbers, declares more than is stored, or has
                another length.
        """
        data = self._dataset(name)
        if data.dtype.kind not in "iuf":
            raise self.corrupt(f"{name} has type {data.dtype}, expected numbers")
        if rows is not None and (not data.shape or data.shape[0] != rows):
            raise self.corrupt(f"{name} has shape {data.shape}, expected {rows} rows")
        return np.asarray(data[()])

    def text(self, name: str) -> str:
        """A short text."""
        data = self._dataset(name)
        value = data[()] if data.nbytes <= _SMALL_BYTES else b""
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

    def texts(self, name: str) -> list[str]:
        """A short list of texts of fixed length."""
        data = self._dataset(name)
        if data.dtype.kind != "S" or data.nbytes > _SMALL_BYTES:
            raise self.corrupt(f"{name} has type {data.dtype}, expected short texts")
        return [bytes(one).decode("utf-8", "replace").strip() for one in np.ravel(data[()])]

    def _dataset(self, name: str) -> h5py.Dataset:
        data = self._node(name)
        if not isinstance(data, h5py.Dataset):
            raise self.corrupt(f"{name} is missing, or is no dataset of this file")
        fault = storage_fault(data, name)
        stored = data.id.get_storage_size()
        if not fault and data.nbytes > max(LARGEST_RATIO * stored, _SMALL_BYTES):
            fault = f"{name} declares {data.nbytes} bytes, {stored} are stored"
        if fault:
            raise self.corrupt(fault)
        return data

    def _node(self, name: str) -> Any:
        parts = [part for part in name.split("/") if part]
        self.at = f"dataset {name}"
        for depth in range(1, len(parts) + 1):
            above = "/".join(parts[:depth])
            if above not in self._hard:
                link = self._file.get(above, getlink=True)
                self._hard[above] = isinstance(link, h5py.HardLink)
            if not self._hard[above]:
                return None
        return self._file[name]
