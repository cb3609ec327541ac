"""Copy the sound frames and rows of a run file into a new one."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from numpy.typing import NDArray

from granufab.history import SERIES_UNITS
from granufab.io.checked_hdf5 import CheckedFile
from granufab.io.frame_reader import read_frame
from granufab.io.run_counts import row_blocks
from granufab.io.run_file import RunFileWriter

__all__ = ["copy_frames", "copy_rows", "sync_file"]


def copy_frames(file: CheckedFile, writer: RunFileWriter, indices: Iterable[int]) -> None:
    """Append frames of an open run file to another one, one at a time.

    Raises:
        CorruptFile: one of them is damaged.
    """
    for index in indices:
        writer.frame(read_frame(file, index, str(file.path)))


def copy_rows(file: CheckedFile, writer: RunFileWriter, count: int) -> int:
    """Append the sound ones of the first ``count`` rows to another run file.

    Returns:
        How many there were.
    """
    before = writer.row_count
    for _, _, columns in row_blocks(file, count):
        for row in _rows(columns):
            writer.row(row)
    return writer.row_count - before


def sync_file(path: Path) -> None:
    """Bring the content of a closed file to the disk."""
    with path.open("rb") as stream:
        os.fsync(stream.fileno())


def _rows(columns: dict[str, NDArray]) -> Iterator[dict]:
    for k in range(len(columns["index"])):
        row = {name: columns[f"series/{name}"][k] for name in SERIES_UNITS
               if f"series/{name}" in columns}  # fmt: skip
        yield {**row, "path": columns["series/path"][k].decode(errors="replace")}
