"""Which failure ends with which code, and what is said about it."""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import pytest

from granufab.errors import (
    CorruptFile,
    GranufabError,
    InvalidPacking,
    InvalidSettings,
    MissingData,
    NotConverged,
    UnknownFormat,
)
from granufab.reproduce import case_folder


@pytest.fixture
def fails_with(granufab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Run a case whose computation raises the given exception."""

    def call(error: BaseException):
        def broken(*arguments: object, **options: object) -> None:
            raise error

        monkeypatch.setattr(case_folder, "run_into_folder", broken)
        case = tmp_path / "case.toml"
        case.write_text("", encoding="utf-8")
        return granufab("run", case, "--out", tmp_path / "out")

    return call


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InvalidSettings("bad"), 2),
        (MissingData("bad"), 2),
        (UnknownFormat("bad"), 2),
        (CorruptFile("bad"), 2),
        (InvalidPacking("bad"), 2),
        (NotConverged("bad"), 1),
        (GranufabError("bad"), 1),
    ],
)
def test_our_errors(fails_with, error: GranufabError, code: int) -> None:
    done = fails_with(error)
    assert (done.code, done.out, done.err) == (code, "", "granufab: bad\n")


def test_a_message_of_several_lines_becomes_one(fails_with) -> None:
    assert fails_with(NotConverged("first\n  second")).err == "granufab: first second\n"


def test_interruption(fails_with) -> None:
    done = fails_with(KeyboardInterrupt())
    assert (done.code, done.err) == (3, "granufab: interrupted\n")


@pytest.mark.parametrize(
    ("number", "code"), [(errno.ENOSPC, 1), (errno.EIO, 1), (errno.EACCES, 2), (errno.EROFS, 2)]
)
def test_the_system_says_no(fails_with, number: int, code: int) -> None:
    done = fails_with(OSError(number, "because", "some/file"))
    assert (done.code, done.err) == (code, "granufab: some/file: because\n")


def test_out_of_memory(fails_with) -> None:
    done = fails_with(MemoryError("for 80 GB"))
    assert (done.code, done.err) == (1, "granufab: not enough memory for 80 GB\n")


def test_a_defect_is_not_hidden(fails_with) -> None:
    with pytest.raises(ZeroDivisionError):
        fails_with(ZeroDivisionError("a defect"))


def test_a_reader_that_stops_early_ends_quietly() -> None:
    program = "from granufab.cli import main; main()"
    done = subprocess.run(
        f'"{sys.executable}" -c "{program}" new shear | true',
        shell=True,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stderr == ""
