"""Run files of sheared lattices, of any size, made in no time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granufab.history import Frame
from granufab.io import RunFileWriter
from granufab.packing import Cell, Contacts, Grains, Packing
from granufab.simulate.settings import Case

__all__ = ["frame_bytes", "write_lattice_run"]


def _packing(side: int, turn: float, generator: np.random.Generator) -> Packing:
    """Touching disks, z = 4, with random forces, of which a tenth is missing."""
    count = side * side
    index = np.arange(count)
    column, row = index // side, index % side
    right = ((column + 1) % side) * side + row
    above = column * side + (row + 1) % side
    pair = np.concatenate([np.stack([index, right], 1), np.stack([index, above], 1)])
    step = np.concatenate([np.tile([1, 0], (count, 1)), np.tile([0, 1], (count, 1))])
    image = np.stack([(column + 1) // side, (row + 1) // side], 1)
    image = np.concatenate([image * [1, 0], image * [0, 1]])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    normal = step @ rotation.T
    size = generator.exponential(size=2 * count) * (generator.random(2 * count) > 0.1)
    return Packing(
        grains=Grains(
            position=(np.stack([column, row], 1) + 0.5) @ rotation.T,
            radius=np.full(count, 0.5),
            mass=np.ones(count),
            velocity=0.01 * generator.standard_normal((count, 2)),
            spin=0.01 * generator.standard_normal((count, 1)),
        ),
        contacts=Contacts(
            pair=pair,
            normal=normal,
            branch=normal,
            gap=np.zeros(2 * count),
            force=normal * size[:, None],
            image=image,
        ),
        cell=Cell(matrix=side * rotation),
        time=0.0,
    )


def write_lattice_run(path: Path, side: int, frames: int, stages: tuple[int, ...] = ()) -> Frame:
    """Write a run; a stage begins at each frame of ``stages``. Returns its last frame."""
    generator = np.random.default_rng(4)
    settings = Case(name="lattice").model_dump(mode="json")
    with RunFileWriter(path, settings=settings, force=True) as writer:
        for index in range(frames):
            frame = Frame(
                packing=_packing(side, 0.01 * index, generator),
                eps_q=0.01 * index,
                eps_q_total=0.01 * index,
                strain=np.zeros((2, 2)),
                stage=sum(index >= start for start in stages),
                stress=np.eye(2),
                inertial_number=1e-3,
                direction=np.array([0.0, 1.0]),
            )
            writer.frame(frame)
    return frame


def frame_bytes(frame: Frame) -> int:
    """Memory of a frame's arrays."""
    records = (frame.packing.grains, frame.packing.contacts)
    fields = (getattr(one, name) for one in records if one for name in type(one).__slots__)
    return sum(field.nbytes for field in fields if isinstance(field, np.ndarray))
