"""Read a run file: frames lazily, and no further than its writer's counters promise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError
from granufab.history import SERIES_UNITS, Frame, Run, StepStatistics, series_dataset
from granufab.io.checked_hdf5 import CheckedFile, opened
from granufab.io.schema import (
    FORMAT_NAME,
    SCHEMA_VERSION,
    derived_branch,
    entries,
    named,
)
from granufab.packing import Array, Cell, Contacts, Grains, Packing, WallContacts

__all__ = ["RunFileFrames", "describe", "read_run"]


def read_run(path: Path | str) -> Run:
    """Open a run file; a frame is read when it is asked for.

    A file whose writer was killed opens up to its last complete frame and row; one that is
    still written opens up to what is complete now.

    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is not a run file, or of a newer schema than this version reads.
        CorruptFile: it is truncated or contradicts itself.
    """
    path = Path(path)
    with opened(path) as file:
        settings = file.json("settings")
        series, name = _series(file, settings)
        return Run(
            series_source=series,
            frames=RunFileFrames(path, file.text("created"), _frame_count(file)),
            settings=settings,
            summary=_summary(file),
            name=name,
        )


def describe(path: Path | str) -> dict[str, Any]:
    """What a run file is, without reading its frames.

    Returns:
        Plain data: format, schema_version, created, finished, name, dimension, grain_count,
        frames, rows, bytes, provenance.
    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is not a run file, or of a newer schema than this version reads.
        CorruptFile: it is truncated or contradicts itself.
    """
    path = Path(path)
    with opened(path) as file:
        series, name = _series(file, file.json("settings"))
        return {
            "format": FORMAT_NAME,
            "schema_version": SCHEMA_VERSION,
            "created": file.text("created"),
            "finished": file.counter("finished") == 1,
            "name": name,
            "dimension": file.dimension,
            "grain_count": file.grain_count,
            "frames": _frame_count(file),
            "rows": series.sizes["record"],
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
        self._created = created
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
            if file.text("created") != self._created:
                raise file.corrupt("was replaced since it was opened; read it again")
            try:
                return _FrameReader(file, position).frame(self._source)
            except CorruptFile:
                raise
            except GranufabError as error:
                raise file.corrupt(f"frame {position}: {error}") from None


class _FrameReader:
    """Read one frame from an open file."""

    def __init__(self, file: CheckedFile, index: int) -> None:
        self._file = file
        self._index = index
        self._present = int(file.rows(named("frames/present"), index, index + 1)[0])

    def frame(self, source: str) -> Frame:
        packing = self._packing(source)
        fields: dict[str, Any] = {}
        statistics: dict[str, Any] = {}
        for entry in entries("frames"):
            if entry.name.startswith("frames/") and entry.source not in ("", "packing.time"):
                *parents, name = entry.source.split(".")
                value = self._value(entry.name)
                if value is not None and value.ndim == 0:
                    value = value.item()
                (statistics if parents else fields)[name] = value
        return Frame(packing=packing, statistics=StepStatistics(**statistics), **fields)

    def _packing(self, source: str) -> Packing:
        fields: dict[str, Any] = {
            entry.name.removeprefix("grains/"): self._file.once(entry)
            for entry in entries("grains")
        }
        for name in ("position", "velocity", "spin"):
            fields[name] = self._value(f"grains/{name}")
        grains = Grains(**fields)
        time = float(self._value("frames/time"))  # pyright: ignore[reportArgumentType]
        return Packing(
            grains=grains,
            contacts=self._contacts(grains.radius),
            cell=self._cell(),
            wall_contacts=self._wall_contacts(),
            time=None if np.isnan(time) else time,
            source=source,
        )

    def _cell(self) -> Cell | None:
        fields = self._group("cell", "frames")
        return None if fields["matrix"] is None else Cell(**fields)

    def _contacts(self, radius: Array) -> Contacts | None:
        fields = self._group("contacts", "contacts")
        if fields["pair"] is None:
            return None
        branch = fields["branch"]
        if branch is not None and branch.size and np.isnan(branch).all():
            if fields["gap"] is None:
                raise self._file.corrupt(f"frame {self._index} has neither branch nor gap")
            if ((fields["pair"] < 0) | (fields["pair"] >= len(radius))).any():
                raise self._file.corrupt(f"frame {self._index} joins grains that do not exist")
            fields["branch"] = derived_branch(
                radius, fields["pair"], fields["normal"], fields["gap"]
            )
        return Contacts(**fields)

    def _wall_contacts(self) -> WallContacts | None:
        fields = self._group("wall_contacts", "wall_contacts")
        return None if fields["grain"] is None else WallContacts(**fields)

    def _group(self, group: str, growth: str) -> dict[str, Any]:
        """The values of a group's entries by field name."""
        prefix = f"{group}/"
        return {
            entry.name.removeprefix(prefix): self._value(entry.name)
            for entry in entries(growth)
            if entry.name.startswith(prefix)
        }

    def _value(self, name: str) -> NDArray | None:
        """This frame's share of an entry; None where the frame lacks it."""
        entry = named(name)
        if entry.bit is not None and not self._present >> entry.bit & 1:
            return None
        if entry.growth == "frames":
            return np.asarray(self._file.rows(entry, self._index, self._index + 1)[0])
        start = named(f"{entry.growth}/start")
        first, last = self._file.rows(start, self._index, self._index + 2)
        return self._file.rows(entry, int(first), int(last))


def _frame_count(file: CheckedFile) -> int:
    count = file.counter("complete_frames")
    if count:
        file.records("complete_frames", entries("frames"))
        for entry in entries("frames + 1"):
            start = file.rows(entry, 0, count + 1)
            if start[0] != 0 or (np.diff(start) < 0).any():
                raise file.corrupt(f"{entry.name} does not grow from 0")
    return count


def _series(file: CheckedFile, settings: Mapping[str, Any]) -> tuple[Any, str]:
    """The series as a Dataset, and the path's name."""
    count = file.records("complete_rows", entries("rows"))
    columns = {name: file.rows(named(f"series/{name}"), 0, count) for name in SERIES_UNITS}
    stored = file.rows(named("series/path"), 0, min(count, 1))
    name = stored[0].decode() if count else ""
    name = name or str(settings.get("name", "run"))
    record = settings.get("record")
    attributes = {"path": name, "source": str(file.path)}
    if isinstance(record, dict):
        for key in ("criterion", "z_definition"):
            if isinstance(record.get(key), str):
                attributes[key] = record[key]
    rows = [{key: column[k] for key, column in columns.items()} for k in range(count)]
    return series_dataset(rows, attributes), name


def _summary(file: CheckedFile) -> dict[str, Any]:
    text = file.everything(named("summary")).tobytes()
    return file.parse_json(text.decode(), "summary") if text else {}
