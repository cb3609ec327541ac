"""Packings and runs in other programs' formats, one module a format."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from granufab.errors import InvalidSettings
from granufab.history import Frame, Run, packing_of
from granufab.io.foreign_writer import ForeignWriter
from granufab.io.writers.csv_tables import CSV, write_csv
from granufab.io.writers.extxyz import EXTXYZ, write_extxyz
from granufab.io.writers.lammps_data import LAMMPS_DATA, write_lammps_data
from granufab.io.writers.ondem_vtkhdf import VTKHDF, write_vtkhdf
from granufab.io.writers.vtp import VTP, write_vtp
from granufab.io.writers.yade_text import YADE, write_yade_text
from granufab.packing import Packing

__all__ = [
    "WRITERS",
    "write",
    "write_csv",
    "write_extxyz",
    "write_lammps_data",
    "write_vtkhdf",
    "write_vtp",
    "write_yade_text",
]

WRITERS: dict[str, ForeignWriter] = {
    writer.key: writer for writer in (VTKHDF, VTP, EXTXYZ, LAMMPS_DATA, CSV, YADE)
}
"""Formats by key."""


def write(
    data: Packing | Frame | Run, path: Path | str, format: str | None = None, force: bool = False
) -> tuple[Path, ...]:
    """Write a state or a run for another program.

    A run of several frames becomes one file where the format holds a series, else one file (or
    pair of files) a frame, numbered ``name_0000``, ``name_0001``, …; frames are read one by one.

    Args:
        data: a packing, a frame, or a run.
        path: of the file; a format of two files puts ``_grains`` and ``_contacts`` before the
            suffix.
        format: key of :data:`WRITERS`; default by the suffix.
        force: replace existing files.
    Returns:
        The files written.
    Raises:
        InvalidSettings: no format has this key or suffix, a file exists, or cannot be written.
        MissingData: a state lacks what the format needs.
    """
    path = Path(path)
    writer = _chosen(path, format)
    if not isinstance(data, Run):
        return writer.save([packing_of(data)], path, force=force)
    if writer.series or len(data.frames) == 1:
        return writer.save(data.packings(), path, force=force)
    return _numbered(writer, data.packings(), path, force)


def _numbered(
    writer: ForeignWriter, states: Iterator[Packing], path: Path, force: bool
) -> tuple[Path, ...]:
    files: list[Path] = []
    for number, state in enumerate(states):
        name = path.with_name(f"{path.stem}_{number:04d}{path.suffix}")
        files += writer.save([state], name, force=force)
    return tuple(files)


def _chosen(path: Path, key: str | None) -> ForeignWriter:
    if key is not None:
        if key not in WRITERS:
            raise InvalidSettings(f"format is {key!r}, allowed: {', '.join(WRITERS)}")
        return WRITERS[key]
    for writer in WRITERS.values():
        if path.suffix.lower() in writer.suffixes:
            return writer
    known = ", ".join(suffix for writer in WRITERS.values() for suffix in writer.suffixes)
    raise InvalidSettings(
        f"{path}: no format has the suffix {path.suffix!r} (known: {known}); name the format"
    )
