"""What can be wrong with a given file before anybody looks at its format."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from granufab.errors import CorruptFile, GranufabError, MissingData, UnknownFormat
from granufab.io.foreign_format import ForeignFormat

__all__ = ["check_given", "check_readable", "told_by_system"]

_PACKED = {
    b"\x1f\x8b": ("gzip", "gunzip"),
    b"BZh": ("bzip2", "bunzip2"),
    b"\xfd7zXZ\0": ("xz", "unxz"),
    b"\x28\xb5\x2f\xfd": ("zstd", "unzstd"),
}
"""First bytes of compressed files: by what, and what undoes it."""
_WIDE = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of text in UTF-16."""


def check_given(known: ForeignFormat, paths: Sequence[Path]) -> None:
    """Refuse what no reader has to deal with: nothing there, folders, packed files, UTF-16.

    Args:
        known: the format in which they are read.
        paths: as the user gave them.
    Raises:
        MissingData: there is no such file, or a folder where files are read.
        UnknownFormat: a file is packed, or text in another encoding; says what to do.
    """
    for path in paths:
        if not path.exists():
            raise MissingData(f"{path}: no such file")
        if not path.is_dir():
            with told_by_system(path), path.open("rb") as stream:
                check_readable(path, stream.read(8), byte_order_mark=known.byte_order_mark)
        elif not known.matches(path, b""):
            raise MissingData(f"{path}: is no folder of {known.name}; give the files in it")


def check_readable(path: Path, head: bytes, *, byte_order_mark: bool = False) -> None:
    """Refuse a file that must be unpacked, or saved in another encoding, before it is read.

    Args:
        path: the file.
        head: its first bytes.
        byte_order_mark: whether it may begin with one.
    Raises:
        UnknownFormat: says what to do.
    """
    for mark, (name, tool) in _PACKED.items():
        if head.startswith(mark):
            raise UnknownFormat(
                f"{path}: is packed by {name}; unpack it first, for example by {tool}"
            )
    if head.startswith(_WIDE):
        raise UnknownFormat(f"{path}: is text in UTF-16; save it as UTF-8")
    if head.startswith(BOM_UTF8) and not byte_order_mark:
        raise UnknownFormat(
            f"{path}: begins with a byte order mark; save it as plain text or UTF-8 without one"
        )


@contextmanager
def told_by_system(path: Path) -> Iterator[None]:
    """Turn what the system says of a file (no permission, a folder, a bad disk) into one line.

    Args:
        path: to name where the system names none.
    """
    try:
        yield
    except GranufabError:
        raise
    except OSError as error:
        kind = MissingData if error.errno is not None else CorruptFile
        reason = error.strerror or type(error).__name__
        raise kind(
            f"{error.filename or path}: cannot be read ({reason}); give a file that can"
        ) from None
