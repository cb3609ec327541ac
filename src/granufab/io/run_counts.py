"""How much of a run file is complete: what its counters promise and its checksums confirm."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from granufab.io.checked_hdf5 import BROKEN, CheckedFile
from granufab.io.frame_reader import check_frame
from granufab.io.run_file_checksum import row_checksums, text_checksum
from granufab.io.schema import FRAME_CHECKSUM, ROW_CHECKSUM, entries, named

__all__ = ["ROWS_AT_ONCE", "frame_count", "read_rows", "row_blocks", "row_count", "summary_bytes"]

ROWS_AT_ONCE = 256
"""Rows of a block; the datasets' chunks end with it."""


def frame_count(file: CheckedFile) -> int:
    """Complete frames.

    A frame that the counter does not promise, but that its checksum confirms, counts too: the
    writer was stopped between the two. Of a truncated file, what is not there does not count.

    Raises:
        CorruptFile: the counter and the stored lengths contradict each other.
    """
    if file.truncated:
        count = file.promised("complete_frames")
        return next((k for k in range(count, 0, -1) if _is_sound(file, k - 1)), 0)
    count = file.counter("complete_frames")
    if count:
        file.records("complete_frames", entries("frames"))
        for entry in entries("frames + 1"):
            start = file.rows(entry, 0, count + 1)
            if start[0] != 0 or (np.diff(start) < 0).any():
                raise file.corrupt(f"{entry.name} does not grow from 0")
    if file.version > 1 and file.grain_count:
        length = file.length(named(FRAME_CHECKSUM))
        while count < length and _is_sound(file, count):
            count += 1
    return count


def row_count(file: CheckedFile) -> int:
    """Complete rows of the series, counted as :func:`frame_count` does."""
    if file.truncated:
        count = file.promised("complete_rows")
        firsts = reversed(range(0, count, ROWS_AT_ONCE))
        ends = ((first, first + _sound_rows(file, first, count)) for first in firsts)
        return next((end for first, end in ends if end > first), 0)
    count = file.records("complete_rows", entries("rows"))
    if file.version == 1:
        return count
    length = file.length(named(ROW_CHECKSUM))
    while count < length and _sound_rows(file, count, count + 1):
        count += 1
    return count


def read_rows(file: CheckedFile, first: int, last: int) -> dict[str, NDArray]:
    """Columns of the series by entry name, for some rows; one that is not in the file is NaN.

    Raises:
        CorruptFile: a row does not match its checksum.
    """
    columns, sound = _rows(file, first, last)
    if not sound.all():
        raise file.corrupt(f"row {first + int(np.argmin(sound))} does not match its checksum")
    for entry in entries("rows"):
        if entry.name != ROW_CHECKSUM and entry.name not in columns:
            columns[entry.name] = np.full(last - first, np.nan)
    return columns


def row_blocks(file: CheckedFile, count: int) -> Iterator[tuple[int, int, dict[str, NDArray]]]:
    """First row, end, and the columns of the sound rows of each block, with ``index``.

    Blocks that cannot be read at all come with no rows.
    """
    for first in range(0, count, ROWS_AT_ONCE):
        last = min(first + ROWS_AT_ONCE, count)
        try:
            columns, sound = _rows(file, first, last)
        except BROKEN:
            columns, sound = {}, np.zeros(last - first, bool)
        kept = {name: column[sound] for name, column in columns.items()}
        yield first, last, {**kept, "index": first + np.flatnonzero(sound)}


def summary_bytes(file: CheckedFile, frames: int, rows: int) -> bytes | None:
    """The summary as JSON; None where the run has not ended.

    Args:
        file: the open run file.
        frames: its complete frames.
        rows: its complete rows.
    Raises:
        CorruptFile: it, or a counter, does not match the checksum.
    """
    finished = file.counter("finished")
    if finished > 1:
        raise file.corrupt(f"finished is {finished}, neither 0 nor 1")
    if file.version == 1:
        text = file.everything(named("summary")).tobytes()
        return text if finished or text else None
    stored = file.counter("summary_checksum")
    if not stored and not finished:
        return None
    text = file.everything(named("summary")).tobytes()
    if stored == text_checksum(frames, rows, text):
        return text
    if not finished:
        return None  # stopped while it was written
    raise file.corrupt("the summary and the counts of frames and rows do not match their checksum")


def _is_sound(file: CheckedFile, index: int) -> bool:
    try:
        check_frame(file, index)
    except BROKEN:
        return False
    return True


def _sound_rows(file: CheckedFile, first: int, last: int) -> int:
    """How many rows from ``first`` on can be read and are right."""
    try:
        _, sound = _rows(file, first, min(first + ROWS_AT_ONCE, last))
    except BROKEN:
        return 0
    return int(np.argmin(sound)) if not sound.all() else len(sound)


def _rows(file: CheckedFile, first: int, last: int) -> tuple[dict[str, NDArray], NDArray[np.bool_]]:
    """Stored columns of some rows, and which rows match their checksum."""
    columns = {
        entry.name: file.rows(entry, first, last)
        for entry in entries("rows")
        if entry.name != ROW_CHECKSUM and file.holds(entry)
    }
    if file.version == 1:
        return columns, np.ones(last - first, bool)
    if "series/path" not in columns:
        raise file.corrupt("series/path is missing")
    stored = file.rows(named(ROW_CHECKSUM), first, last)
    return columns, stored == row_checksums(columns, first)
