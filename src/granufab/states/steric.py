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

__all__ = [
    "exclusion_angle",
    "steric_anisotropy",
    "steric_coordination",
    "steric_margin",
    "window_occupation",
]


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


def steric_coordination(angle: float, dimension: int = 2) -> float:
    """Coordination number that fills every window with one contact [Radjai2012, eq. 18].

    2D: z_steric = 2π/δθ. 3D (beyond the paper): 2/(1 − cos δθ/2), the caps of half angle δθ/2
    that the sphere has area for; packing of caps on a sphere leaves gaps, so fewer fit.

    Args:
        angle: exclusion angle δθ [rad], 0 < δθ < π.
        dimension: 2 or 3.
    Returns:
        z_steric [-]; for equal grains 6 in 2D, 14.9 in 3D (where 12 fit).
    Raises:
        InvalidSettings: δθ outside 0..π, or the dimension is neither 2 nor 3.
    """
    isotropic, _ = _window(angle, dimension)
    return 1.0 / isotropic


def steric_anisotropy(z: ArrayLike, angle: float, dimension: int = 2) -> Array:
    """Largest anisotropy that leaves room for the contacts along θ_c [Radjai2012, eqs. 17–18].

    The window δθ around the major direction holds one contact at most. 2D:
    ∫E dθ = (z/2π)(δθ + a sin δθ) ≤ 1, so a ≤ (2π/sin δθ)(1/z − 1/z_steric). 3D, axisymmetric
    compression: with u = cos δθ/2, a ≤ 2/(u − u³)·(1/z − 1/z_steric).

    Args:
        z: coordination number [-], > 0, any shape.
        angle: exclusion angle δθ [rad], 0 < δθ < π.
        dimension: 2 or 3.
    Returns:
        The bound [-], shape of ``z``; negative where z > z_steric (no state fits).
    Raises:
        InvalidSettings: δθ outside 0..π, z not > 0, or the dimension is neither 2 nor 3.
    """
    values = _positive(z)
    isotropic, harmonic = _window(angle, dimension)
    return (1.0 / values - isotropic) / harmonic


def window_occupation(
    z: ArrayLike, a: ArrayLike, angle: float, offset: ArrayLike = 0.0, dimension: int = 2
) -> Array:
    """Mean number of a grain's contacts in a window δθ of any centre [Radjai2012, eq. 17].

    ∫E over |θ − θ_0| < δθ/2 with the second-order E. 2D: (z/2π){δθ + a sin δθ cos 2(θ_0 − θ_c)}.
    3D: over the cap of half angle δθ/2 whose centre is θ_0 from the axis, with u = cos δθ/2,
    (z/2){1 − u + a (u − u³) P_2(cos θ_0)}.

    Args:
        z: coordination number [-], > 0.
        a: signed anisotropy [-].
        angle: exclusion angle δθ [rad], 0 < δθ < π.
        offset: θ_0 − θ_c in 2D, polar angle θ_0 of the window's centre in 3D [rad].
        dimension: 2 or 3.
    Returns:
        The number [-], shape of z, a and offset broadcast; at most 1 where the state is feasible.
    Raises:
        InvalidSettings: δθ outside 0..π, z not > 0, or the dimension is neither 2 nor 3.
    """
    values, centre = _positive(z), np.asarray(offset, dtype=np.float64)
    isotropic, harmonic = _window(angle, dimension)
    double = np.cos(2.0 * centre)
    shape = double if dimension == 2 else 0.25 + 0.75 * double
    return values * (isotropic + harmonic * np.asarray(a, dtype=np.float64) * shape)


def steric_margin(z: ArrayLike, a: ArrayLike, angle: float, dimension: int = 2) -> Array:
    """Room left in the fullest window: 1 − max over θ_0 of :func:`window_occupation`.

    The fullest window lies along θ_c in 2D, along the axis in 3D compression and on the equator
    in extension. The state (z, a) is feasible under [Radjai2012, eq. 17] where this is ≥ 0.

    Args:
        z: coordination number [-], > 0.
        a: signed anisotropy [-].
        angle: exclusion angle δθ [rad], 0 < δθ < π.
        dimension: 2 or 3.
    Returns:
        The margin [contacts], shape of z and a broadcast.
    Raises:
        InvalidSettings: δθ outside 0..π, z not > 0, or the dimension is neither 2 nor 3.
    """
    along = window_occupation(z, a, angle, 0.0, dimension)
    across = window_occupation(z, a, angle, 0.5 * math.pi, dimension)
    return 1.0 - np.maximum(along, across)


def _window(angle: float, dimension: int) -> tuple[float, float]:
    """Share of E in a window along the axis: isotropic part, and part per unit of a."""
    if not 0.0 < angle < math.pi:
        raise InvalidSettings(f"exclusion angle is {angle!r} rad, must lie between 0 and π")
    if dimension == 2:
        return angle / (2.0 * math.pi), math.sin(angle) / (2.0 * math.pi)
    if dimension == 3:
        edge = math.cos(0.5 * angle)
        return 0.5 * (1.0 - edge), 0.5 * (edge - edge**3)
    raise InvalidSettings(f"dimension is {dimension!r}, must be 2 or 3")


def _positive(z: ArrayLike) -> Array:
    values = np.asarray(z, dtype=np.float64)
    if not (values > 0.0).all():
        raise InvalidSettings(f"z holds {np.min(values):g}, must be > 0 everywhere")
    return values
