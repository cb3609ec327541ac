"""Made-up runs in a sheared periodic cell, and a server that looks at them."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from granufab.cli import main
from granufab.viewer import ViewedRun

sys.path.insert(0, str(Path(__file__).parent))

from browser import chromium, look_at  # noqa: F401  fixtures
from looking import Viewer, looking_at
from page_data import disks, second_file, two_runs  # noqa: F401  fixtures
from sheared_run import sheared_frames, write_run


@pytest.fixture(scope="session")
def run_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve states of disks, remapped half way, and a series that reaches a critical state."""
    return write_run(tmp_path_factory.mktemp("disks") / "run.h5", sheared_frames(2))


@pytest.fixture(scope="session")
def sphere_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four states of spheres."""
    return write_run(tmp_path_factory.mktemp("spheres") / "run.h5", sheared_frames(3, count=4))


@pytest.fixture
def view_of() -> Callable[[Path], ViewedRun]:
    from granufab import read

    return lambda path: ViewedRun(str(path), [path], lambda: read(path))


@pytest.fixture
def output_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """What a verb prints as JSON."""

    def call(*arguments: object) -> Any:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert ended.value.code == 0, err
        return json.loads(out)

    return call


@pytest.fixture(scope="session")
def viewer(run_file: Path, sphere_file: Path) -> Iterator[Viewer]:
    from granufab import read

    runs = [
        ViewedRun(str(path), [path], lambda path=path: read(path))
        for path in (run_file, sphere_file)
    ]
    with looking_at(*runs) as found:
        yield found
