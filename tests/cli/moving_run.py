"""A run file of grains that wander in an affine flow, for verbs that look at motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from granufab.fabric import neighbours_within
from granufab.history import SERIES_UNITS, Frame
from granufab.packing import Cell, Grains, Packing


def moving_run(path: Path, dimension: int = 2, frames: int = 12) -> Path:
    """Grains on a jittered lattice in an affine flow, every pair in reach a contact."""
    from granufab.io import RunFileWriter
    from granufab.simulate.settings import Case, Sample

    random = np.random.default_rng(1)
    side = 10 if dimension == 2 else 6
    steps = np.stack(np.meshgrid(*[np.arange(side)] * dimension, indexing="ij"), axis=-1)
    rest = steps.reshape(-1, dimension) + 0.05 * random.standard_normal(
        (side**dimension, dimension)
    )
    settings = Case(sample=Sample(dimension=dimension)).model_dump(mode="json")
    with RunFileWriter(path, settings=settings) as writer:
        for index in range(frames):
            strain = 0.01 * index
            gradient = np.eye(dimension)
            gradient[0, 0], gradient[1, 1] = 1 + strain / 2, 1 - strain / 2
            wander = 0.01 * random.standard_normal(rest.shape)
            bare = Packing(
                grains=Grains(
                    position=(rest + wander) @ gradient.T, radius=np.full(len(rest), 0.52)
                ),
                cell=Cell(matrix=side * gradient),
            )
            near = neighbours_within(bare, 0.02)
            strength = random.exponential(size=(near.count, 1))
            writer.frame(
                Frame(
                    packing=replace(bare, contacts=replace(near, force=strength * near.normal)),
                    eps_q=strain,
                    eps_q_total=strain,
                    strain=np.zeros((dimension, dimension)),
                    stage=0,
                    stress=np.eye(dimension),
                    inertial_number=1e-3,
                    direction=np.eye(dimension)[1],
                )
            )
            row: dict[str, float | str] = dict.fromkeys(SERIES_UNITS, 0.0)
            writer.row(row | {"path": "made-up", "eps_q": strain, "eps_q_total": strain})
    return path
