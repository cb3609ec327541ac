"""Running the command line in this process, and a small run file to run it on."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from granufab.cli import main
from granufab.history import SERIES_UNITS, Frame
from granufab.packing import Cell, Contacts, Grains, Packing

sys.path.insert(0, str(Path(__file__).parent))


@dataclass(frozen=True)
class Done:
    """What a command left: its exit code and its two streams."""

    code: int
    out: str
    err: str


@pytest.fixture
def granufab(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    def call(*arguments: object) -> Done:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return Done(code, out, err)

    return call


def square_lattice(side: int = 4) -> Packing:
    """Touching unit disks on a periodic square lattice: z = 4, a = 0, each contact force 1."""
    count = side * side
    column, row = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    position = np.column_stack([column.ravel(), row.ravel()]) + 0.5
    pair, normal, image = [], [], []
    for step in (np.array([1, 0]), np.array([0, 1])):
        for first in range(count):
            target = np.array([first // side, first % side]) + step
            pair.append((first, (target[0] % side) * side + target[1] % side))
            normal.append(step)
            image.append(target // side)
    vectors = np.array(normal, dtype=float)
    return Packing(
        grains=Grains(
            position=position,
            radius=np.full(count, 0.5),
            mass=np.ones(count),
            velocity=np.zeros((count, 2)),
            spin=np.zeros((count, 1)),
        ),
        contacts=Contacts(
            pair=np.array(pair),
            normal=vectors,
            branch=vectors,
            gap=np.zeros(len(vectors)),
            force=vectors,
            image=np.array(image),
        ),
        cell=Cell(matrix=side * np.eye(2)),
        time=0.0,
        source="square lattice",
    )


def series_row(index: int) -> dict[str, float | str]:
    """A row of a made-up series that has reached its critical state z = 3.4, a = 0.2."""
    wobble = 0.01 * np.sin(2.4 * index)
    row: dict[str, float | str] = dict.fromkeys(SERIES_UNITS, 0.0)
    row |= {
        "path": "made-up",
        "eps_q": 0.01 * index,
        "eps_q_total": 0.01 * index,
        "z": 3.0 + wobble,
        "z_backbone": 3.4 + wobble,
        "z_mechanical": 3.3 + wobble,
        "a": 0.2 - wobble,
        "a_signed": 0.2 - wobble,
    }
    return row


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    """Three states of a square lattice and a series of forty rows."""
    from granufab.io import RunFileWriter
    from granufab.simulate.settings import Case

    path = tmp_path / "run.h5"
    with RunFileWriter(path, settings=Case(name="made-up").model_dump(mode="json")) as writer:
        for index in range(3):
            writer.frame(
                Frame(
                    packing=square_lattice(),
                    eps_q=0.1 * index,
                    eps_q_total=0.1 * index,
                    strain=np.zeros((2, 2)),
                    stage=0,
                    stress=np.eye(2),
                    inertial_number=1e-3,
                    direction=np.array([0.0, 1.0]),
                )
            )
        for index in range(40):
            writer.row(series_row(index))
    return path
