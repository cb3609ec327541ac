"""Verify run files and checkpoints, and write clean copies of damaged run files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings, MissingData, UnknownFormat
from granufab.history import Frame
from granufab.io.checked_hdf5 import BROKEN, HDF5_SIGNATURE, CheckedFile, is_run_file, opened
from granufab.io.checkpoint_file import is_checkpoint, verify_checkpoint
from granufab.io.copied_run_file import copy_rows, sync_file
from granufab.io.frame_reader import read_frame
from granufab.io.run_counts import frame_count, row_blocks, row_count, summary_bytes
from granufab.io.run_file import RunFileWriter
from granufab.io.summary import replacing

__all__ = ["FileReport", "check_file", "files_to_check", "repair_run_file"]

_HEAD = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class FileReport:
    """What was found in a file, or taken over from it.

    Attributes:
        path: the file.
        kind: ``run file`` or ``checkpoint``.
        schema_version: of a run file; None if it is not known.
        frames: that the file promises.
        sound_frames: of these, read and right.
        rows: of the series that the file promises.
        sound_rows: of these, read and right.
        finished: whether the run has ended and its summary is right; None for a checkpoint.
        faults: each in one line.
        notes: what is worth knowing, but no fault.
    """

    path: Path
    kind: str
    schema_version: int | None = None
    frames: int | None = None
    sound_frames: int | None = None
    rows: int | None = None
    sound_rows: int | None = None
    finished: bool | None = None
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def files_to_check(path: Path) -> list[Path]:
    """The file itself; of a folder, the run files and checkpoints in it.

    Raises:
        MissingData: there is none.
    """
    if not path.is_dir():
        return [path]
    found = [one for one in sorted(path.iterdir()) if one.is_file() and _kind(one)]
    if not found:
        raise MissingData(f"{path}: holds no run file and no checkpoint; name a file")
    return found


def check_file(path: Path) -> FileReport:
    """Read all of a run file or checkpoint and compare it with its checksums.

    No more than a frame is held in memory. A file that is still written is read as far as it is
    complete.

    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is neither.
    """
    if not path.is_file():
        raise MissingData(f"{path}: " + ("is a folder" if path.is_dir() else "no such file"))
    kind = _kind(path)
    if not kind:
        raise UnknownFormat(f"{path}: is neither a run file nor a checkpoint of granufab")
    try:
        if kind == "checkpoint":
            verify_checkpoint(path)
            return FileReport(path=path, kind=kind)
        with opened(path) as file:
            return _check_run_file(file, lambda frame: None)
    except CorruptFile as error:
        return FileReport(path=path, kind=kind, faults=(_without(path, error),))


def repair_run_file(path: Path, target: Path) -> FileReport:
    """Copy the complete and sound frames and rows of a run file into a new one.

    The file itself is only read. The new one appears when it is whole; a summary is taken over
    if nothing had to be dropped. No more than a frame is held in memory.

    Args:
        path: the damaged file.
        target: the new file, which must not exist.
    Returns:
        What was found; ``faults`` are what was dropped, or could not be read.
    Raises:
        MissingData: there is no such file.
        UnknownFormat: it is no run file.
        CorruptFile: not even its beginning can be read.
        InvalidSettings: the new file exists or cannot be written.
    """
    if target.exists() or target.is_symlink():
        raise InvalidSettings(f"{target}: exists already; name a new file")
    if path.is_file() and _kind(path) == "checkpoint":
        raise InvalidSettings(f"{path}: is a checkpoint, which is sound as a whole or not at all")
    with opened(path) as file, replacing(target) as temporary:
        with RunFileWriter.of_texts(temporary, file.texts()) as writer:
            report = _check_run_file(file, writer.frame)
            copy_rows(file, writer, report.rows or 0)
            if report.finished and not report.faults:
                text = summary_bytes(file, writer.frame_count, writer.row_count) or b"{}"
                writer.close(file.parse_json(text.decode(), "summary"))
        sync_file(temporary)
    return report


def _check_run_file(file: CheckedFile, take: Callable[[Frame], None]) -> FileReport:
    """Look at everything; ``take`` is called with each frame that is sound."""
    faults = ["is truncated"] if file.truncated else []
    frames = _counted(file, "complete_frames", frame_count, faults)
    rows = _counted(file, "complete_rows", row_count, faults)
    sound = 0
    for index in range(frames):
        try:
            frame = read_frame(file, index, str(file.path))
        except CorruptFile as error:
            faults.append(_without(file.path, error))
        else:
            take(frame)
            sound += 1
    sound_rows, bad_rows = _check_rows(file, rows)
    faults += bad_rows
    finished = False
    try:
        finished = not file.truncated and summary_bytes(file, frames, rows) is not None
    except BROKEN as error:
        faults.append(_without(file.path, error))
    return FileReport(
        path=file.path,
        kind="run file",
        schema_version=file.version,
        frames=frames,
        sound_frames=sound,
        rows=rows,
        sound_rows=sound_rows,
        finished=finished,
        faults=tuple(faults),
        notes=_notes(file),
    )


def _counted(
    file: CheckedFile, counter: str, count: Callable[[CheckedFile], int], faults: list[str]
) -> int:
    """Records to look at: those that count, or are promised where they contradict each other."""
    try:
        promised = file.promised(counter)
        return promised if file.truncated else max(promised, count(file))
    except BROKEN as error:
        faults.append(_without(file.path, error))
    try:
        return file.promised(counter)
    except BROKEN:
        return 0


def _check_rows(file: CheckedFile, count: int) -> tuple[int, list[str]]:
    """Sound rows, and one line for each run of damaged ones."""
    sound, damaged = 0, []
    for first, last, columns in row_blocks(file, count):
        missing = np.setdiff1d(np.arange(first, last), columns["index"])
        sound += last - first - len(missing)
        for start, end in _stretches(missing):
            rows = f"row {start} does" if end == start else f"rows {start} to {end} do"
            damaged.append(f"{rows} not match the checksum or cannot be read")
    return sound, damaged


def _stretches(indices: np.ndarray) -> list[tuple[int, int]]:
    """First and last of each stretch of consecutive numbers."""
    if len(indices) == 0:
        return []
    parts = np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1)
    return [(int(part[0]), int(part[-1])) for part in parts]


def _notes(file: CheckedFile) -> tuple[str, ...]:
    notes = []
    if file.unclosed:
        notes.append("was not closed: its writer was killed, or is at work")
    if file.version == 1:
        notes.append("schema version 1 has no checksums: a changed number may go unseen")
    return tuple(notes)


def _without(path: Path, error: Exception) -> str:
    """The message of an error, without the file's name and in one line."""
    return " ".join(str(error).removeprefix(f"{path}: ").split())


def _kind(path: Path) -> str:
    """``run file``, ``checkpoint``, or nothing for others."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    if is_checkpoint(head):
        return "checkpoint"
    return "run file" if head.startswith(HDF5_SIGNATURE) and is_run_file(path, head) else ""
