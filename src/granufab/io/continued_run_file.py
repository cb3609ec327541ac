"""Open a run file so that its writer can go on behind a given frame and row."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import h5py

from granufab.errors import InvalidSettings
from granufab.io.checked_hdf5 import CheckedFile, opened
from granufab.io.copied_run_file import copy_frames, copy_rows, sync_file
from granufab.io.frame_reader import read_frame
from granufab.io.run_counts import frame_count, read_rows, row_count
from granufab.io.run_file import RunFileWriter
from granufab.io.run_file_layout import RAGGED, reopen_file
from granufab.io.schema import SCHEMA_VERSION, entries
from granufab.io.summary import replacing
from granufab.packing import Grains

__all__ = ["open_to_continue"]


def open_to_continue(path: Path, frames: int, rows: int) -> tuple[Grains | None, h5py.File]:
    """The grains of the kept frames (None without frames), and the file open for writing.

    Raises:
        CorruptFile: the file holds fewer sound frames or rows than are to be kept.
        InvalidSettings: it cannot be written, nor replaced by a copy.
    """
    with opened(path) as file:
        for what, wanted, held in (
            ("frames", frames, frame_count(file)),
            ("rows", rows, row_count(file)),
        ):
            if not 0 <= wanted <= held:
                raise file.corrupt(f"holds {held} complete {what}, {wanted} are to be kept")
        read_rows(file, 0, rows)
        grains = None
        if frames:
            grains = read_frame(file, frames - 1, str(path)).packing.grains
        in_place = _can_grow(file, frames)
    if in_place:
        with suppress(OSError):
            return grains, reopen_file(path)
    _replace_by_copy(path, frames, rows)
    try:
        return grains, reopen_file(path)
    except OSError as error:
        reason = error.strerror or str(error).splitlines()[0]
        raise InvalidSettings(f"{path}: cannot be written ({reason})") from None


def _can_grow(file: CheckedFile, frames: int) -> bool:
    """Whether the file has all that a writer of today needs."""
    if file.version != SCHEMA_VERSION or file.truncated:
        return False
    if frames == 0:
        return file.grain_count == 0 and file.has(entries("rows"))
    return file.has(entries("frames", "frames + 1", "rows", *RAGGED))


def _replace_by_copy(path: Path, frames: int, rows: int) -> None:
    with opened(path) as file, replacing(path) as temporary:
        with RunFileWriter.of_texts(temporary, file.texts()) as writer:
            copy_frames(file, writer, range(frames))
            copy_rows(file, writer, rows)
        sync_file(temporary)
