"""A known number of rows of a file's text as float64 columns, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile
from granufab.io.text_rows import number_fault
from granufab.kernels.number_text import parse_rows
from granufab.packing import Array

__all__ = ["number_rows"]

BLOCK = 1 << 20
_LATE = 4096


def number_rows(
    path: Path,
    start: int,
    stop: int,
    *,
    rows: int,
    columns: int,
    use: Sequence[int],
    place: str,
    first_line: int = 1,
) -> Array:
    """Columns of the lines between two places of a file; the text is never whole in memory.

    Args:
        path: the file.
        start, stop: bytes, at beginnings of lines.
        rows: lines to read; the bytes must hold as many.
        columns: words that every line must have; those not in use may be anything.
        use: 0-based columns to return.
        place: file and frame, for messages.
        first_line: number of the first line in the file, for messages.
    Returns:
        Shape (rows, len(use)).
    Raises:
        CorruptFile: a line has other columns, something that is no number, or lines are missing.
    """
    if rows * 2 * columns > stop - start + 1:
        raise CorruptFile(
            f"{place}: {rows} rows of {columns} columns do not fit into {stop - start} bytes"
        )
    slot = np.full(columns, -1, np.int64)
    slot[list(use)] = np.arange(len(use))
    table, done = np.empty((rows, len(use))), 0
    late = np.empty((max(_LATE, len(use)), 4), np.int64)
    for text in _blocks(path, start, stop):
        done = _fill(text, slot, table, late, done, f"{place}: line", first_line)
        if done == rows:
            return table
    if done < rows:
        raise CorruptFile(f"{place}: {done} of {rows} rows, the rest is missing")
    return table


def _fill(
    text: bytes, slot: NDArray[np.int64], table: Array, late: NDArray[np.int64],
    done: int, place: str, first_line: int,
) -> int:  # fmt: skip
    """Read one block into the rows from ``done`` on; the number of rows that are done then."""
    numbers, at = np.frombuffer(text, np.uint8), 0
    while at < len(text) and done < len(table):
        count, used, lates, words = parse_rows(numbers[at:], len(slot), slot, table[done:], late)
        for row, column, first, last in late[:lates].tolist():
            word = text[at + first : at + last]
            table[done + row, column] = _slowly(word, f"{place} {first_line + done + row}")
        done, at = done + count, at + used
        if words >= 0:
            raise CorruptFile(
                f"{place} {first_line + done} has {words} columns, expected {len(slot)}"
            )
    return done


def _slowly(word: bytes, place: str) -> float:
    text = word.decode(errors="replace").replace("D", "E").replace("d", "e")
    if number_fault(text):
        raise CorruptFile(f"{place}: {number_fault(word.decode(errors='replace'))}")
    return float(text)


def _blocks(path: Path, start: int, stop: int) -> Iterator[bytes]:
    """Whole lines between two places of a file."""
    with path.open("rb") as stream:
        stream.seek(start)
        rest = b""
        while start < stop:
            block = stream.read(min(BLOCK, stop - start))
            if not block:
                break
            start += len(block)
            cut = block.rfind(b"\n") + 1
            if cut == 0:
                rest += block
                continue
            yield rest + block[:cut]
            rest = block[cut:]
        if rest:
            yield rest
