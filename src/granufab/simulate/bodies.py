"""Body records: what the sweep knows of a grain or a wall."""

from __future__ import annotations

import numpy as np

from granufab.packing import Array, Packing, require

__all__ = ["body_records"]


def body_records(packing: Packing) -> Array:
    """Rows (v, s = R·ω, 1/m) of every grain, then 2D rows of zeros for the walls.

    Walls move with the cell, so their fluctuation is zero and their mass infinite. The layout is
    that of ``kernels.vectors``: 4 columns in 2D, 8 in 3D.

    Raises:
        MissingData: the grains have no masses.
    """
    grains, dimension = packing.grains, packing.dimension
    spins, width = (1, 4) if dimension == 2 else (3, 8)
    records = np.zeros((grains.count + 2 * dimension, width))
    rows = records[: grains.count]
    if grains.velocity is not None:
        rows[:, :dimension] = grains.velocity
    if grains.spin is not None:
        rows[:, dimension : dimension + spins] = grains.spin * grains.radius[:, None]
    rows[:, dimension + spins] = 1.0 / require(grains.mass, "grain masses")
    return records
