"""What changes z and the anisotropy: contacts gained, contacts lost, contacts turned.

With N_c contacts among N grains z = 2N_c/N and z a' = (2/N) Σ_c g(n_c), where
g(n) = 2cos 2(θ − θ_0) = 2{2(n·d)² − 1} in 2D and (5/4){3(n·d)² − 1} in 3D. Both are sums over
contacts, so that a change splits without a remainder: a gained contact adds its term at the end of
the interval, a lost one takes away its term at the start, a persistent one adds the difference.
"""

from __future__ import annotations

import math

import numpy as np

from granufab.fabric.affine import affine_turning
from granufab.fabric.tensors import axial_anisotropy
from granufab.packing import Array

__all__ = ["attribute", "fabric_term"]


def fabric_term(normal: Array, direction: Array) -> Array:
    """g(n), the share of each contact in a': its mean over the contacts is a' [-].

    Args:
        normal: unit vectors, shape (contact_count, D).
        direction: unit vector d, shape (D,).
    """
    return axial_anisotropy((normal @ direction) ** 2, len(direction))


def _turning_term(normal: Array, direction: Array, gradient: Array) -> Array:
    """Change of g of normals that turn with an affine flow."""
    factor = 8.0 if len(direction) == 2 else 7.5
    turning = affine_turning(normal, gradient)
    return factor * (normal @ direction) * (turning @ direction)


def attribute(
    gained: Array,
    lost: Array,
    turned: tuple[Array, Array],
    *,
    direction: Array,
    grain_count: int,
    gradient: Array | None,
) -> dict[str, float]:
    """Parts of Δz and Δ(z a') over an interval.

    Args:
        gained: normals at the end of the interval, shape (gained, D).
        lost: normals at its start, shape (lost, D).
        turned: normals of the persistent contacts at its start and end.
        direction: axis d of a', unit vector.
        grain_count: N.
        gradient: L·Δt of the mean deformation, or None.
    Returns:
        z_gain, z_loss (≤ 0), z_rotation (0), az_gain, az_loss, az_rotation, their standard errors
        with gains and losses as Poisson events, and az_rotation_affine: that of contacts turning
        with the mean flow (NaN without a gradient).
    """
    share = 2.0 / grain_count
    gain, loss = fabric_term(gained, direction), fabric_term(lost, direction)
    turn = fabric_term(turned[1], direction) - fabric_term(turned[0], direction)
    affine = math.nan
    if gradient is not None:
        terms = [_turning_term(normal, direction, gradient).sum() for normal in turned]
        affine = 0.5 * share * float(sum(terms))
    return {
        "z_gain": share * len(gain),
        "z_loss": -share * len(loss),
        "z_rotation": 0.0,
        "az_gain": share * float(gain.sum()),
        "az_loss": -share * float(loss.sum()),
        "az_rotation": share * float(turn.sum()),
        "az_rotation_affine": affine,
        "z_gain_error": share * math.sqrt(len(gain)),
        "z_loss_error": share * math.sqrt(len(loss)),
        "az_gain_error": share * float(np.linalg.norm(gain)),
        "az_loss_error": share * float(np.linalg.norm(loss)),
        "az_rotation_error": share * float(np.linalg.norm(turn)),
    }
