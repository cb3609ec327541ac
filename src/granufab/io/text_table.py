"""Columns of numbers in text files, with the place of whatever is wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.text_rows import number_fault, whole_text
from granufab.packing import Array

__all__ = ["number_table", "parse_table"]


def number_table(
    path: Path, use: Sequence[int], *, columns: int | None = None, comments: str = "#"
) -> Array:
    """Columns of a text file in which every line has the same columns.

    Args:
        path: the file.
        use: 0-based columns to return.
        columns: how many a line must have; default: at least those in use.
        comments: lines beginning with this are skipped.
    Returns:
        Shape (line_count, len(use)).
    Raises:
        CorruptFile: a line has other columns or something that is no finite number, or the last
            one is cut off; names the line.
    """
    text = whole_text(path)
    return parse_table(text, use, columns=columns, comments=comments, place=str(path))


def parse_table(
    text: str,
    use: Sequence[int],
    *,
    place: str,
    columns: int | None = None,
    comments: str = "#",
    delimiter: str | None = None,
    first_line: int = 1,
) -> Array:
    """Columns of a text, as :func:`number_table`.

    Args:
        text: whole lines.
        use: 0-based columns to return.
        place: file, for messages.
        columns: how many a line must have; default: at least those in use.
        comments: lines beginning with this are skipped.
        delimiter: between columns; default any white space.
        first_line: number of the text's first line, for messages.
    Raises:
        CorruptFile: a line has other columns or something that is no finite number; names the line.
    """
    rows = _rows(text, columns, comments, delimiter)
    try:  # comments have no mark within a line: 1.#IND is no 1
        first = next(rows, None)
        if first is None:
            return np.zeros((0, len(use)))
        table = np.loadtxt(
            chain([first], rows), usecols=tuple(use), comments=None, delimiter=delimiter, ndmin=2
        ).reshape(-1, len(use))
        if np.isfinite(table).all():
            return table
    except (ValueError, IndexError):
        pass
    raise CorruptFile(_trouble(text, use, columns, comments, delimiter, place, first_line))


def _lines(text: str) -> Iterator[str]:
    """Lines one by one: a list of them takes twice the memory of the text."""
    start = 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        yield text[start:end]
        start = end + 1


def _rows(text: str, columns: int | None, comments: str, delimiter: str | None) -> Iterator[str]:
    """Lines that hold numbers, each with as many columns as it must have.

    Raises:
        ValueError: one has others.
    """
    for line in _lines(text):
        if line.startswith(comments) or not line.strip():
            continue
        if columns is not None and len(line.split(delimiter)) != columns:
            raise ValueError
        yield line


def _trouble(
    text: str,
    use: Sequence[int],
    columns: int | None,
    comments: str,
    delimiter: str | None,
    place: str,
    first_line: int,
) -> str:
    """The first line that cannot be read, in words."""
    for number, line in enumerate(_lines(text), first_line):
        if not line.strip() or line.startswith(comments):
            continue
        words = line.split(delimiter)
        if columns is not None and len(words) != columns:
            many = delimiter == "," and len(words) > columns
            hint = "; numbers need a decimal point, not a comma" if many else ""
            return f"{place}: line {number} has {len(words)} columns, expected {columns}{hint}"
        for k in use:
            if k >= len(words):
                return f"{place}: line {number} has {len(words)} columns, needs {max(use) + 1}"
            if fault := number_fault(words[k]):
                return f"{place}: line {number}: {fault}"
    last = first_line + text.count("\n")
    return f"{place}: line {first_line} to {last}: the table of numbers cannot be read"
