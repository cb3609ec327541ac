"""What two runs must have in common to count as the same."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

import granufab as gf

__all__ = ["digest"]


def digest(folder: Path) -> str:
    """SHA-256 of all frames and of the series of a run file, wall times left out."""
    run, found = gf.read(folder / "run.h5"), hashlib.sha256()
    for frame in run.frames:
        packing = frame.packing
        assert packing.contacts is not None
        assert packing.cell is not None
        arrays = [packing.grains.position, packing.grains.velocity, packing.grains.spin]
        arrays += [packing.contacts.pair, packing.contacts.force, packing.cell.matrix, frame.strain]
        arrays += [packing.cell.rate, frame.stress]
        for array in arrays:
            found.update(np.ascontiguousarray(array).tobytes())
        found.update(repr((frame.eps_q, frame.eps_q_total, frame.stage, packing.time)).encode())
    for name, column in run.series.data_vars.items():
        if column.dtype.kind == "f":
            found.update(str(name).encode() + column.values.tobytes())
    return f"{len(run.frames)} frames, {run.series.sizes['record']} rows, {found.hexdigest()}"
