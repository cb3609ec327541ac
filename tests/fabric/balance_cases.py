"""Made-up states whose contacts, and what becomes of them, are known."""

from __future__ import annotations

import numpy as np
import xarray as xr

from granufab.history import Frame, Run
from granufab.packing import Cell, Contacts, Grains, Packing


def state(pair, normal, *, grain_count=None, number=None, image=None, cell=None) -> Packing:
    """Grains anywhere with the contacts given; use the criterion ``listed``."""
    normal = np.atleast_2d(np.asarray(normal, dtype=float))
    pair = np.asarray(pair, dtype=np.int64).reshape(-1, 2)
    dimension = normal.shape[1]
    count = grain_count or int(pair.max()) + 1
    position = np.random.default_rng(5).random((count, dimension)) * 20
    return Packing(
        grains=Grains(position=position, radius=np.full(count, 0.5), number=number),
        contacts=Contacts(
            pair=pair,
            normal=normal,
            image=np.zeros_like(normal, dtype=int) if image is None else image,
        ),
        cell=Cell(matrix=20 * np.eye(dimension)) if cell is None else cell,
    )


def turned(packing: Packing, rotation: np.ndarray) -> Packing:
    """The state after a rigid rotation of everything, its cell too."""
    contacts, cell = packing.contacts, packing.cell
    assert contacts is not None
    assert cell is not None
    return Packing(
        grains=Grains(
            position=packing.grains.position @ rotation.T,
            radius=packing.grains.radius,
            number=packing.grains.number,
        ),
        contacts=Contacts(
            pair=contacts.pair, normal=contacts.normal @ rotation.T, image=contacts.image
        ),
        cell=Cell(matrix=rotation @ cell.matrix),
    )


def rotation_2d(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def at_angles(degrees) -> np.ndarray:
    """Normals in 2D at these angles from x."""
    angle = np.radians(np.asarray(degrees, dtype=float))
    return np.column_stack([np.cos(angle), np.sin(angle)])


def all_pairs(grain_count: int, count: int) -> np.ndarray:
    return np.column_stack(np.triu_indices(grain_count, 1))[:count]


def run_of(packings, *, stages=None, strains=None) -> Run:
    """A run with a frame for each state, 0.01 of strain apart, contraction along x."""
    stages = [0] * len(packings) if stages is None else stages
    strains = 0.01 * np.arange(len(packings)) if strains is None else strains
    dimension = packings[0].dimension
    frames = [
        Frame(
            packing=packing,
            eps_q=float(strain),
            eps_q_total=float(strain),
            strain=np.zeros((dimension, dimension)),
            stage=stage,
            stress=np.eye(dimension),
            inertial_number=1e-3,
            direction=np.eye(dimension)[0],
        )
        for packing, stage, strain in zip(packings, stages, strains, strict=True)
    ]
    return Run(series_source=xr.Dataset(), frames=frames, name="made-up")


def residue(data: xr.Dataset) -> np.ndarray:
    """What is left of the balance in every bin: zeros if it closes."""
    left = data["before"] + data["gain"] - data["loss"] + data["current_in"] - data["current_out"]
    return (left - data["after"]).to_numpy()
