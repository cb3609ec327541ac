"""Where the frames of a dump lie: a text in sections that begin with ``ITEM:``.

A frame is complete when its last section has as many whole lines as its header says; what is
after the last complete frame is a dump that was cut off, or one that is being written.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from granufab.errors import CorruptFile

__all__ = ["DumpFrame", "DumpIndex", "index_dump"]

_BLOCK = 1 << 20
_LONGEST_LINE = 1 << 20
_LONGEST_HEADER = 4096
_MARK = b"ITEM: "
_COUNT = "NUMBER OF "
_HEADERS = ("TIMESTEP", "TIME", "UNITS", "BOX BOUNDS")


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """A section: its label, where its lines begin and end, and how many there are."""

    label: str
    start: int
    stop: int
    line: int
    lines: int


@dataclass(frozen=True, slots=True, kw_only=True)
class DumpFrame:
    """Where a frame lies, and what its short sections say.

    Attributes:
        path: the file.
        step: number of the time step.
        time: or None.
        label: what the rows are: ``ATOMS``, ``ENTRIES`` or a user's word.
        columns: names of the columns.
        count: rows, as the header says; rows_found: lines that are there.
        bounds: words after ``BOX BOUNDS``; box: the lines below, as words.
        start, stop: bytes of the rows; line: number of their first line.
    """

    path: Path
    step: int
    time: float | None
    label: str
    columns: tuple[str, ...]
    count: int
    rows_found: int
    bounds: tuple[str, ...]
    box: tuple[tuple[str, ...], ...]
    start: int
    stop: int
    line: int

    @property
    def place(self) -> str:
        """File and frame, for messages."""
        return f"{self.path}: step {self.step}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DumpIndex:
    """The complete frames of a file, in its order.

    Attributes:
        frames: at least one.
        cut: what was left out after the last complete frame, in words; empty: nothing.
    """

    frames: tuple[DumpFrame, ...]
    cut: str = ""


def index_dump(path: Path) -> DumpIndex:
    """Find the frames of a dump, reading it once, block by block.

    Raises:
        CorruptFile: sections are missing, unknown or in no sensible order, or no frame is
            complete; names the line.
    """
    frames: list[DumpFrame] = []
    parts: dict[str, Item] = {}
    with path.open("rb") as stream:
        for item in _items(path, stream):
            name = _named(path, item, parts)
            if name in parts:
                raise CorruptFile(f"{path}: line {item.line - 1}: a second ITEM: {name} in a frame")
            parts[name] = item
            if name == "rows":
                frames.append(_frame(path, parts))
                parts = {}
    cut = f"a frame without rows after step {frames[-1].step}" if frames and parts else ""
    if frames and not cut and frames[-1].rows_found < frames[-1].count:
        last = frames.pop()
        cut = f"step {last.step} with {last.rows_found} of {last.count} rows"
    if not frames:
        end = f"no complete frame up to the end at byte {path.stat().st_size}"
        raise CorruptFile(f"{path}: {end}{f', only {cut}' if cut else ''}")
    return DumpIndex(frames=tuple(frames), cut=cut)


def _named(path: Path, item: Item, parts: dict[str, Item]) -> str:
    """What a section is: a header's name, ``count`` or ``rows``."""
    if item.label.startswith(_COUNT):
        return "count"
    if "count" in parts and (item.label + " ").startswith(_what(parts["count"]) + " "):
        return "rows"
    for name in _HEADERS:
        if (item.label + " ").startswith(name + " "):
            return name
    raise CorruptFile(
        f"{path}: line {item.line - 1}: unknown 'ITEM: {item.label[:40]}', expected one of "
        f"{', '.join(_HEADERS)}, NUMBER OF …, ATOMS … or ENTRIES …"
    )


def _what(count: Item) -> str:
    return count.label[len(_COUNT) :].strip()


def _frame(path: Path, parts: dict[str, Item]) -> DumpFrame:
    rows = parts["rows"]
    for name in ("TIMESTEP", "BOX BOUNDS"):
        if name not in parts:
            raise CorruptFile(f"{path}: line {rows.line - 1}: this frame has no ITEM: {name}")
    label = _what(parts["count"])
    time = _float(path, parts["TIME"]) if "TIME" in parts else None
    return DumpFrame(
        path=path,
        step=_whole(path, parts["TIMESTEP"]),
        time=time,
        label=label,
        columns=tuple(rows.label[len(label) :].split()),
        count=_whole(path, parts["count"]),
        rows_found=rows.lines,
        bounds=tuple(parts["BOX BOUNDS"].label.split()[2:]),
        box=tuple(tuple(line.split()) for line in _text(path, parts["BOX BOUNDS"]).splitlines()),
        start=rows.start,
        stop=rows.stop,
        line=rows.line,
    )


def _text(path: Path, item: Item) -> str:
    if item.stop - item.start > _LONGEST_HEADER:
        raise CorruptFile(f"{path}: line {item.line}: too long for ITEM: {item.label[:40]}")
    with path.open("rb") as stream:
        stream.seek(item.start)
        return stream.read(item.stop - item.start).decode(errors="replace")


def _whole(path: Path, item: Item) -> int:
    text = _text(path, item).strip()
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise CorruptFile(
            f"{path}: line {item.line}: ITEM: {item.label[:40]} is {text[:40]!r}, expected a "
            "whole number"
        )
    return int(text)


def _float(path: Path, item: Item) -> float:
    text = _text(path, item).strip()
    try:
        return float(text)
    except ValueError:
        raise CorruptFile(
            f"{path}: line {item.line}: ITEM: TIME is {text[:40]!r}, expected a number"
        ) from None


@dataclass(slots=True)
class _Open:
    """A section whose end is not known yet."""

    label: str
    start: int
    line: int


def _items(path: Path, stream: BinaryIO) -> Iterator[Item]:
    """The sections of a file; a label that is cut off ends it."""
    begun: _Open | None = None
    line = 1
    for offset, text in _whole_lines(path, stream):
        at = 0
        while (mark := _next_mark(text, at)) >= 0:
            line += text.count(b"\n", at, mark)
            if begun is not None:
                yield _closed(begun, offset + mark, line)
            end = text.find(b"\n", mark)
            if end < 0:
                return
            label = text[mark + len(_MARK) : end].decode(errors="replace").strip()
            line, at = line + 1, end + 1
            begun = _Open(label, offset + at, line)
        line += text.count(b"\n", at)
        end_of_file = offset + len(text)
        if not text.endswith(b"\n"):
            end_of_file = offset + text.rfind(b"\n") + 1
            break
    else:
        end_of_file = stream.tell()
    if begun is not None:
        yield _closed(begun, max(end_of_file, begun.start), line)


def _closed(begun: _Open, stop: int, line: int) -> Item:
    return Item(
        label=begun.label, start=begun.start, stop=stop, line=begun.line, lines=line - begun.line
    )


def _next_mark(text: bytes, at: int) -> int:
    """The next place where a line begins with ``ITEM:``, −1 where there is none."""
    while True:
        mark = text.find(_MARK, at)
        if mark <= 0 or text[mark - 1] == 10:
            return mark
        at = mark + 1


def _whole_lines(path: Path, stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Blocks of whole lines with their offsets; the last one may end within a line."""
    offset, rest = 0, b""
    while block := stream.read(_BLOCK):
        text = rest + block
        cut = text.rfind(b"\n") + 1
        if cut == 0 and len(text) > _LONGEST_LINE:
            raise CorruptFile(f"{path}: byte {offset}: a line longer than {len(text)} bytes")
        if cut:
            yield offset, text[:cut]
        offset, rest = offset + cut, text[cut:]
    if rest:
        yield offset, rest
