"""Records of LMGC90's text files: keywords after ``$``, numbers after names, Fortran exponents."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile
from granufab.io.text_rows import plain_text
from granufab.packing import Array, IntArray

__all__ = ["Bodies", "Fields", "Table", "body_starts", "fortran", "read_bodies", "read_text"]

ROUND = ("DISKx", "SPHER")
GRAINS = (*ROUND, "POLYG", "POLYR", "CYLND")
"""Contactors of grains; all others (JONCx, PLANx, xKSID, …) are walls."""

_VALUE = r"[ \t]*(?:=[ \t]*)?([+-]?(?:\d+\.\d*|\.\d+)(?:[DdEe][+-]?\d+|[+-]\d+)?)(?![\w.,*+#-])"
_FIELD = re.compile(r"([A-Za-z]+\d?(?:\(\d\)|/H)?)" + _VALUE)
_BARE_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")
_BODY = re.compile(r"\$bdyty[^\n]*\n[ \t]*RBDY([23])[ \t]+(\d{1,15})(?!\d)")


def fortran(word: str) -> float:
    """A number as Fortran writes it: ``0.1D-02``, and ``0.1-101`` with three digits."""
    plain = word.replace("D", "E").replace("d", "e")
    return float(plain if "E" in plain.upper() else _BARE_EXPONENT.sub(r"E\1", plain))


class Fields:
    """The named numbers of one record.

    Args:
        text: of the record.
        place: file and record, for messages.
    """

    def __init__(self, text: str, place: str) -> None:
        self._values = {name: fortran(word) for name, word in _FIELD.findall(text)}
        self._place = place

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def get(self, *names: str) -> list[float]:
        """Values of these names.

        Raises:
            CorruptFile: one is missing or no finite number.
        """
        values = [self._values.get(name, np.nan) for name in names]
        if not np.isfinite(values).all():
            wrong = names[int(np.argmin(np.isfinite(values)))]
            raise CorruptFile(
                f"{self._place}: {wrong} is missing or no number with a decimal point"
            )
        return values


class Table:
    """Named numbers of many records of one text, each of which holds every name once.

    Args:
        text: of all records.
        starts: where the records begin, ascending.
        place: file and state, for messages.
    """

    def __init__(self, text: str, starts: list[int], place: str) -> None:
        self._text, self._starts, self._place = text, np.array(starts, np.int64), place

    def get(self, *names: str) -> Array:
        """Values of these names, shape (record_count, len(names)).

        Raises:
            CorruptFile: one is missing in a record or no finite number.
        """
        columns = [self._column(name) for name in names]
        return np.array(columns, float).reshape(len(names), -1).T

    def _column(self, name: str) -> Array:
        pattern = re.compile(re.escape(name) + _VALUE)
        found = [(one.start(), one[1]) for one in pattern.finditer(self._text)]
        record = np.searchsorted(self._starts, [place for place, _ in found], side="right") - 1
        wanted = np.arange(len(self._starts))
        values = np.array([fortran(word) for _, word in found], float)
        if np.array_equal(record, wanted) and np.isfinite(values).all():
            return values
        sound = record[np.isfinite(values)]
        often = np.bincount(sound[sound >= 0], minlength=len(wanted))
        wrong = int(np.argmax(often != 1)) if len(wanted) else 0
        where = self._text[self._starts[wrong] :][:60].split(maxsplit=3)[:3] if len(wanted) else []
        raise CorruptFile(
            f"{self._place}, {' '.join(where)}: {name} is missing or no number with a decimal point"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bodies:
    """Rigid bodies of BODIES.DAT.

    Attributes:
        dimension: 2 or 3.
        number: from 1, shape (body_count,).
        position: reference centres, shape (body_count, D).
        radius: byrd of disks and spheres, else avrd of the bulk, shape (body_count,).
        wall: bodies whose contactors are no grains', shape (body_count,).
        round: whether all grains are disks or spheres.
    """

    dimension: int
    number: IntArray
    position: Array
    radius: Array
    wall: NDArray[np.bool_]
    round: bool


def read_text(path: Path, start: int = 0, end: int | None = None) -> str:
    """A piece of a text file that must end in a complete line.

    Raises:
        CorruptFile: its last line is cut.
    """
    with path.open("rb") as stream:
        stream.seek(start)
        data = stream.read(-1 if end is None else end - start)
    if not data.endswith(b"\n"):
        last = start + len(data)
        raise CorruptFile(f"{path}: is truncated at byte {last}, its last line is not complete")
    return plain_text(data, path)


def _bodies_in(text: str, path: Path) -> Iterator[tuple[int, int, str]]:
    """Dimension, number and text of each rigid body's record.

    Raises:
        CorruptFile: a record is not closed by ``$$$$$$``.
    """
    found = list(_BODY.finditer(text))
    ends = [*(one.start() for one in found[1:]), len(text)][: len(found)]
    for one, end in zip(found, ends, strict=True):
        record = text[one.end() : end]
        if "$$$$$$" not in record:
            raise CorruptFile(f"{path}: body {one[2]} has no closing $$$$$$, is the file cut?")
        yield int(one[1]), int(one[2]), record


def body_starts(text: str) -> list[tuple[int, int, int]]:
    """Place, dimension and number of each rigid body's record."""
    return [(one.start(), int(one[1]), int(one[2])) for one in _BODY.finditer(text)]


def read_bodies(path: Path) -> Bodies:
    """BODIES.DAT: reference positions, radii, and which bodies are walls.

    Raises:
        CorruptFile: it holds no rigid bodies, or a number is missing.
    """
    text = read_text(path)
    numbers, positions, radii, walls, shapes = [], [], [], [], set()
    dimensions: set[int] = set()
    for dimension, number, record in _bodies_in(text, path):
        fields = Fields(record, f"{path}: body {number}")
        contactors = re.findall(r"^[ \t]*(\w{5})[ \t]+\d+[ \t]+color", record, re.MULTILINE)
        grain = bool(contactors) and contactors[0] in GRAINS
        radius = "byrd" if grain and contactors[0] in ROUND else "avrd"
        dimensions.add(dimension)
        numbers.append(number)
        positions.append(fields.get(*("coo1", "coo2", "coo3")[:dimension]))
        radii.append(fields.get(radius)[0])
        walls.append(not grain)
        if grain:
            shapes.add(len(contactors) == 1 and contactors[0] in ROUND)
    if len(dimensions) != 1 or not text.rstrip().endswith(("$$$$$$", "--")):
        raise CorruptFile(
            f"{path}: expected complete bodies RBDY2 or RBDY3, got {len(numbers)} in "
            f"{sorted(dimensions)} dimensions up to line {text.count(chr(10))}"
        )
    if len(set(numbers)) != len(numbers):
        raise CorruptFile(f"{path}: a body is described twice")
    return Bodies(
        dimension=dimensions.pop(),
        number=np.array(numbers, np.int64),
        position=np.array(positions, float),
        radius=np.array(radii, float),
        wall=np.array(walls, bool),
        round=shapes == {True},
    )
