"""Contact stress and solid fraction of a packing."""

from __future__ import annotations

import math

import numpy as np

from granufab.errors import MissingData
from granufab.fabric.neighbours import branch_vectors
from granufab.fabric.tensors import deviatoric_part, mean_part
from granufab.packing import Array, Packing, require

__all__ = ["solid_fraction", "stress_ratio", "stress_tensor"]


def stress_tensor(packing: Packing) -> Array:
    r"""Contact stress :math:`\sigma_{ij} = V^{-1}\sum_c f_i \ell_j`, compression positive.

    The sum runs over grain–grain contacts and over contacts with walls, whose branch is
    n (R + gap). Without inertia and gravity it is symmetric.

    Args:
        packing: needs contact forces and a cell.
    Returns:
        [N/m^(D−1)], shape (D, D).
    Raises:
        MissingData: there is no cell, or no contact force.
    """
    cell = require(packing.cell, "cell lengths", "give the cell of the packing (--cell)")
    contacts, walls = packing.contacts, packing.wall_contacts
    if contacts is None and walls is None:
        raise MissingData("contacts are not in this data, so its stress is unknown")
    total = np.zeros((packing.dimension, packing.dimension))
    if contacts is not None:
        force = require(contacts.force, "contact forces")
        total += force.T @ branch_vectors(packing)
    if walls is not None:
        arm = packing.grains.radius[walls.grain] + walls.gap
        total += walls.force.T @ (walls.normal * arm[:, None])
    return total / cell.volume


def stress_ratio(stress: Array) -> float:
    """q/p of a stress [-]: q = (σ_1−σ_2)/2 in 2D, (σ_1−σ_3)/3 in 3D; p = tr σ/D.

    Args:
        stress: compression positive, shape (D, D); its symmetric part is used.
    Raises:
        MissingData: the mean stress is zero.
    """
    mean = mean_part(stress)
    if mean == 0.0:
        raise MissingData("the mean stress is zero, so q/p is not defined")
    return deviatoric_part(stress) / mean


def solid_fraction(packing: Packing) -> float:
    """Volume of the grains over the volume of the cell [-]; overlaps are counted twice.

    Raises:
        MissingData: there is no cell.
    """
    cell = require(packing.cell, "cell lengths", "give the cell of the packing (--cell)")
    radius = packing.grains.radius
    if packing.dimension == 2:
        solid = math.pi * float(np.sum(radius**2))
    else:
        solid = 4.0 / 3.0 * math.pi * float(np.sum(radius**3))
    return solid / cell.volume
