"""Open a run file and read entries of the schema, trusting nothing that it declares."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError, MissingData, UnknownFormat
from granufab.io.global_heap import heaps_are_sound
from granufab.io.run_file_checksum import text_checksum
from granufab.io.schema import FORMAT_NAME, SCHEMA_VERSION, Entry, named
from granufab.io.unclosed_hdf5 import (
    SUPERBLOCK_BYTES,
    UnclosedFile,
    is_truncated,
    is_unclosed,
)

__all__ = [
    "BROKEN",
    "HDF5_SIGNATURE",
    "LARGEST_RATIO",
    "CheckedFile",
    "first_line",
    "is_run_file",
    "opened",
    "storage_fault",
]

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_LARGEST_CHUNK_BYTES = 16 * 2**20
_KEPT = 2**20  # bytes of chunks of each dataset in memory; HDF5 2.0 would keep 8 MiB
_LEAST_RECORD = 128  # bytes that any frame and any row takes, uncompressed
LARGEST_RATIO = 1100  # deflate shrinks by 1032 at most, so no dataset declares more than this
BROKEN = (
    OSError,
    RuntimeError,
    KeyError,
    ValueError,
    TypeError,
    IndexError,
    OverflowError,
    MemoryError,
)


def is_run_file(path: Path, head: bytes) -> bool:
    """Whether a file is a run file, from its content; HDF5 that cannot be opened may be one.

    Args:
        path: the file.
        head: its first bytes.
    """
    if not head.startswith(HDF5_SIGNATURE):
        return False
    try:
        with _open(path) as (file, *_):
            return _text(file, "format", path) == FORMAT_NAME
    except BROKEN:
        return True


@contextmanager
def opened(path: Path) -> Iterator[CheckedFile]:
    """Open a run file for reading, also while it is written or after its writer was killed.

    A truncated one opens too if its beginning is sound and it carries checksums.

    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is no run file, or of a newer schema.
        CorruptFile: it is truncated or contradicts itself; what the block meets included.
    """
    if not path.is_file():
        raise MissingData(f"{path}: " + ("is a folder" if path.is_dir() else "no such file"))
    try:
        with _open(path) as (file, unclosed, truncated):
            yield CheckedFile(file, path, unclosed, truncated)
    except GranufabError:
        raise
    except BROKEN as error:
        raise CorruptFile(f"{path}: cannot be read as a run file ({first_line(error)})") from None


def first_line(error: Exception) -> str:
    """The first line of an exception's text, or its kind."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


@contextmanager
def _open(path: Path) -> Iterator[tuple[h5py.File, bool, bool]]:
    """An HDF5 file, whether its writer has not closed it, and whether it was longer then."""
    with path.open("rb") as stream:
        head = stream.read(SUPERBLOCK_BYTES)
    if not head.startswith(HDF5_SIGNATURE):
        raise UnknownFormat(f"{path}: is not an HDF5 file, so not a granufab run file")
    unclosed = is_unclosed(head)
    truncated = not unclosed and is_truncated(head, path.stat().st_size)
    with ExitStack() as stack:
        try:
            if unclosed or truncated:
                stream = stack.enter_context(UnclosedFile(path))
                file = stack.enter_context(h5py.File(stream, "r", rdcc_nbytes=_KEPT))
            else:
                file = stack.enter_context(
                    h5py.File(path, "r", locking="best-effort", rdcc_nbytes=_KEPT)
                )
        except OSError as error:
            raise CorruptFile(f"{path}: is truncated or damaged ({first_line(error)})") from None
        yield file, unclosed, truncated


def _text(file: h5py.File, name: str, path: Path) -> str | None:
    """A text attribute, of fixed length or (in version 1) not; None where there is none.

    Raises:
        CorruptFile: its text cannot be read without HDF5 turning in a loop.
    """
    if name not in file.attrs:
        return None
    kind = h5py.check_string_dtype(file.attrs.get_id(name).dtype)
    if kind is None:
        return None
    if kind.length is None and not heaps_are_sound(path):
        raise CorruptFile(f"{path}: a heap with the text of its attributes is damaged")
    value = file.attrs[name]
    if isinstance(value, bytes):
        return value.decode()
    return value if isinstance(value, str) else None


class CheckedFile:
    """An open run file; reads only entries of the schema, as hard links to plain datasets.

    Args:
        file: the open file.
        path: for messages.
        unclosed: whether its writer has not closed it.
        truncated: whether it was longer when it was closed.
    """

    def __init__(self, file: h5py.File, path: Path, unclosed: bool, truncated: bool) -> None:
        self._file = file
        self._known: dict[str, h5py.Dataset] = {}
        self.path = path
        self.unclosed = unclosed
        if _text(file, "format", path) != FORMAT_NAME:
            raise UnknownFormat(f"{path}: is HDF5, but not a granufab run file")
        self.version = self.whole("schema_version")
        if self.version > SCHEMA_VERSION:
            raise UnknownFormat(
                f"{path}: has schema_version {self.version}, this granufab reads up to "
                f"{SCHEMA_VERSION}; update granufab"
            )
        self.dimension = self.whole("dimension")
        self.grain_count = self.whole("grain_count")
        size = path.stat().st_size
        self._size = size
        self.most_records = size // _LEAST_RECORD
        self.truncated = truncated or (unclosed and size < self.counter("file_bytes"))
        if self.truncated and self.version == 1:
            raise self.corrupt(f"is truncated at {size} bytes; copy it again")
        if self.version > 1:
            checksum = text_checksum(self.version, *self.texts().values())
            if self.whole("checksum") != checksum:
                raise self.corrupt("settings or provenance do not match their checksum")

    def corrupt(self, text: str) -> CorruptFile:
        """The exception for a contradiction in this file."""
        return CorruptFile(f"{self.path}: {text}")

    def text(self, name: str) -> str:
        """A text attribute of the root group."""
        value = _text(self._file, name, self.path)
        if value is None:
            raise self.corrupt(f"attribute {name} is missing or not text")
        return value

    def texts(self) -> dict[str, str]:
        """The text attributes that a copy of the file takes over, by name in order."""
        return {name: self.text(name) for name in ("created", "provenance", "settings")}

    def whole(self, name: str) -> int:
        """A whole-number attribute of the root group."""
        value = self._file.attrs[name]
        if not isinstance(value, np.integer):
            raise self.corrupt(f"attribute {name} is not a whole number")
        return int(value)

    def json(self, name: str) -> dict[str, Any]:
        """A JSON attribute of the root group."""
        return self.parse_json(self.text(name), name)

    def parse_json(self, text: str, name: str) -> dict[str, Any]:
        """``text`` as a JSON object."""
        try:
            value = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise self.corrupt(f"{name} is not valid JSON ({error})") from None
        if not isinstance(value, dict):
            raise self.corrupt(f"{name} is not a JSON object")
        return value

    def promised(self, counter: str) -> int:
        """Records that a counter promises, but no more than the file has room for."""
        return min(self.counter(counter), self.most_records)

    def counter(self, name: str) -> int:
        """A scalar counter, ≥ 0."""
        value = int(self._dataset(named(name))[()])
        if value < 0:
            raise self.corrupt(f"{name} is {value}")
        return value

    def records(self, counter: str, names: tuple[Entry, ...]) -> int:
        """Complete records that a counter promises, after checking that all entries hold them."""
        count = self.counter(counter)
        started = counter == "complete_frames" and count > 0
        if started and (self.dimension not in (2, 3) or self.grain_count < 1):
            raise self.corrupt(f"{self.grain_count} grains in {self.dimension} dimensions")
        for entry in names:
            if not self.holds(entry):
                continue
            length = len(self._dataset(entry))
            if length < count:
                raise self.corrupt(f"{entry.name} holds {length} of {count} records")
        return count

    def holds(self, entry: Entry) -> bool:
        """False for an entry that may be missing, because an earlier granufab knew it not.

        That are optional entries (a frame that claims to hold one is refused), columns of the
        series, and what later versions of the schema have added.
        """
        column = entry.growth == "rows" and entry.dtype == "float64"
        if entry.since > self.version:
            return False
        return entry.name in self._file or not (entry.bit is not None or column)

    def has(self, names: tuple[Entry, ...]) -> bool:
        """Whether all these entries are in the file."""
        return all(entry.name in self._file for entry in names)

    def length(self, entry: Entry) -> int:
        """Records in a growing dataset, complete or not."""
        return len(self._dataset(entry))

    def once(self, entry: Entry) -> NDArray | None:
        """A dataset that does not grow; None where it may be missing and is."""
        if entry.default == "None" and entry.name not in self._file:
            return None
        return self._dataset(entry)[()]

    def rows(self, entry: Entry, first: int, last: int) -> NDArray:
        """Rows ``first`` to ``last − 1`` of a growing dataset."""
        data = self._dataset(entry)
        if not 0 <= first <= last <= len(data):
            raise self.corrupt(f"{entry.name} holds {len(data)} rows, wanted {first}..{last}")
        if first == last:
            return np.empty((0, *data.shape[1:]), data.dtype)
        written = min(data.id.get_storage_size(), self._size)
        bytes_ = (last - first) * data.dtype.itemsize * int(np.prod(data.shape[1:]))
        if written and bytes_ > LARGEST_RATIO * written:
            raise self.corrupt(f"{entry.name} declares {bytes_} bytes, {written} are stored")
        return data[first:last]

    def everything(self, entry: Entry) -> NDArray:
        """All rows of a growing dataset."""
        return self.rows(entry, 0, len(self._dataset(entry)))

    def _dataset(self, entry: Entry) -> h5py.Dataset:
        """The dataset of an entry, after checking link, type, shape, storage and filters."""
        name = entry.name
        if name in self._known:
            return self._known[name]
        parts = name.split("/")
        for depth in range(1, len(parts) + 1):
            link = self._file.get("/".join(parts[:depth]), getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise self.corrupt(f"{name} is missing or a link to elsewhere")
        data = self._file[name]
        if not isinstance(data, h5py.Dataset):
            raise self.corrupt(f"{name} is not a dataset")
        if data.dtype != np.dtype(entry.dtype):
            raise self.corrupt(f"{name} has type {data.dtype}, expected {entry.dtype}")
        fixed = entry.growth in ("scalar", "grains")
        wanted = entry.row_shape(self.dimension, self.grain_count)
        shape = data.shape if fixed else data.shape[1:]
        if shape != wanted or (not fixed and len(data.shape) != len(entry.shape)):
            raise self.corrupt(f"{name} has shape {data.shape}, expected {wanted} per record")
        fault = storage_fault(data, name)
        if fault:
            raise self.corrupt(fault)
        self._known[name] = data
        return data


def storage_fault(data: h5py.Dataset, name: str) -> str:
    """Why a dataset is not read (in another file, filters, more declared than stored), or ""."""
    if data.is_virtual or data.external:
        return f"{name} lies in another file"
    properties = data.id.get_create_plist()
    filters = {properties.get_filter(k)[0] for k in range(properties.get_nfilters())}
    if not filters <= _FILTERS:
        return f"{name} has filters other than gzip, shuffle and fletcher32"
    if data.chunks is None:
        if data.id.get_storage_size() < data.nbytes:
            return f"{name} declares {data.nbytes} bytes that are not stored"
    elif data.dtype.itemsize * int(np.prod(data.chunks)) > _LARGEST_CHUNK_BYTES:
        return f"{name} has chunks of {data.chunks} items, too large"
    return ""
