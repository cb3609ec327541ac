"""Read a run file: frames lazily, and no further than its writer's counters promise."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

from granufab.errors import IncompleteFile
from granufab.history import SERIES_UNITS, Frame, Run, series_dataset
from granufab.io.checked_hdf5 import CheckedFile, opened
from granufab.io.frame_reader import read_frame
from granufab.io.run_counts import frame_count, read_rows, row_count, summary_bytes
from granufab.io.schema import FORMAT_NAME

__all__ = ["RunFileFrames", "describe", "read_run"]


def read_run(path: Path | str) -> Run:
    """Open a run file; a frame is read when it is asked for, and compared with its checksum.

    A file whose writer was killed opens up to its last complete frame and row; one that is
    still written opens up to what is complete now. A truncated one opens up to the last frame
    that is there, with a warning (:class:`granufab.errors.IncompleteFile`).

    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is not a run file, or of a newer schema than this version reads.
        CorruptFile: it is damaged or contradicts itself.
    """
    path = Path(path)
    with opened(path) as file:
        settings = file.json("settings")
        frames, rows = frame_count(file), row_count(file)
        series, name = _series(file, settings, rows)
        if file.truncated:
            text = f"{path}: is truncated; {frames} frames and {rows} rows are there: copy it again"
            warnings.warn(text, IncompleteFile, stacklevel=2)
        return Run(
            series_source=series,
            frames=RunFileFrames(path, file.text("created"), frames),
            settings=settings,
            summary=_summary(file, frames, rows) or {},
            name=name,
        )


def describe(path: Path | str) -> dict[str, Any]:
    """What a run file is, without reading its frames.

    Returns:
        Plain data: format, schema_version, created, finished, truncated, name, dimension,
        grain_count, frames, rows, bytes, provenance.
    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is not a run file, or of a newer schema than this version reads.
        CorruptFile: it is damaged or contradicts itself.
    """
    path = Path(path)
    with opened(path) as file:
        frames, rows = frame_count(file), row_count(file)
        _, name = _series(file, file.json("settings"), rows)
        return {
            "format": FORMAT_NAME,
            "schema_version": file.version,
            "created": file.text("created"),
            "finished": _summary(file, frames, rows) is not None,
            "truncated": file.truncated,
            "name": name,
            "dimension": file.dimension,
            "grain_count": file.grain_count,
            "frames": frames,
            "rows": rows,
            "bytes": path.stat().st_size,
            "provenance": file.json("provenance"),
        }


class RunFileFrames(Sequence[Frame]):
    """The frames of a run file; each access opens the file and reads that frame alone.

    Args:
        path: the run file.
        created: its ``created`` attribute, so that another run's file is not taken for it.
        count: its number of complete frames.
    """

    def __init__(self, path: Path, created: str, count: int) -> None:
        self.path = path.absolute()
        self._source = str(path)
        self.created = created
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Frame]:
        for index in range(self._count):
            yield self[index]

    @overload
    def __getitem__(self, index: int, /) -> Frame: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Frame]: ...
    def __getitem__(self, index: int | slice, /) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(self._count))]
        position = index + self._count if index < 0 else index
        if not 0 <= position < self._count:
            raise IndexError(f"{self._source}: no frame {index}, it holds {self._count}")
        with opened(self.path) as file:
            if file.text("created") != self.created:
                raise file.corrupt("was replaced since it was opened; read it again")
            return read_frame(file, position, self._source)


def _series(file: CheckedFile, settings: Mapping[str, Any], count: int) -> tuple[Any, str]:
    """The series as a Dataset, and the path's name."""
    stored = read_rows(file, 0, count)
    name = stored["series/path"][0].decode() if count else ""
    name = name or str(settings.get("name", "run"))
    record = settings.get("record")
    attributes = {"path": name, "source": str(file.path)}
    if isinstance(record, dict):
        for key in ("criterion", "z_definition"):
            if isinstance(record.get(key), str):
                attributes[key] = record[key]
    columns = {column: stored[f"series/{column}"] for column in SERIES_UNITS}
    rows = [{key: column[k] for key, column in columns.items()} for k in range(count)]
    return series_dataset(rows, attributes), name


def _summary(file: CheckedFile, frames: int, rows: int) -> dict[str, Any] | None:
    """The summary; None where the run has not ended, or its end is cut off."""
    if file.truncated:
        return None
    text = summary_bytes(file, frames, rows)
    if text is None:
        return None
    return file.parse_json(text.decode(), "summary") if text else {}
