"""Exclusion around one grain: how many neighbours fit, and how anisotropic they can be.

``z_steric`` is the bound of one grain's shell. It is not the ``z_max`` that is fitted to an
assembly: with equal values the steric line would exclude the paper's own critical state.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings
from granufab.packing import Array

__all__ = ["exclusion_angle", "steric_anisotropy", "steric_coordination"]


def exclusion_angle(radius: float = 1.0, first: float = 1.0, second: float = 1.0) -> float:
    """Angle δθ [rad] between two disks that touch each other and a central disk.

    cos δθ = (l_1² + l_2² − l_12²)/(2 l_1 l_2) with l_k = radius + r_k and l_12 = r_1 + r_2; for
    equal disks δθ = π/3.

    Args:
        radius: radius of the central disk [m].
        first: radius of one neighbour [m].
        second: radius of the other neighbour [m].
    Raises:
        InvalidSettings: a radius is not > 0.
    """
    for name, value in (("radius", radius), ("first", first), ("second", second)):
        if not 0.0 < value < math.inf:
            raise InvalidSettings(f"{name} is {value!r}, must be > 0")
    one, other, across = radius + first, radius + second, first + second
    return math.acos((one**2 + other**2 - across**2) / (2.0 * one * other))


def steric_coordination(angle: float) -> float:
    """Largest coordination number of one disk, z_steric = 2π/δθ [Radjai2012, eq. 18].

    Args:
        angle: exclusion angle δθ [rad], 0 < δθ < π.
    Returns:
        z_steric [-]; 6 for equal disks.
    Raises:
        InvalidSettings: δθ outside 0..π.
    """
    return 2.0 * math.pi / _checked(angle)


def steric_anisotropy(z: ArrayLike, angle: float) -> Array:
    """Largest anisotropy that leaves room for the contacts along θ_c [Radjai2012, eqs. 17–18].

    The sector δθ around the major direction holds one contact at most,
    ∫E dθ = (z/2π)(δθ + a sin δθ) ≤ 1, so a ≤ (2π/sin δθ)(1/z − 1/z_steric).

    Args:
        z: coordination number [-], > 0, any shape.
        angle: exclusion angle δθ [rad], 0 < δθ < π.
    Returns:
        The bound [-], shape of ``z``; negative where z > z_steric (no state fits).
    Raises:
        InvalidSettings: δθ outside 0..π or z not > 0.
    """
    values = np.asarray(z, dtype=np.float64)
    if not (values > 0.0).all():
        raise InvalidSettings(f"z holds {np.min(values):g}, must be > 0 everywhere")
    limit = steric_coordination(angle)
    return 2.0 * math.pi / math.sin(angle) * (1.0 / values - 1.0 / limit)


def _checked(angle: float) -> float:
    if not 0.0 < angle < math.pi:
        raise InvalidSettings(f"exclusion angle is {angle!r} rad, must lie between 0 and π")
    return float(angle)
