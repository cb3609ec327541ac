"""Where the frames of MercuryDPM's ``.data`` and ``.fstat`` files begin and end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from granufab.errors import CorruptFile
from granufab.io.text_rows import checked_count, number_fault, plain_text

__all__ = ["Block", "data_blocks", "fstat_blocks"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """The rows of one frame in a file.

    Attributes:
        path: the file.
        header: words of the frame's first line.
        time: of the frame.
        line: number of the line before the first row.
        start, stop: bytes of the rows.
    """

    path: Path
    header: tuple[str, ...]
    time: float
    line: int
    start: int
    stop: int

    def text(self) -> str:
        """The rows."""
        with self.path.open("rb") as stream:
            stream.seek(self.start)
            return plain_text(stream.read(self.stop - self.start), self.path, self.line + 1)


def data_blocks(path: Path) -> tuple[list[Block], bool]:
    """Complete frames of a ``.data`` file, and whether there is nothing after them.

    Raises:
        CorruptFile: a line where a header should be is none.
    """
    size, blocks, line = path.stat().st_size, [], 0
    with path.open("rb") as stream:
        while raw := stream.readline():
            line += 1
            if not raw.strip():
                continue
            if not raw.endswith(b"\n"):
                return blocks, False
            words = plain_text(raw, path, line).split()
            place = f"{path}: line {line}"
            if len(words) not in (6, 8) or (blocks and len(words) != len(blocks[0].header)):
                wanted = len(blocks[0].header) if blocks else "6 (2D) or 8 (3D)"
                raise CorruptFile(f"{place}: has {len(words)} words, a frame starts with {wanted}")
            numbers = [_number(word, place) for word in words[1:]]
            count = _rows(words[0], size, place)
            if count is None:
                return blocks, False
            start, head = stream.tell(), line
            for _ in range(count):
                raw = stream.readline()
                line += 1
                if not raw.endswith(b"\n"):
                    return blocks, False
            blocks.append(
                Block(
                    path=path, header=tuple(words), time=numbers[0], line=head, start=start,
                    stop=stream.tell(),
                )
            )  # fmt: skip
    return blocks, True


def _rows(word: str, size: int, place: str) -> int | None:
    """Rows that a frame announces; None where the file ends long before."""
    if word.isdecimal() and 2 * int(word[:15]) > size:
        return None
    return checked_count(word, size, place, "grains")


def fstat_blocks(path: Path) -> tuple[list[Block], bool]:
    """Complete frames of a ``.fstat`` file, and whether the last one is.

    A frame is complete where its last row is; rows missing at the very end cannot be told.

    Raises:
        CorruptFile: a frame has no time.
    """
    blocks: list[Block] = []
    header: tuple[str, ...] = ()
    line = heads = start = head_line = at = 0
    with path.open("rb") as stream:
        for raw in stream:
            line += 1
            if not raw.endswith(b"\n"):
                return blocks, False
            if raw.lstrip().startswith(b"#"):
                if heads in (0, 3):
                    if header:
                        blocks.append(_fstat_block(path, header, head_line, start, at))
                    header, heads = tuple(plain_text(raw, path, line).split()), 0
                heads += 1
                start, head_line = at + len(raw), line
            elif heads != 3 and raw.strip():
                raise CorruptFile(f"{path}: line {line}: {heads} # lines before it, expected 3")
            at += len(raw)
    if heads == 3:
        blocks.append(_fstat_block(path, header, head_line, start, at))
    return blocks, heads == 3


def _fstat_block(path: Path, header: tuple[str, ...], line: int, start: int, stop: int) -> Block:
    place = f"{path}: line {line - 2}"
    if len(header) < 2:
        raise CorruptFile(f"{place}: has no time, expected '# time …'")
    time = _number(header[1], place)
    return Block(path=path, header=header, time=time, line=line, start=start, stop=stop)


def _number(word: str, place: str) -> float:
    if fault := number_fault(word):
        raise CorruptFile(f"{place}: {fault}")
    return float(word)
