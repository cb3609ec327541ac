"""Copy the sound frames and rows of a run file into a new one."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from granufab.io.checked_hdf5 import CheckedFile
from granufab.io.frame_reader import read_frame
from granufab.io.run_counts import row_blocks
from granufab.io.run_file import RunFileWriter
from granufab.io.schema import ROW_CHECKSUM, entries

__all__ = ["copy_frames", "copy_rows", "sync_file"]


def copy_frames(file: CheckedFile, writer: RunFileWriter, indices: Iterable[int]) -> None:
    """Append frames of an open run file to another one, one at a time.

    Raises:
        CorruptFile: one of them is damaged.
    """
    for index in indices:
        writer.frame(read_frame(file, index, str(file.path)))


def copy_rows(file: CheckedFile, writer: RunFileWriter, count: int) -> None:
    """Append the sound ones of the first ``count`` rows to another run file."""
    for _, _, columns in row_blocks(file, count):
        kept = len(columns.pop("index"))
        if kept:
            missing = (entry.name for entry in entries("rows") if entry.name not in columns)
            blank = {name: np.full(kept, np.nan) for name in missing if name != ROW_CHECKSUM}
            writer.stored_rows({**columns, **blank})


def sync_file(path: Path) -> None:
    """Bring the content of a closed file to the disk."""
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
