"""Servers whose pages are tested, and what Python says about the same frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from looking import looking_at
from sheared_run import sheared_frames, write_run

from granufab import read
from granufab.viewer import ViewedRun, criterion_data, fit_data, interval_data, state_data

__all__ = ["Subject", "disks", "second_file", "two_runs"]


def viewed(path: Path) -> ViewedRun:
    return ViewedRun(str(path), [path], lambda: read(path))


@dataclass(frozen=True)
class Subject:
    """A served run, its address, and its numbers from Python."""

    address: str
    runs: list[ViewedRun]

    def state(
        self, frame: int, criterion: str | None = None, definition: str | None = None, run: int = 0
    ) -> Any:
        """state_data of a frame."""
        one = self.runs[run]
        return state_data(one.run, one.frame(frame), one.choice(criterion, definition))

    def interval(self, frame: int, criterion: str | None = None) -> Any:
        """interval_data of a frame."""
        one = self.runs[0]
        return interval_data(one.frame(frame - 1), one.frame(frame), one.choice(criterion, None))

    def strain(self, frame: int) -> float | None:
        """Where the frame stands in the series."""
        return self.runs[0].frame(frame).eps_q

    def thresholds(self, frame: int, kind: str) -> list[float]:
        """The track of the criterion's slider."""
        one = self.runs[0]
        return criterion_data(one.run, frame, one.choice(None, None))[kind]["threshold"]

    def domain(self) -> Any:
        """The fitted domain of all runs."""
        return fit_data(self.runs)["domain"]


@pytest.fixture(scope="package")
def second_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Other states of disks, with a shorter series."""
    frames = list(sheared_frames(2))[5:]
    return write_run(tmp_path_factory.mktemp("second") / "run.h5", frames, rows=30)


@pytest.fixture(scope="package")
def disks(run_file: Path) -> Iterator[Subject]:
    """Twelve states of disks."""
    runs = [viewed(run_file)]
    with looking_at(*runs) as server:
        yield Subject(server.address, [viewed(run_file)])


@pytest.fixture(scope="package")
def two_runs(run_file: Path, second_file: Path) -> Iterator[Subject]:
    """Two runs of disks."""
    paths = (run_file, second_file)
    with looking_at(*map(viewed, paths)) as server:
        yield Subject(server.address, [viewed(path) for path in paths])
