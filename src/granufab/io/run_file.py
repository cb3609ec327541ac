"""Writer of the run file: HDF5, frame by frame, readable after a kill at any moment.

All datasets are made before the first frame is written; from then on the file is in HDF5's
single-writer mode, in which metadata reach the disk in an order that never leaves it broken. A
frame counts once ``complete_frames`` says so, and that is raised after the frame is flushed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np

from granufab.errors import InvalidPacking, InvalidSettings
from granufab.history import SERIES_UNITS, Frame
from granufab.io.provenance import provenance as collect_provenance
from granufab.io.schema import (
    FORMAT_NAME,
    NAME_BYTES,
    SCHEMA,
    SCHEMA_VERSION,
    Entry,
    derived_branch,
    entries,
    source_value,
)
from granufab.io.summary import json_text, plain
from granufab.packing import Packing

__all__ = ["RunFileWriter"]

_COMPRESSION: dict[str, Any] = {
    "compression": "gzip",
    "compression_opts": 1,
    "shuffle": True,
    "fletcher32": True,
}
_LARGEST_CHUNK = 16384
_BRANCH_TOLERANCE = 1e-12
_RAGGED = ("contacts", "wall_contacts")


class RunFileWriter:
    """Write frames and series rows to an HDF5 run file as they come.

    A context manager and a :class:`granufab.history.Recorder`. Leaving the block closes the
    file; only :meth:`close` with a summary marks the run as finished.

    Args:
        path: the file; missing folders are made.
        settings: resolved settings with the seed, as plain data.
        provenance: added to versions, platform and CPU, which are recorded in any case.
        force: replace an existing file.
    Raises:
        InvalidSettings: the file exists or cannot be written, or the settings' ``name`` is longer
            than the file's schema allows.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        settings: Mapping[str, Any],
        provenance: Mapping[str, Any] | None = None,
        force: bool = False,
    ) -> None:
        self.path = Path(path)
        _path_name(settings.get("name", ""))
        attributes = {
            "format": FORMAT_NAME,
            "schema_version": SCHEMA_VERSION,
            "created": datetime.now(UTC).isoformat(),
            "settings": json.dumps(settings, ensure_ascii=False, default=plain),
            "provenance": json_text({**collect_provenance(), **(provenance or {})}),
            "dimension": 0,
            "grain_count": 0,
        }
        self._frames = 0
        self._rows = 0
        self._first: Packing | None = None
        self._file = _create(self.path, force)
        for name, value in attributes.items():
            self._file.attrs[name] = value
        self._counters = {e.name: _counter(self._file, e) for e in entries("scalar")}
        self._data = {e.name: _dataset(self._file, e, (), 256) for e in entries("rows", "bytes")}
        self._file.flush()

    @property
    def frame_count(self) -> int:
        """Frames written so far."""
        return self._frames

    @property
    def row_count(self) -> int:
        """Rows of the series written so far."""
        return self._rows

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def frame(self, frame: Frame) -> None:
        """Append a complete state and flush it.

        Raises:
            InvalidPacking: its grains differ from those of the first frame in number,
                dimension, radius, mass or identity.
            OSError: it could not be written; the frames before it are safe.
        """
        packing = frame.packing
        if self._first is None:
            self._start(packing)
        else:
            self._check_same_grains(self._first, packing)
        try:
            self._append_frame(frame)
            self._commit("complete_frames", self._frames + 1)
        except (OSError, RuntimeError) as error:
            raise self._failed(f"frame {self._frames}", error) from None
        self._frames += 1

    def row(self, row: Mapping[str, float]) -> None:
        """Append one row of the series and flush it; absent columns become NaN.

        Raises:
            InvalidSettings: it has an unknown column, or too long a name of the path.
            OSError: it could not be written; the rows before it are safe.
        """
        unknown = set(row) - set(SERIES_UNITS) - {"path"}
        if unknown:
            raise InvalidSettings(
                f"unknown series column {min(unknown)} (known: path, {', '.join(SERIES_UNITS)})"
            )
        name = _path_name(row.get("path", ""))
        try:
            for entry in entries("rows"):
                column = entry.name.removeprefix("series/")
                value = name if column == "path" else float(row.get(column, np.nan))
                self._append(entry, self._rows, value)
            self._commit("complete_rows", self._rows + 1)
        except (OSError, RuntimeError) as error:
            raise self._failed(f"row {self._rows}", error) from None
        self._rows += 1

    def close(self, summary: Mapping[str, Any] | None = None) -> None:
        """Close the file; a summary is stored and marks the run as finished.

        Args:
            summary: plain data; NaN and ±∞ become null.
        """
        if not self._file:
            return
        try:
            if summary is not None:
                text = np.frombuffer(json_text(summary).encode(), dtype=np.uint8)
                data = self._data["summary"]
                data.resize((len(text),))
                data[:] = text
                self._commit("finished", 1)
        finally:
            self._file.close()

    def _start(self, packing: Packing) -> None:
        dimension, count = packing.dimension, packing.grains.count
        self._file.attrs["dimension"] = dimension
        self._file.attrs["grain_count"] = count
        rows = min(max(count // 4, 64), _LARGEST_CHUNK)
        for entry in SCHEMA:
            if entry.growth == "grains":
                value = getattr(packing.grains, entry.name.removeprefix("grains/"))
                if value is not None:
                    self._file.create_dataset(entry.name, data=value, dtype=entry.dtype)
            elif entry.growth in ("frames", "frames + 1", *_RAGGED):
                shape = entry.row_shape(dimension, count)
                self._data[entry.name] = _dataset(self._file, entry, shape, rows)
        for group in _RAGGED:
            start = self._data[f"{group}/start"]
            start.resize((1,))
            start[0] = 0
        self._file.flush()
        self._file.swmr_mode = True
        self._first = packing

    def _append_frame(self, frame: Frame) -> None:
        values = {e.name: source_value(frame, e.source) for e in SCHEMA if e.source}
        held = {e.bit for e in SCHEMA if e.bit is not None and values[e.name] is not None}
        values["frames/present"] = sum(1 << bit for bit in held)
        if values["frames/time"] is None:
            values["frames/time"] = np.nan
        if _branch_is_derived(frame.packing):
            values["contacts/branch"] = None
        for entry in entries("frames"):
            self._append(entry, self._frames, values[entry.name])
        for group in _RAGGED:
            start = self._data[f"{group}/start"]
            first = int(start[self._frames])
            source = getattr(frame.packing, group)
            last = first + (0 if source is None else source.count)
            for entry in entries(group):
                data = self._data[entry.name]
                data.resize(last, axis=0)
                if values[entry.name] is not None and last > first:
                    data[first:last] = values[entry.name]
            start.resize((self._frames + 2,))
            start[self._frames + 1] = last

    def _append(self, entry: Entry, index: int, value: Any) -> None:
        data = self._data[entry.name]
        data.resize(index + 1, axis=0)
        if value is not None:
            data[index] = value

    def _commit(self, counter: str, value: int) -> None:
        self._file.flush()
        size = os.fstat(self._file.id.get_vfd_handle()).st_size
        self._counters["file_bytes"][()] = size
        self._counters[counter][()] = value
        self._file.flush()

    def _failed(self, what: str, error: Exception) -> OSError:
        reason = str(error).splitlines()[0]
        return OSError(
            f"{self.path}: {what} could not be written ({reason}); "
            f"{self._frames} frames and {self._rows} rows before it are safe"
        )

    def _check_same_grains(self, first: Packing, packing: Packing) -> None:
        where = f"frame {self._frames}"
        shapes = packing.grains.position.shape, first.grains.position.shape
        if shapes[0] != shapes[1]:
            (count, now), (begun, before) = shapes
            raise InvalidPacking(
                f"{where} has {count} grains in {now}D, but the run began with {begun} in "
                f"{before}D; write another file"
            )
        for name in ("radius", "mass", "number"):
            old, new = getattr(first.grains, name), getattr(packing.grains, name)
            if old is new:
                continue
            if old is None or new is None or not np.array_equal(old, new):
                raise InvalidPacking(
                    f"{where}: the grains' {name} differs from the first frame's, but a run file "
                    "keeps it once; write another file"
                )


def _path_name(name: object) -> bytes:
    stored = str(name).encode()
    if len(stored) > NAME_BYTES:
        raise InvalidSettings(f"name has {len(stored)} bytes, allowed at most {NAME_BYTES}: {name}")
    return stored


def _branch_is_derived(packing: Packing) -> bool:
    contacts = packing.contacts
    if contacts is None or contacts.branch is None or contacts.gap is None:
        return False
    radius = packing.grains.radius
    derived = derived_branch(radius, contacts.pair, contacts.normal, contacts.gap)
    allowed = _BRANCH_TOLERANCE * (radius[contacts.pair[:, 0]] + radius[contacts.pair[:, 1]])
    return bool((np.abs(contacts.branch - derived) <= allowed[:, None]).all())


def _create(path: Path, force: bool) -> h5py.File:
    if path.is_dir():
        raise InvalidSettings(f"{path}: is a folder, expected a file name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidSettings(
            f"{path.parent}: no folder can be made there ({error.strerror})"
        ) from None
    try:
        if force:
            path.unlink(missing_ok=True)
        return h5py.File(path, "x", libver=("v110", "latest"), locking="best-effort")
    except FileExistsError:
        raise InvalidSettings(f"{path}: exists already; use force to replace it") from None
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise InvalidSettings(f"{path}: cannot be written ({reason})") from None


def _counter(file: h5py.File, entry: Entry) -> h5py.Dataset:
    return file.create_dataset(entry.name, data=0, dtype=entry.dtype)


def _dataset(
    file: h5py.File, entry: Entry, row_shape: tuple[int, ...], ragged_rows: int
) -> h5py.Dataset:
    """An empty dataset that can grow; large ones are compressed and checked by a checksum."""
    large = entry.growth in _RAGGED or "grains" in entry.shape
    if entry.growth in _RAGGED:
        chunk = (ragged_rows, *row_shape)
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
