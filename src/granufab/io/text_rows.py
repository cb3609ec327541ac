"""Text of which every line must be whole: counts that are checked, numbers that are integers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile
from granufab.packing import IntArray

__all__ = [
    "checked_count",
    "first_bytes",
    "first_words",
    "in_order",
    "integers",
    "number_fault",
    "plain_text",
    "whole_text",
]

LARGEST = 2.0**53
"""Integers above this are not exact as floats."""


def whole_text(path: Path) -> str:
    """The text of a file whose last line is complete; its lines end with a line feed alone.

    Raises:
        CorruptFile: the last line does not end: the file was cut off; or it is no text.
    """
    text = plain_text(path.read_bytes(), path)
    if text and not text.endswith("\n"):
        raise CorruptFile(
            f"{path}: line {text.count(chr(10)) + 1} does not end: the file is cut off, or lacks "
            "its last line end"
        )
    return text


def plain_text(data: bytes, path: Path, first_line: int = 1) -> str:
    """Text of bytes: a mark of UTF-8 at its beginning and carriage returns are left out.

    Args:
        data: the bytes.
        path: of the file, for messages.
        first_line: number of the line at which they begin, for messages.
    Raises:
        CorruptFile: it holds zeros, as a lost block of a disk or a binary file does.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise CorruptFile(f"{path}: byte 0: is text in UTF-16; save it as UTF-8")
    zero = data.find(b"\0")
    if zero >= 0:
        line = first_line + data.count(b"\n", 0, zero)
        raise CorruptFile(
            f"{path}: line {line} holds bytes 0, which no text has: a damaged file, or a binary one"
        )
    text = data.decode("utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n") if "\r" in text else text


def number_fault(word: str) -> str:
    """Why a word is no finite number, in words; empty where it is one.

    Args:
        word: as the file gives it.
    """
    shown = word.strip()[:40]
    try:
        if "_" in word or not word.isascii():
            raise ValueError
        value = float(word)
    except ValueError:
        comma = re.fullmatch(r"\s*[-+]?\d*,\d+([eEdD][-+]?\d+)?\s*", word)
        hint = ": it needs a decimal point, not a comma" if comma else ""
        return f"{shown!r} is not a number{hint}"
    return "" if math.isfinite(value) else f"{shown!r} is not a finite number"


def integers(column: NDArray, place: str, what: str) -> IntArray:
    """A column of numbers as integers.

    Args:
        column: shape (n,).
        place: file, for messages.
        what: the column in words.
    Raises:
        CorruptFile: one of them is no integer.
    """
    if column.dtype.kind == "i" and column.dtype.itemsize <= 8:
        return column.astype(np.int64)
    good = np.isfinite(column) & (np.abs(column) < LARGEST)
    good &= np.where(good, column, 0.5) == np.floor(np.where(good, column, 0.0))
    if not good.all():
        row = int(np.flatnonzero(~good)[0])
        raise CorruptFile(f"{place}: {what} of row {row} is {column[row]}, expected an integer")
    return column.astype(np.int64)


def checked_count(word: str, size: int, place: str, what: str) -> int:
    """A count that a file announces, believed only where so many rows fit into the file.

    Args:
        word: as the file gives it.
        size: bytes of the file.
        place: file and line, for messages.
        what: is counted.
    Raises:
        CorruptFile: it is no count, or more than the file can hold.
    """
    if not re.fullmatch(r"\d{1,15}", word):
        raise CorruptFile(f"{place}: the number of {what} is {word!r}, expected an integer ≥ 0")
    if 2 * int(word) > size:
        raise CorruptFile(f"{place}: announces {word} {what}, more than {size} bytes can hold")
    return int(word)


def first_bytes(path: Path) -> bytes:
    """What a file begins with, to tell what it is."""
    with path.open("rb") as stream:
        return stream.read(4096)


def first_words(head: bytes) -> list[list[str]]:
    """The words of the whole lines in a file's first bytes; empty lines are left out."""
    text = head.decode("utf-8", errors="replace")
    lines = text.splitlines() if text.endswith("\n") else text.splitlines()[:-1]
    return [line.split() for line in lines if line.strip()]


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Paths by the numbers in their names: conf2 before conf10."""
    return sorted(
        paths,
        key=lambda path: [
            (int(part), "") if part.isdecimal() else (-1, part)
            for part in re.split(r"(\d+)", path.name)
        ],
    )
