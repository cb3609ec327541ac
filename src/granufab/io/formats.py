"""The registry of file formats: what a file is, is told from its content.

To read a foreign format, write one module with a function ``path -> Run`` and a test on the
file's first bytes, and add its :class:`Format` to :data:`FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from granufab.errors import MissingData, UnknownFormat
from granufab.history import Run
from granufab.io.checked_hdf5 import HDF5_SIGNATURE, is_run_file
from granufab.io.run_reader import read_run

__all__ = ["FORMATS", "Format", "detect", "read"]

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


def detect(path: Path | str) -> Format:
    """The format of a file, from its content.

    Raises:
        MissingData: there is no such file, or it cannot be opened.
        UnknownFormat: it is of no known format.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
    except FileNotFoundError:
        raise MissingData(f"{path}: no such file") from None
    except OSError as error:
        raise MissingData(f"{path}: cannot be opened ({error.strerror})") from None
    for known in FORMATS:
        if known.matches(path, head):
            return known
    kind = "is empty" if not head else "is of no known format"
    if head.startswith(HDF5_SIGNATURE):
        kind = "is HDF5, but not a granufab run file"
    raise UnknownFormat(f"{path}: {kind} (known: {', '.join(f.name for f in FORMATS)})")


def read(path: Path | str) -> Run:
    """Open a file of any known format as a run; frames are read when they are asked for.

    Args:
        path: a run file that :class:`granufab.io.RunFileWriter` wrote, finished or not.
    Raises:
        MissingData: there is no such file, or it cannot be opened.
        UnknownFormat: it is of no known format, or of a newer schema than this version reads.
        CorruptFile: it is truncated or contradicts itself.
    """
    return detect(path).read(Path(path))
