"""What happens to files: lost and doubled blocks, other line ends, encodings, packing, nonsense."""

from __future__ import annotations

import codecs
import gzip
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mangling import Attempts, State, check_error, same_states
from one_of_each import Example, Part
from one_of_each_binary import EXAMPLES

import granufab
from granufab.errors import GranufabError

TEXT = [name for name in EXAMPLES if not name.startswith(("labels", "gsd", "vtkhdf"))]
NONSENSE = random.Random(7).randbytes(2**20)


def each_text(tmp_path: Path, name: str) -> list[tuple[Attempts, Part, Path, bytes]]:
    """The files of text of an example, with what they hold."""
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    files = [(part, tmp_path / part.name) for part in example.parts if part.text]
    return [(attempts, part, path, path.read_bytes()) for part, path in files]


def tried(attempts: Attempts, path: Path, data: bytes, what: str) -> list[State]:
    """The frames of a file with other content, which is then put back."""
    whole = path.read_bytes()
    path.write_bytes(data)
    try:
        return attempts.attempt(f"{path.name}: {what}", traced=True)
    finally:
        path.write_bytes(whole)


def reason(attempts: Attempts) -> str:
    """Why nothing was read in the attempt before."""
    assert attempts.error is not None
    return str(attempts.error)


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_lost_block_is_seen(tmp_path: Path, name: str) -> None:
    """Blocks of zeros: what is still read of a text is right, of binary data is finite."""
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    for part in example.parts:
        path = tmp_path / part.name
        whole = path.read_bytes()
        for start in np.linspace(0, len(whole), 12, dtype=int):
            for size in (64, len(whole)):
                lost = whole[:start] + bytes(len(whole[start : start + size]))
                lost += whole[start + size :]
                seen = tried(attempts, path, lost, f"zeros at {start}, {size}")
                if part.text:
                    assert same_states(seen, attempts.wanted[: len(seen)]), (part.name, start)
                if lost == bytes(len(whole)):
                    assert len(seen) < len(attempts.wanted)


@pytest.mark.parametrize("name", TEXT)
def test_doubled_lines_are_seen(tmp_path: Path, name: str) -> None:
    """Some lines twice: refused, or pairs that are listed twice are read once."""
    for attempts, part, path, whole in each_text(tmp_path, name):
        lines = whole.splitlines(keepends=True)
        for start in np.linspace(0, len(lines) - 1, 10, dtype=int):
            again = lines[: start + 2] + lines[start:]
            seen = tried(attempts, path, b"".join(again), f"lines from {start} twice")
            assert same_states(seen, attempts.wanted[: len(seen)]), (part.name, start)


@pytest.mark.parametrize("name", TEXT)
def test_line_ends_of_other_systems_change_nothing(tmp_path: Path, name: str) -> None:
    for attempts, part, path, whole in each_text(tmp_path, name):
        seen = tried(attempts, path, whole.replace(b"\n", b"\r\n"), "other line ends")
        assert len(seen) == len(attempts.wanted), (part.name, attempts.error)
        assert same_states(seen, attempts.wanted)


@pytest.mark.parametrize("name", TEXT)
def test_a_byte_order_mark_is_passed_over_or_named(tmp_path: Path, name: str) -> None:
    for attempts, part, path, whole in each_text(tmp_path, name):
        seen = tried(attempts, path, codecs.BOM_UTF8 + whole, "byte order mark")
        named = attempts.error is not None and "byte order mark" in str(attempts.error)
        assert named or same_states(seen, attempts.wanted), part.name


@pytest.mark.parametrize("name", TEXT)
def test_decimal_commas_are_named(tmp_path: Path, name: str) -> None:
    for attempts, part, path, whole in each_text(tmp_path, name):
        if part.number:
            start = whole.find(b"<Piece") if whole.startswith(b"<?xml") else 0
            data = whole[:start] + re.sub(rb"(\d)\.(\d)", rb"\1,\2", whole[start:])
            assert data != whole
            assert len(tried(attempts, path, data, "decimal commas")) < len(attempts.wanted)
            assert "decimal point" in reason(attempts)


@pytest.mark.parametrize("name", TEXT)
@pytest.mark.parametrize("word", ["nan", "inf", "-Infinity", "1.#IND", "-nan(ind)", "1e999", "NaN"])
def test_what_is_no_finite_number_is_refused(tmp_path: Path, name: str, word: str) -> None:
    for attempts, part, path, whole in each_text(tmp_path, name):
        if part.number:
            assert part.number.encode() in whole, part.name
            data = whole.replace(part.number.encode(), word.encode(), 1)
            assert len(tried(attempts, path, data, word)) < len(attempts.wanted), part.name
            assert part.name in reason(attempts)


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("data", [b"", NONSENSE, b"\n" * 1000, b"0 " * 500000])
def test_nothing_and_nonsense(tmp_path: Path, name: str, data: bytes) -> None:
    """An empty list of pairs may be one: whoever has no contacts writes no rows."""
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    for part in example.parts:
        seen = tried(attempts, tmp_path / part.name, data, f"only {data[:3]!r}")
        if len(seen) == len(attempts.wanted):
            assert not part.counted
            assert not data.strip()
            for got, right in zip(seen, attempts.wanted, strict=False):
                assert np.array_equal(got[0], right[0])
                assert len(got) < 3 or len(got[2]) == 0


@pytest.mark.parametrize("name", EXAMPLES)
def test_nonsense_under_any_name_is_no_format(tmp_path: Path, name: str) -> None:
    example = EXAMPLES[name](tmp_path)
    for part in example.parts:
        path = tmp_path / part.name
        path.write_bytes(NONSENSE)
        with pytest.raises(GranufabError) as told:
            _ = granufab.read(path, **example.options).frames[0]
        check_error(told.value, [path.name, tmp_path.name], "nonsense")


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_folder_instead_of_a_file(tmp_path: Path, name: str) -> None:
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(example.folder, example.read)
    for part in example.parts:
        path = example.folder / part.name
        kept = path.read_bytes()
        path.unlink()
        path.mkdir()
        assert not attempts.attempt(f"{part.name} is a folder") or example.whole
        path.rmdir()
        path.write_bytes(kept)


def _packed(data: bytes) -> bytes:
    return gzip.compress(data)


def _wide(data: bytes) -> bytes:
    return data.decode("latin-1").encode("utf-16")


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize(("change", "words"), [(_packed, "unpack it first"), (_wide, "UTF-16")])
def test_packed_and_wide_files_say_what_to_do(
    tmp_path: Path, name: str, change: Callable[[bytes], bytes], words: str
) -> None:
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    for part in example.parts:
        path = tmp_path / part.name
        data = change(path.read_bytes())
        seen = tried(attempts, path, data, words)
        if not example.whole:
            assert not seen
            assert words in reason(attempts)
            path.write_bytes(data)
            named = path.with_name(f"{path.name}.gz")
            shutil.copy(path, named)
            with pytest.raises(GranufabError, match=words):
                granufab.read(named, **example.options)


def _counts(example: Example) -> list[tuple[Part, str]]:
    return [(part, pattern) for part in example.parts for pattern in part.counts]


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in ("spam", "yade")])
@pytest.mark.parametrize("digits", [10, 13, 19, 31, 5000])
def test_counts_that_no_file_can_hold(tmp_path: Path, name: str, digits: int) -> None:
    """They are refused at once, and nothing is allocated for them."""
    example = EXAMPLES[name](tmp_path)
    attempts = Attempts(tmp_path, example.read)
    for part, pattern in _counts(example):
        path = tmp_path / part.name
        whole = path.read_bytes()
        found = re.search(pattern.encode(), whole, re.MULTILINE)
        assert found, pattern
        data = whole[: found.start(1)] + b"1".ljust(digits, b"0") + whole[found.end(1) :]
        seen = tried(attempts, path, data, f"{pattern} of {digits} digits")
        assert not seen or pattern.startswith(("nv", "TIME")), pattern
