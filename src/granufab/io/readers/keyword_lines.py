"""Lines of words and numbers, read one after another, with the place of whatever is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from granufab.errors import CorruptFile
from granufab.io.text_rows import LARGEST, checked_count, number_fault, plain_text

__all__ = ["Lines", "numbers_after"]


class Lines:
    """A text file line by line; every line must end.

    Args:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.at = path, 0
        self._size = path.stat().st_size
        self._raw = self._read()

    def _read(self) -> Iterator[bytes]:
        with self.path.open("rb") as stream:
            yield from stream

    @property
    def place(self) -> str:
        """File and number of the line read last."""
        return f"{self.path}: line {self.at}"

    def next_words(self) -> list[str] | None:
        """Words of the next line, or None at the end.

        Raises:
            CorruptFile: the line does not end: the file was cut off.
        """
        raw = next(self._raw, None)
        if raw is None:
            return None
        self.at += 1
        if not raw.endswith(b"\n"):
            raise CorruptFile(f"{self.place} does not end: the file is cut off")
        return plain_text(raw, self.path, self.at).split()

    def needed(self, what: str) -> list[str]:
        """Words of the next line, which must be there and hold something.

        Args:
            what: the list that it belongs to.
        """
        words = self.next_words()
        if not words:
            raise CorruptFile(f"{self.path}: line {self.at + 1}: the list of {what} ends too early")
        return words

    def count(self, word: str, what: str) -> int:
        """How many lines are announced, believed only where they fit into the file."""
        return checked_count(word, self._size, self.place, what)

    def number(self, word: str) -> float:
        """A finite number."""
        return _number(word, self.place)

    def integer(self, value: float, what: str) -> int:
        """A number that must be an integer."""
        if value != math.floor(value) or abs(value) > LARGEST:
            raise CorruptFile(f"{self.place}: {what} is {value:g}, expected an integer")
        return int(value)


def numbers_after(words: Sequence[str], name: str, count: int, place: str) -> list[float]:
    """The numbers that follow a keyword.

    Raises:
        CorruptFile: there is no such keyword, or other than numbers after it.
    """
    try:
        at = words.index(name) + 1
    except ValueError:
        raise CorruptFile(f"{place}: has no {name!r}") from None
    if at + count > len(words):
        raise CorruptFile(f"{place}: {name} has {len(words) - at} numbers, expected {count}")
    return [_number(word, place) for word in words[at : at + count]]


def _number(word: str, place: str) -> float:
    if fault := number_fault(word):
        raise CorruptFile(f"{place}: {fault}")
    return float(word)
