"""The registry of file formats: what a file is, is told from its content.

To read a foreign format, write one module in ``granufab.io.readers`` with a
:class:`~granufab.io.foreign_format.ForeignFormat` and name it there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from granufab.errors import InvalidSettings, MissingData, UnknownFormat
from granufab.history import Run
from granufab.io.checked_hdf5 import HDF5_SIGNATURE, is_run_file
from granufab.io.foreign_format import ForeignFormat
from granufab.io.foreign_run import foreign_run
from granufab.io.given_files import check_given, check_readable, told_by_system
from granufab.io.read_options import ReadOptions
from granufab.io.readers import foreign_formats
from granufab.io.run_reader import read_run

__all__ = ["FORMATS", "Format", "detect", "format_of", "read"]

_HEAD_BYTES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A file format that granufab reads.

    Attributes:
        name: in words, as messages show it.
        matches: whether a file is of this format, from its path and first bytes.
        read: open such a file; a single state gives a run of one frame.
    """

    name: str
    matches: Callable[[Path, bytes], bool]
    read: Callable[[Path], Run]


FORMATS: tuple[Format, ...] = (
    Format(name="granufab run file", matches=is_run_file, read=read_run),
)
"""Formats that are recognised before those of other programs."""


def detect(path: Path | str) -> Format | ForeignFormat:
    """The format of a file or folder, from its content.

    Raises:
        MissingData: there is no such file, or it cannot be opened.
        UnknownFormat: it is of no known format.
    """
    path = Path(path)
    head = b"" if path.is_dir() else _head(path)
    for known in (*FORMATS, *foreign_formats()):
        if known.matches(path, head):
            return known
    check_readable(path, head)
    kind = "is empty" if not head and not path.is_dir() else "is of no known format"
    if head.startswith(HDF5_SIGNATURE):
        kind = "is HDF5 of no known kind"
    names = ", ".join(known.name for known in (*FORMATS, *foreign_formats()))
    raise UnknownFormat(f"{path}: {kind} (known: {names})")


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(_HEAD_BYTES)
    except FileNotFoundError:
        raise MissingData(f"{path}: no such file") from None
    except OSError as error:
        raise MissingData(f"{path}: cannot be opened ({error.strerror})") from None


def read(path: Path | str, *more: Path | str, format: str | None = None, **options: Any) -> Run:
    """Open data of any known format as a run; frames are read when they are asked for.

    Args:
        path: a run file that :class:`granufab.io.RunFileWriter` wrote, finished or not, or a file
            or folder of another program (docs/formats.md).
        more: files that complete it: contacts beside grains, further frames.
        format: key of the format; default detected from the content.
        options: of :class:`granufab.io.ReadOptions`, for what foreign data do not say.
    Raises:
        MissingData: there is no such file, it cannot be opened, or a part of it is missing.
        UnknownFormat: it is of no known format, or of a newer schema than this version reads.
        CorruptFile: it is truncated or contradicts itself.
        InvalidSettings: an option is unknown or does not fit the data.
    """
    paths = [Path(one) for one in (path, *more)]
    given = _options(options)
    known = format_of(paths[0], format, table=bool(given.columns))
    if isinstance(known, Format):
        if len(paths) > 1:
            raise InvalidSettings(f"{paths[1]}: a run file is complete, give one at a time")
        if options:
            raise InvalidSettings(
                f"{next(iter(options))!r} is for other programs' data, {paths[0]} is a run file"
            )
        return known.read(paths[0])
    check_given(known, paths)
    if format is None:
        known = _completed(known, paths[1:])
    with told_by_system(paths[0]):
        return foreign_run(known.name, paths, known.open(paths, given), given)


def _completed(known: ForeignFormat, more: Sequence[Path]) -> ForeignFormat:
    """The format whose data the first file completes, where such a file is given after it."""
    for path in more:
        with suppress(UnknownFormat):
            other = detect(path)
            if isinstance(other, ForeignFormat) and known.key in other.completed_by:
                return other
    return known


def format_of(
    path: Path | str, key: str | None = None, *, table: bool = False
) -> Format | ForeignFormat:
    """The format in which :func:`read` opens a file.

    Args:
        path: a file or folder.
        key: of a foreign format, which is then taken whatever the content.
        table: a text that is of no other format counts as a table, since its columns are known.
    Raises:
        InvalidSettings: there is no format of that key.
        MissingData, UnknownFormat: as for :func:`detect`.
    """
    if key is not None:
        return _named(key)
    try:
        return detect(path)
    except UnknownFormat:
        if not table or Path(path).is_dir():
            raise
        return _named("csv")


def _named(key: str) -> ForeignFormat:
    by_key = {known.key: known for known in foreign_formats()}
    if key not in by_key:
        raise InvalidSettings(f"format is {key!r}, allowed: {', '.join(sorted(by_key))}")
    return by_key[key]


def _options(given: dict[str, Any]) -> ReadOptions:
    allowed = [field.name for field in fields(ReadOptions)]
    for name in given:
        if name not in allowed:
            raise InvalidSettings(f"{name!r} is no option of read, allowed: {', '.join(allowed)}")
    return ReadOptions(**given)
