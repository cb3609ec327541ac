"""How a text table is laid out: its delimiter, its header, where its rows begin."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from granufab.errors import CorruptFile

__all__ = ["TableLayout", "sniff_layout", "table_layout"]

_HEAD_BYTES = 65536


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLayout:
    """Layout of a table in a text file.

    Attributes:
        delimiter: between columns; None for any white space.
        names: of the columns, empty where there is no header.
        width: columns of the header, else of the first row.
        start: byte at which the rows begin.
        line: number of the line at which they begin.
    """

    delimiter: str | None
    names: tuple[str, ...]
    width: int
    start: int
    line: int

    @property
    def decimal_comma(self) -> bool:
        """Whether 1,5 is a number: tables with semicolons may have it."""
        return self.delimiter == ";"


def table_layout(path: Path) -> TableLayout:
    """The layout of a file.

    Raises:
        CorruptFile: it is no table of text.
    """
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
        whole = not stream.read(1)
    layout = sniff_layout(head, whole=whole)
    if layout is None:
        raise CorruptFile(f"{path}: line 1: here begins no table of text with rows of numbers")
    return layout


def sniff_layout(head: bytes, *, whole: bool = False) -> TableLayout | None:
    """The layout from the first bytes of a file, or None where they are no table.

    A header is the first line that holds something else than numbers, or the last line of
    comment before the first row if it has a word for each column.

    Args:
        head: first bytes.
        whole: whether this is all of the file, so that the last line is complete.
    """
    if b"\0" in head:
        return None
    lines = head.decode("utf-8", errors="replace").split("\n")
    complete = lines if whole else lines[:-1]
    place, comment, header = 0, "", None
    for number, line in enumerate(complete, 1):
        size = len(line.encode("utf-8", errors="replace")) + 1
        words = line.strip().lstrip("\ufeff")
        if words.startswith("#"):
            comment = words.lstrip("# \t")
        elif words:
            if _is_row(words, header[0] if header else _delimiter(words)):
                return _found(words, header, comment, place, number)
            if header is not None:
                return None
            header = (_delimiter(words), words)
        place += size
    if header is None or "\ufffd" in header[1]:
        return None
    names = _words(header[1], header[0])
    return TableLayout(
        delimiter=header[0], names=names, width=len(names), start=place, line=len(complete) + 1
    )


def _found(
    row: str, header: tuple[str | None, str] | None, comment: str, start: int, line: int
) -> TableLayout | None:
    delimiter = header[0] if header else _delimiter(row)
    width = len(_words(row, delimiter))
    if header:
        names = _words(header[1], delimiter)
        width = len(names)
    else:
        words = _words(comment, _delimiter(comment))
        names = words if len(words) == width else ()
    return TableLayout(delimiter=delimiter, names=names, width=width, start=start, line=line)


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (";", "\t", ",") if mark in line), None)


def _words(line: str, delimiter: str | None) -> tuple[str, ...]:
    return tuple(word.strip().strip("\"'") for word in line.split(delimiter))


def _is_row(line: str, delimiter: str | None) -> bool:
    try:
        for word in line.split(delimiter):
            float(word.replace(",", ".") if delimiter == ";" else word)
    except ValueError:
        return False
    return True
