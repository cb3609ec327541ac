"""Read one frame of an open run file, after comparing it with its checksum."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError
from granufab.history import Frame, StepStatistics
from granufab.io.checked_hdf5 import BROKEN, CheckedFile, first_line
from granufab.io.run_file_checksum import frame_checksum
from granufab.io.schema import FRAME_CHECKSUM, Entry, derived_branch, entries, named
from granufab.packing import Array, Cell, Contacts, Grains, Packing, WallContacts

__all__ = ["check_frame", "read_frame"]


def read_frame(file: CheckedFile, index: int, source: str) -> Frame:
    """A complete frame.

    Args:
        file: the open run file.
        index: of the frame, from 0.
        source: where the packing is said to come from.
    Raises:
        CorruptFile: its values do not match their checksum, or contradict each other.
    """
    try:
        return _FrameValues(file, index).frame(source)
    except CorruptFile:
        raise
    except GranufabError as error:
        raise file.corrupt(f"frame {index}: {error}") from None
    except BROKEN as error:
        raise file.corrupt(f"frame {index} cannot be read ({first_line(error)})") from None


def check_frame(file: CheckedFile, index: int) -> None:
    """Compare what is stored of a frame with its checksum.

    Raises:
        CorruptFile: they differ.
    """
    _FrameValues(file, index)


class _FrameValues:
    """What the file holds of a frame, and the records it makes."""

    def __init__(self, file: CheckedFile, index: int) -> None:
        self._file = file
        self._index = index
        first, last = index, index + 1
        present = int(file.rows(named("frames/present"), first, last)[0])
        self._values: dict[str, NDArray] = {}
        for entry in (*entries("grains"), *entries("frames")):
            if entry.name != FRAME_CHECKSUM and (entry.bit is None or present >> entry.bit & 1):
                value = file.once(entry) if entry.growth == "grains" else self._row(entry)
                if value is not None:
                    self._values[entry.name] = value
        for start in entries("frames + 1"):
            bounds = file.rows(start, index, index + 2)
            self._values[start.name] = bounds
            for entry in entries(start.name.removesuffix("/start")):
                if entry.bit is not None and present >> entry.bit & 1:
                    self._values[entry.name] = file.rows(entry, int(bounds[0]), int(bounds[1]))
        if file.version > 1:
            stored = int(file.rows(named(FRAME_CHECKSUM), first, last)[0])
            if stored != frame_checksum(index, self._values):
                raise file.corrupt(f"frame {index} does not match its checksum")

    def frame(self, source: str) -> Frame:
        packing = self._packing(source)
        fields: dict[str, Any] = {}
        statistics: dict[str, Any] = {}
        for entry in entries("frames"):
            if entry.name.startswith("frames/") and entry.source not in ("", "packing.time"):
                *parents, name = entry.source.split(".")
                value: Any = self._values.get(entry.name)
                if value is not None and value.ndim == 0:
                    value = value.item()
                (statistics if parents else fields)[name] = value
        return Frame(packing=packing, statistics=StepStatistics(**statistics), **fields)

    def _row(self, entry: Entry) -> NDArray:
        return np.asarray(self._file.rows(entry, self._index, self._index + 1)[0])

    def _packing(self, source: str) -> Packing:
        grains = Grains(**self._group("grains", "grains"), **self._group("grains", "frames"))
        time = float(self._values["frames/time"])
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
            entry.name.removeprefix(prefix): self._values.get(entry.name)
            for entry in entries(growth)
            if entry.name.startswith(prefix)
        }
