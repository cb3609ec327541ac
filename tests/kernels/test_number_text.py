"""Numbers read from bytes are those that Python reads, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granufab.errors import CorruptFile
from granufab.io.number_rows import number_rows
from granufab.kernels.number_text import parse_rows

WORDS = [
    *("0", "-0.0", "1", "+1", "-17", "3.", ".5", "-.25", "1e5", "1E-5", "1.5d3", "2e+22", "7e-22"),
    *("9007199254740992", "9007199254740993", "123456789012345678901234567890", "1e300", "1e-310"),
    *("4.6799999999999997e+00", "0.1000000000000000055511151231257827", "1e0000001"),
    *(
        "0.000000000000000000000000001",
        "5e-324",
        "1.7976931348623157e308",
        "2.2250738585072014e-308",
    ),
]


def _file(folder: Path, text: str) -> Path:
    path = folder / "numbers"
    path.write_bytes(text.encode())
    return path


def _read(path: Path, rows: int, columns: int, use: list[int]) -> np.ndarray:
    return number_rows(
        path, 0, path.stat().st_size, rows=rows, columns=columns, use=use, place="numbers"
    )


def test_every_word_is_what_python_reads(tmp_path: Path) -> None:
    text = "".join(f"x {word}\t7 \r\n" for word in WORDS)
    table = _read(_file(tmp_path, text), len(WORDS), 3, [2, 1])
    wanted = np.array([float(word.replace("d", "e")) for word in WORDS])
    assert table[:, 1].tobytes() == wanted.tobytes()
    assert (table[:, 0] == 7).all()


@pytest.mark.parametrize("word", ["nan", "-inf", "Infinity", "1e999", "0,5", "1.#IND", "x"])
def test_what_is_no_finite_number_is_refused_with_its_place(tmp_path: Path, word: str) -> None:
    with pytest.raises(CorruptFile, match="line 2"):
        _read(_file(tmp_path, f"1 2\n3 {word}\n"), 2, 2, [0, 1])


@pytest.mark.parametrize("style", ["%.6g", "%.10g", "%.17g", "%.17e", "%f"])
def test_random_numbers_to_the_last_bit(tmp_path: Path, style: str) -> None:
    generator = np.random.default_rng(7)
    numbers = generator.normal(size=(3000, 3)) * 10.0 ** generator.integers(-30, 30, (3000, 3))
    lines = [" ".join(style % x for x in row) for row in numbers]
    table = _read(_file(tmp_path, "\n".join(lines) + "\n"), 3000, 3, [0, 1, 2])
    wanted = np.array([[float(word) for word in line.split()] for line in lines])
    assert table.tobytes() == wanted.tobytes()


def test_most_words_need_no_second_reading() -> None:
    text = np.frombuffer(b"1.234567891e-05 -3 12.5\n" * 4, np.uint8)
    out, late = np.empty((4, 3)), np.empty((8, 4), np.int64)
    found = parse_rows(text, 3, np.arange(3), out, late)
    assert found == (4, len(text), 0, -1)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("1 2\n3    \n", "line 2 has 1 columns, expected 2"),
        ("1 2\n3 4 5\n", "line 2 has 3 columns"),
        ("1 2\n3 4_0\n", "line 2: '4_0' is not a number"),
        ("1 2\n3 --4\n", "'--4' is not a number"),
        ("1 2\n3 1.2.3\n", "'1.2.3' is not a number"),
        ("1 2\n3 1e\n", "'1e' is not a number"),
        ("1 2\n3 .\n", "'.' is not a number"),
        ("1 222222\n", "1 of 2 rows"),
        ("1", "2 rows of 2 columns do not fit into 1 bytes"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, match: str) -> None:
    with pytest.raises(CorruptFile, match=match):
        _read(_file(tmp_path, text), 2, 2, [0, 1])
