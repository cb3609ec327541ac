"""Body records: what the sweep knows of a grain or a wall."""

from __future__ import annotations

import numpy as np

from granufab.packing import Array, Packing, require

__all__ = ["aligned", "body_records"]

CACHE_LINE = 64


def aligned(shape: tuple[int, ...], kind: type = np.float64) -> np.ndarray:
    """Zeros that begin at a cache line, so that no record lies across two."""
    item = np.dtype(kind)
    size = int(np.prod(shape)) * item.itemsize
    raw = np.zeros(size + CACHE_LINE, np.uint8)
    begin = -raw.ctypes.data % CACHE_LINE
    return raw[begin : begin + size].view(item).reshape(shape)


def body_records(packing: Packing) -> Array:
    """Rows (v, s = R·ω, 1/m) of every grain, 2D rows of zeros for the walls, and a spare one.

    Walls move with the cell, so their fluctuation is zero and their mass infinite; the spare row
    belongs to the empty places of the sweep (``kernels.slots``). The layout is
    that of ``kernels.vectors``: 4 columns in 2D, 8 in 3D.

    Raises:
        MissingData: the grains have no masses.
    """
    grains, dimension = packing.grains, packing.dimension
    spins, width = (1, 4) if dimension == 2 else (3, 8)
    records = aligned((grains.count + 2 * dimension + 1, width))
    rows = records[: grains.count]
    if grains.velocity is not None:
        rows[:, :dimension] = grains.velocity
    if grains.spin is not None:
        rows[:, dimension : dimension + spins] = grains.spin * grains.radius[:, None]
    rows[:, dimension + spins] = 1.0 / require(grains.mass, "grain masses")
    return records
