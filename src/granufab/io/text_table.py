"""Columns of numbers in text files, with the place of whatever is wrong."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile
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
        CorruptFile: a line has other columns or something that is no number; names the line.
    """
    with path.open(encoding="utf-8", errors="replace") as stream:
        return parse_table(stream.read(), use, columns=columns, comments=comments, place=str(path))


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
        CorruptFile: a line has other columns or something that is no number; names the line.
    """
    if not text.strip():
        return np.zeros((0, len(use)))
    if columns is None or _even(text, columns, comments, delimiter):
        try:
            table = np.loadtxt(
                io.StringIO(text), usecols=tuple(use), comments=comments, delimiter=delimiter,
                ndmin=2,
            )  # fmt: skip
            return table.reshape(-1, len(use))
        except (ValueError, IndexError):
            pass
    raise CorruptFile(_trouble(text, use, columns, comments, delimiter, place, first_line))


def _even(text: str, columns: int, comments: str, delimiter: str | None) -> bool:
    """Whether every line has this many columns."""
    return all(
        len(line.split(delimiter)) == columns
        for line in text.splitlines()
        if line.strip() and not line.startswith(comments)
    )


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
    for number, line in enumerate(text.splitlines(), first_line):
        if not line.strip() or line.startswith(comments):
            continue
        words = line.split(delimiter)
        if columns is not None and len(words) != columns:
            return f"{place}: line {number} has {len(words)} columns, expected {columns}"
        for k in use:
            if k >= len(words):
                return f"{place}: line {number} has {len(words)} columns, needs {max(use) + 1}"
            try:
                float(words[k])
            except ValueError:
                return f"{place}: line {number}: {words[k]!r} is not a number"
    return f"{place}: the table of numbers cannot be read"
