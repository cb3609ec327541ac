"""States on a jittered lattice in simple shear: unwrapped, with forces, remapped half way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from granufab.fabric import neighbours_within
from granufab.history import SERIES_UNITS, Frame
from granufab.packing import Cell, Grains, Packing


def sheared_frames(dimension: int, count: int = 12) -> Iterator[Frame]:
    """Every pair within 0.05 d listed; some carry no force; grains drift out of the cell."""
    random = np.random.default_rng(dimension)
    side = 10 if dimension == 2 else 6
    steps = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), axis=-1)
    rest = steps.reshape(-1, dimension) + 0.05 * random.standard_normal(
        (side**dimension, dimension)
    )
    rest += side * random.integers(-1, 2, rest.shape)  # images of the cell, as after a long path
    radius, origin = random.uniform(0.5, 0.53, len(rest)), np.full(dimension, -2.5)
    for index in range(count):
        gradient = np.eye(dimension)
        gradient[0, 1] = 0.1 * index
        remap = np.eye(dimension)
        remap[0, 1] = -1.0 if index >= count // 2 else 0.0
        wander = 0.02 * random.standard_normal(rest.shape)
        bare = Packing(
            grains=Grains(
                position=(rest + wander) @ gradient.T + origin,
                radius=radius,
                velocity=wander,
                spin=random.standard_normal((len(rest), 1 if dimension == 2 else 3)),
                mass=np.ones(len(rest)),
            ),
            cell=Cell(matrix=side * gradient @ remap, origin=origin),
        )
        near = neighbours_within(bare, 0.05)
        force = random.exponential(size=(near.count, 1)) * near.normal
        force += 0.1 * random.standard_normal(near.normal.shape) * (force != 0)
        force[random.random(near.count) < 0.2] = 0.0
        yield Frame(
            packing=replace(bare, contacts=replace(near, force=7.0 * force)),
            eps_q=0.1 * index,
            eps_q_total=0.1 * index,
            strain=np.zeros((dimension, dimension)),
            stage=0,
            stress=np.eye(dimension),
            inertial_number=1e-3,
            direction=np.eye(dimension)[1],
            remap=remap,
        )


def series_row(index: int) -> dict[str, float | str]:
    """A row of a made-up series that reaches its critical state z = 3.4, a = 0.2."""
    wobble = 0.01 * np.sin(2.4 * index)
    row: dict[str, float | str] = dict.fromkeys(SERIES_UNITS, 0.0)
    return row | {
        "path": "made-up",
        "eps_q": 0.01 * index,
        "eps_q_total": 0.01 * index,
        "z": 3.0 + wobble,
        "z_backbone": 3.4 + wobble,
        "a": 0.2 - wobble,
        "a_signed": 0.2 - wobble,
    }


def write_run(path: Path, frames: Iterable[Frame], rows: int = 40) -> Path:
    from granufab.io import RunFileWriter
    from granufab.simulate.settings import Case, Sample

    states = list(frames)
    case = Case(name="made-up", sample=Sample(dimension=states[0].packing.dimension))
    with RunFileWriter(path, settings=case.model_dump(mode="json")) as writer:
        for frame in states:
            writer.frame(frame)
        for index in range(rows):
            writer.row(series_row(index))
    return path
