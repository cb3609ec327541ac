"""The frames of a text table: rows with the same number in one column, found by their bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile
from granufab.io.table_layout import TableLayout
from granufab.io.text_rows import number_fault, plain_text
from granufab.io.text_table import parse_table
from granufab.packing import Array, IntArray

__all__ = ["FramedTable", "Rows", "Span"]

_LARGEST_WHOLE = 2.0**53


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Bytes of a frame: from ``start`` to before ``end``, beginning at a line."""

    start: int
    end: int
    line: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """The rows of one frame, by what their columns hold.

    Attributes:
        place: file and frame, for messages.
        column: values by role, each of shape (row_count,).
        count: rows.
    """

    place: str
    column: Mapping[str, Array]
    count: int

    def __contains__(self, role: str) -> bool:
        return role in self.column

    def __getitem__(self, role: str) -> Array:
        return self.column[role]

    def get(self, role: str) -> Array | None:
        """A column, or None where there is none."""
        return self.column.get(role)

    def vector(self, pattern: str, dimension: int) -> Array | None:
        """Components ``pattern`` with ? replaced by x, y, z; None where one is missing.

        A missing z component of a 3D vector is zero.
        """
        names = [pattern.replace("?", axis) for axis in "xyz"[:dimension]]
        if any(name not in self.column for name in names[:2]):
            return None
        zero = np.zeros(self.count)
        return np.stack([self.column.get(name, zero) for name in names], axis=1)

    def whole(self, role: str) -> IntArray:
        """A column of whole numbers.

        Raises:
            CorruptFile: it holds others.
        """
        value = self.column[role]
        good = (np.abs(value) < _LARGEST_WHOLE) & (value == np.floor(value))
        if not good.all():
            row = int(np.argmin(good))
            raise CorruptFile(f"{self.place}: {role} of row {row + 1} is {value[row]:g}, not whole")
        return value.astype(np.int64)


class FramedTable:
    """A table whose frames are parsed when asked for.

    Args:
        path: the file.
        layout: its layout.
        roles: 0-based columns by what they hold; ``frame``, or else ``time``, tells frames apart.
    Raises:
        CorruptFile: the frame column holds no number, a frame comes twice, or the last line of
            the only frame has no end.
    """

    def __init__(self, path: Path, layout: TableLayout, roles: Mapping[str, int]) -> None:
        self.path, self.layout, self.roles = path, layout, dict(roles)
        self.key = next((role for role in ("frame", "time") if role in roles), None)
        self.notes: list[str] = []
        size = path.stat().st_size
        if self.key is None:
            self.spans = {0.0: Span(start=layout.start, end=size, line=layout.line)}
        else:
            self.spans = self._indexed(roles[self.key])
        if size and not _ends_with_a_line(path, size):
            self._drop_last()

    def _drop_last(self) -> None:
        """Leave out the frame whose last line was cut off: its last number may be wrong.

        Where that line alone makes the frame, it may have belonged to the one before.
        """
        size = self.path.stat().st_size
        what = f"{self.path}: byte {size}: the last line has no end, as if the file was cut off"
        last = list(self.spans.values())[-1:]
        with self.path.open("rb") as stream:
            stream.seek(last[0].start if last else 0)
            doubtful = 1 if b"\n" in stream.read() else 2
        if len(self.spans) <= doubtful:
            raise CorruptFile(f"{what}; add a line break if it is complete")
        keys = list(self.spans)[-doubtful:]
        for key in keys:
            del self.spans[key]
        self.notes.append(f"{what}: what begins at {self.key} {keys[0]:g} is left out")

    def _indexed(self, column: int) -> dict[float, Span]:
        spans: dict[float, Span] = {}
        mark = None if self.layout.delimiter is None else self.layout.delimiter.encode()
        word, key, start, first = b"", None, self.layout.start, self.layout.line
        with self.path.open("rb") as stream:
            stream.seek(start)
            place, line = start, first
            for text in stream:
                words = text.split(mark)
                if words and words[0].strip() and not words[0].startswith(b"#"):
                    if len(words) <= column:
                        raise CorruptFile(
                            f"{self.path}: line {line} has {len(words)} columns, needs {column + 1}"
                        )
                    if words[column] != word:
                        value = self._number(words[column], line)
                        if key is not None and value != key:
                            spans[key] = Span(start=start, end=place, line=first)
                            start, first = place, line
                        if value != key and value in spans:
                            raise CorruptFile(
                                f"{self.path}: line {line}: {self.key} {value:g} comes a second "
                                f"time; sort the rows by {self.key}"
                            )
                        word, key = words[column], value
                place += len(text)
                line += 1
        if key is not None:
            spans[key] = Span(start=start, end=place, line=first)
        return spans

    def _number(self, word: bytes, line: int) -> float:
        text = self._decimal(word.decode("utf-8", errors="replace"))
        if fault := number_fault(text):
            raise CorruptFile(f"{self.path}: line {line}: {self.key}: {fault}")
        return float(text)

    def _decimal(self, text: str) -> str:
        return text.replace(",", ".") if self.layout.decimal_comma else text

    def rows(self, key: float) -> Rows:
        """The rows of a frame; none where the table does not hold it.

        Raises:
            CorruptFile: a line has other columns or something that is no number.
        """
        span = self.spans.get(key, Span(start=0, end=0, line=0))
        with self.path.open("rb") as stream:
            stream.seek(span.start)
            text = plain_text(stream.read(span.end - span.start), self.path, span.line)
        names, columns = list(self.roles), list(self.roles.values())
        table = parse_table(
            self._decimal(text),
            columns,
            columns=self.layout.width,
            delimiter=self.layout.delimiter,
            place=str(self.path),
            first_line=span.line,
        )
        where = str(self.path) if self.key is None else f"{self.path}: {self.key} {key:g}"
        return Rows(
            place=where,
            column={name: table[:, k] for k, name in enumerate(names)},
            count=len(table),
        )


def _ends_with_a_line(path: Path, size: int) -> bool:
    with path.open("rb") as stream:
        stream.seek(size - 1)
        return stream.read(1) == b"\n"
