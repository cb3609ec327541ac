"""Contacts that turn with the mean deformation: the affine current beside the measured one."""

from __future__ import annotations

import numpy as np

from granufab.fabric.contact_identity import IdentifiedContacts
from granufab.fabric.direction_bins import DirectionBins
from granufab.packing import Array

__all__ = ["affine_current", "affine_turning", "mean_gradient"]


def affine_turning(normal: Array, gradient: Array) -> Array:
    r"""Rate at which normals turn with an affine flow, :math:`\dot n = (1 - n\otimes n)\,L\,n`.

    In a 2D pure shear with contraction along θ = 0 this is θ̇ = (ε̇_q/2) sin 2θ.

    Args:
        normal: unit vectors [-], shape (contact_count, D).
        gradient: velocity gradient L [1/s], or an increment L·Δt [-], shape (D, D).
    Returns:
        ṅ, perpendicular to n [1/s or -], shape (contact_count, D).
    """
    moved = normal @ np.asarray(gradient).T
    return moved - normal * np.einsum("ci,ci->c", normal, moved)[:, None]


def mean_gradient(before: IdentifiedContacts, after: IdentifiedContacts) -> Array | None:
    """L·Δt of the mean deformation that took one cell to the other [-], shape (D, D).

    log(A) of A = C_after C_before⁻¹, both cells in the same lattice vectors, by its series
    2(X + X³/3 + X⁵/5 + X⁷/7), X = (A − 1)(A + 1)⁻¹, to 10⁻⁶ up to strains of a half. None without
    a cell.
    """
    if before.lattice is None or after.lattice is None:
        return None
    deformation = after.lattice @ np.linalg.inv(before.lattice)
    one = np.eye(len(deformation))
    x = (deformation - one) @ np.linalg.inv(deformation + one)
    square = x @ x
    return 2.0 * x @ (one + square @ (one / 3.0 + square @ (one / 5.0 + square / 7.0)))


def affine_current(normal: Array, bins: DirectionBins, gradient: Array) -> Array:
    r"""Number of normals that an affine flow takes across each edge, J = E θ̇ Δt [-].

    The density at an edge is that of its two bins; the speed is taken at the edge, for the
    azimuths of the contacts there in 3D.

    Args:
        normal: all contacts of a state [-], shape (contact_count, D).
        bins: the bins.
        gradient: L·Δt [-], shape (D, D).
    Returns:
        Signed, positive towards growing θ, shape (bins.count + 1,).
    """
    index = bins.index(normal)
    current = np.zeros(bins.count + 1)
    for edge in (index, index + 1):
        there = bins.at_edge(normal, edge)
        speed = bins.speed(there, affine_turning(there, gradient))
        current += np.bincount(edge, weights=speed, minlength=bins.count + 1)
    current /= 2.0 * bins.width
    if bins.dimension == 3:
        current[[0, -1]] = 0.0
    else:
        current[[0, -1]] = current[0] + current[-1]
    return current
