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

import numpy as np
from numpy.typing import NDArray

from granufab.errors import GranufabError, InvalidPacking, InvalidSettings
from granufab.history import SERIES_UNITS, Frame
from granufab.io.abandoned_hdf5 import FAULTS, give_up, reason_of
from granufab.io.provenance import provenance as collect_provenance
from granufab.io.run_file_checksum import frame_checksum, row_checksums, text_checksum
from granufab.io.run_file_layout import RAGGED, create_file, growing, number, set_text
from granufab.io.run_lock import RunLock
from granufab.io.schema import (
    FORMAT_NAME,
    FRAME_CHECKSUM,
    NAME_BYTES,
    ROW_CHECKSUM,
    SCHEMA,
    SCHEMA_VERSION,
    entries,
)
from granufab.io.stored_frame import stored_frame
from granufab.io.summary import json_text, plain
from granufab.packing import Grains

__all__ = ["RunFileWriter"]


class RunFileWriter:
    """Write frames and series rows to an HDF5 run file as they come.

    A context manager and a :class:`granufab.history.Recorder`. Leaving the block closes the
    file; only :meth:`close` with a summary marks the run as finished. Until it is closed the
    writer holds ``.<name>.lock`` beside the file, so that no other process writes there; it does
    without where this process holds the folder by a :class:`granufab.io.run_lock.RunLock`.

    Args:
        path: the file; missing folders are made.
        settings: resolved settings with the seed, as plain data.
        provenance: added to versions, platform and CPU, which are recorded in any case.
        force: replace an existing file.
    Raises:
        InvalidSettings: the file exists, cannot be written or is written by another process, or
            the settings' ``name`` is longer than the file's schema allows.
    """

    _given_up = False

    def __init__(
        self,
        path: Path | str,
        *,
        settings: Mapping[str, Any],
        provenance: Mapping[str, Any] | None = None,
        force: bool = False,
    ) -> None:
        _path_name(settings.get("name", ""))
        texts = {
            "created": datetime.now(UTC).isoformat(),
            "settings": json.dumps(settings, ensure_ascii=False, default=plain),
            "provenance": json_text({**collect_provenance(), **(provenance or {})}),
        }
        self._begin(Path(path), texts, force)

    @classmethod
    def of_texts(cls, path: Path | str, texts: Mapping[str, str]) -> Self:
        """A writer of a new file with the texts of another one.

        Args:
            path: the file, which must not exist.
            texts: the attributes ``created``, ``settings`` and ``provenance`` as they are stored.
        Raises:
            InvalidSettings: the file exists or cannot be written.
        """
        writer = cls.__new__(cls)
        writer._begin(Path(path), texts, False)
        return writer

    @classmethod
    def continued(cls, path: Path | str, *, frames: int, rows: int) -> Self:
        """A writer that goes on with an existing run file, whole or left by a killed writer.

        What is beyond ``frames`` and ``rows`` is dropped, a summary too. The file is changed in
        place, in an order that leaves it readable at any moment. One of an older schema, or that
        HDF5 cannot open for writing, is first replaced by a copy of its complete frames and rows.

        Args:
            path: the file.
            frames: complete frames to keep.
            rows: rows of the series to keep.
        Raises:
            MissingData: there is no such file.
            UnknownFormat: it is no run file.
            CorruptFile: it holds fewer sound frames or rows than that.
            InvalidSettings: it cannot be written, or is written by another process.
        """
        from granufab.io.continued_run_file import open_to_continue  # it copies by this writer

        writer = cls.__new__(cls)
        writer.path = Path(path)
        writer._lock = _locked(writer.path)
        try:
            writer._first, writer._file = open_to_continue(writer.path, frames, rows)
            writer._resume(frames, rows)
        except BaseException:
            writer._release()
            raise
        return writer

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
        self._check_open(f"frame {self._frames}")
        grains = frame.packing.grains
        if self._first is not None:
            self._check_same_grains(self._first, grains)
        try:
            if self._first is None:
                self._start(grains)
            self._append_frame(stored_frame(frame))
            self._commit("complete_frames", self._frames + 1)
        except GranufabError:
            raise
        except FAULTS as error:
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
        self._check_open(f"row {self._rows}")
        values = {f"series/{name}": float(row.get(name, np.nan)) for name in SERIES_UNITS}
        stored = {name: np.array([value]) for name, value in values.items()}
        stored["series/path"] = np.array([_path_name(row.get("path", ""))], f"S{NAME_BYTES}")
        self.stored_rows(stored)

    def stored_rows(self, columns: Mapping[str, NDArray]) -> None:
        """Append rows as another run file stores them, and flush them.

        Args:
            columns: all columns of the series by entry name, each of shape (row_count,).
        Raises:
            OSError: they could not be written; the rows before them are safe.
        """
        end = self._rows + len(columns["series/path"])
        try:
            for name, value in columns.items():
                self._put_rows(name, self._rows, end, value)
            self._put_rows(ROW_CHECKSUM, self._rows, end, row_checksums(columns, self._rows))
            self._commit("complete_rows", end)
        except GranufabError:
            raise
        except FAULTS as error:
            raise self._failed(f"row {self._rows}", error) from None
        self._rows = end

    def close(self, summary: Mapping[str, Any] | None = None) -> None:
        """Close the file; a summary is stored and marks the run as finished.

        Args:
            summary: plain data; NaN and ±∞ become null.
        Raises:
            OSError: it could not be written; frames and rows are safe.
        """
        if not self._file or self._given_up:
            self._release()
            return
        try:
            if summary is not None:
                text = json_text(summary).encode()
                data = self._data["summary"]
                data.resize((len(text),))
                data[:] = np.frombuffer(text, dtype=np.uint8)
                checksum = text_checksum(self._frames, self._rows, text)
                self._counters["summary_checksum"][()] = np.uint64(checksum)
                self._commit("finished", 1)
            self._file.flush()
            self._file.close()
        except GranufabError:
            raise
        except FAULTS as error:
            raise self._failed("the end of the file", error) from None
        finally:
            self._release()

    def _begin(self, path: Path, texts: Mapping[str, str], force: bool) -> None:
        self.path = path
        self._frames = self._rows = 0
        self._first: Grains | None = None
        self._lock = _locked(path)
        try:
            self._file = create_file(path, force)
            checksum = text_checksum(SCHEMA_VERSION, *(texts[name] for name in sorted(texts)))
            for name, text in {"format": FORMAT_NAME, **texts}.items():
                set_text(self._file, name, text)
            attributes = {"schema_version": SCHEMA_VERSION, "dimension": 0, "grain_count": 0}
            for name, value in {**attributes, "checksum": np.uint64(checksum)}.items():
                self._file.attrs[name] = value
            self._counters: dict[str, Any] = {
                e.name: number(self._file, e) for e in entries("scalar")
            }
            growth = entries("rows", "bytes")
            self._data: dict[str, Any] = {e.name: growing(self._file, e, 0, 1024) for e in growth}
            self._file.flush()
        except BaseException as error:
            self._release()
            if isinstance(error, FAULTS) and hasattr(self, "_file"):
                raise self._failed("its head", error) from None
            raise

    def _resume(self, frames: int, rows: int) -> None:
        """Take over an open file; what is to be dropped cannot come back after a kill."""
        self._frames, self._rows = frames, rows
        self._counters = {e.name: self._file[e.name] for e in entries("scalar")}
        growths = ("frames", "frames + 1", "rows", "bytes", *RAGGED)
        self._data = {e.name: self._file[e.name] for e in entries(*growths) if e.name in self._file}
        if self._first is not None:
            self._file.swmr_mode = True
        counts = {"finished": 0, "summary_checksum": 0}
        for name, value in {**counts, "complete_frames": frames, "complete_rows": rows}.items():
            self._counters[name][()] = value
            self._file.flush()
        for name, kept in ((FRAME_CHECKSUM, frames), (ROW_CHECKSUM, rows)):
            if name in self._data and len(self._data[name]) > kept:
                self._data[name][kept:] = 0
        self._file.flush()

    def _start(self, grains: Grains) -> None:
        dimension, count = grains.dimension, grains.count
        self._file.attrs["dimension"] = dimension
        self._file.attrs["grain_count"] = count
        for entry in SCHEMA:
            if entry.growth == "grains":
                value = getattr(grains, entry.name.removeprefix("grains/"))
                if value is not None:
                    self._file.create_dataset(entry.name, data=value, dtype=entry.dtype)
            elif entry.growth in ("frames", "frames + 1", *RAGGED):
                self._data[entry.name] = growing(self._file, entry, dimension, count)
        for group in RAGGED:
            self._put(f"{group}/start", 0, 0)
        self._file.flush()
        self._file.swmr_mode = True
        self._first = grains

    def _append_frame(self, values: dict[str, NDArray]) -> None:
        for entry in entries("frames"):
            if entry.name != FRAME_CHECKSUM:
                self._put(entry.name, self._frames, values.get(entry.name))
        for group in RAGGED:
            name = f"{group}/start"
            first = int(self._data[name][self._frames])
            held = [values[entry.name] for entry in entries(group) if entry.name in values]
            last = first + (len(held[0]) if held else 0)
            for entry in entries(group):
                self._put_rows(entry.name, first, last, values.get(entry.name))
            self._put(name, self._frames + 1, last)
            values[name] = np.array([first, last])
        self._put(FRAME_CHECKSUM, self._frames, np.uint64(frame_checksum(self._frames, values)))

    def _put(self, name: str, index: int, value: Any) -> None:
        """Set one record; what an earlier run left there is replaced, also by nothing."""
        data = self._data[name]
        if len(data) <= index:
            data.resize(index + 1, axis=0)
        elif value is None:
            value = data.fillvalue
        if value is not None:
            data[index] = value

    def _put_rows(self, name: str, first: int, last: int, value: NDArray | None) -> None:
        data = self._data[name]
        if len(data) < last:
            data.resize(last, axis=0)
        if value is not None and last > first:
            data[first:last] = value

    def _commit(self, counter: str, value: int) -> None:
        self._file.flush()
        size = os.fstat(self._file.id.get_vfd_handle()).st_size
        self._counters["file_bytes"][()] = size
        self._counters[counter][()] = value
        self._file.flush()

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.release()

    def _check_open(self, what: str) -> None:
        """Refuse to write on after a failure, which has closed the file."""
        if not self._file or self._given_up:
            raise OSError(f"{self.path}: {what} cannot be written, the file was closed")

    def _failed(self, what: str, error: Exception) -> OSError:
        self._given_up = True  # HDF5 may keep it open: it must not be touched again
        give_up(self._file)
        return OSError(
            f"{self.path}: {what} could not be written ({reason_of(error)}); "
            f"{self._frames} frames and {self._rows} rows before it are safe"
        )

    def _check_same_grains(self, first: Grains, grains: Grains) -> None:
        where = f"frame {self._frames}"
        shapes = grains.position.shape, first.position.shape
        if shapes[0] != shapes[1]:
            (count, now), (begun, before) = shapes
            raise InvalidPacking(
                f"{where} has {count} grains in {now}D, but the run began with {begun} in "
                f"{before}D; write another file"
            )
        for name in ("radius", "mass", "number"):
            old, new = getattr(first, name), getattr(grains, name)
            if old is new:
                continue
            if old is None or new is None or not np.array_equal(old, new):
                raise InvalidPacking(
                    f"{where}: the grains' {name} differs from the first frame's, but a run file "
                    "keeps it once; write another file"
                )


def _locked(path: Path) -> RunLock | None:
    """The file's lock; None where this process holds its folder's."""
    if path.is_dir():
        raise InvalidSettings(f"{path}: is a folder, expected a file name")
    if RunLock.is_held_here(path.parent):
        return None
    lock = RunLock(path.parent, name=f".{path.name}.lock")
    lock.acquire()
    return lock


def _path_name(name: object) -> bytes:
    stored = str(name).encode()
    if len(stored) > NAME_BYTES:
        raise InvalidSettings(f"name has {len(stored)} bytes, allowed at most {NAME_BYTES}: {name}")
    return stored
