"""The Mohr circle of the fabric tensor G: normal and tangential projections by direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.states.domain import AccessibleDomain

__all__ = ["MohrCircle", "critical_circle", "limit_circles", "mohr", "tangent_line"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MohrCircle:
    """Circle (G_n, G_t) of a state; make one with :func:`mohr`.

    The angle θ is counted from the symmetry axis: the major direction where a ≥ 0. In 3D the
    circle is the one through the extreme principal values; :attr:`circles` has the two others.

    Attributes:
        z: coordination number [-].
        a: anisotropy [-]; < 0 in a 3D axisymmetric state means extension-like.
        dimension: 2 or 3.
        b: (G_2 − G_3)/(G_1 − G_3) in 3D, or None for axisymmetric states.
    """

    z: float
    a: float
    dimension: int = 2
    b: float | None = None

    @classmethod
    def from_tensor(cls, tensor: ArrayLike) -> Self:
        """The state of a fabric tensor G, of any principal values and directions.

        z = 2 tr G, a = 2(G_1 − G_2)/tr G in 2D, (5/2)(G_1 − G_3)/tr G in 3D,
        b = (G_2 − G_3)/(G_1 − G_3) in 3D (0 where G is isotropic).

        Args:
            tensor: G = (z/2) F [-], symmetric, shape (D, D).
        Raises:
            InvalidSettings: not a symmetric 2×2 or 3×3 tensor with values ≥ 0 and a trace > 0.
        """
        values = np.asarray(tensor, dtype=np.float64)
        if values.shape not in ((2, 2), (3, 3)) or not np.allclose(values, values.T, atol=1e-9):
            raise InvalidSettings(f"G has shape {values.shape}, must be symmetric, 2×2 or 3×3")
        principal = np.linalg.eigvalsh(values)[::-1]
        trace, spread = float(principal.sum()), float(principal[0] - principal[-1])
        if not trace > 0.0 or principal[-1] < -1e-12 * trace:
            raise InvalidSettings(
                f"G has the principal values {principal.tolist()}, none may be negative"
            )
        if len(values) == 2:
            return cls(z=2.0 * trace, a=2.0 * spread / trace)
        b = float(principal[1] - principal[2]) / spread if spread > 1e-14 * trace else 0.0
        return cls(z=2.0 * trace, a=2.5 * spread / trace, dimension=3, b=b)

    @property
    def p_G(self) -> float:
        """Mean of the principal values, z/(2D) [-] [Radjai2012, eqs. 2, 4]."""
        return self.z / (2.0 * self.dimension)

    @property
    def q_G(self) -> float:
        """Deviator [-]: z a/8 in 2D, z a/15 in 3D [Radjai2012, eqs. 3, 5 with 12, 13]."""
        return self.z * self.a / (8.0 if self.dimension == 2 else 15.0)

    @property
    def _along(self) -> float:
        """G along θ = 0."""
        if self.dimension == 2:
            return self.p_G + self.q_G
        return self.p_G + (2.0 - (self.b or 0.0)) * self.q_G

    @property
    def _across(self) -> float:
        """G along θ = π/2."""
        return self._along - (2.0 if self.dimension == 2 else 3.0) * self.q_G

    @property
    def G_1(self) -> float:
        """Largest principal value [-]."""
        return max(self._along, self._across)

    @property
    def G_D(self) -> float:
        """Smallest principal value [-]."""
        return min(self._along, self._across)

    @property
    def principal(self) -> tuple[float, ...]:
        """The D principal values G_1 ≥ … ≥ G_D [-]."""
        if self.dimension == 2:
            return self.G_1, self.G_D
        return self.G_1, 0.5 * self.z - self.G_1 - self.G_D, self.G_D

    @property
    def circles(self) -> tuple[tuple[float, float], ...]:
        """Centre and radius [-] of each circle, the largest first: one in 2D, three in 3D.

        In 3D those through G_1 and G_3, G_1 and G_2, G_2 and G_3: the projections of G on all
        planes lie within the first and outside the other two. In axisymmetric states one of
        them is a point.
        """
        values = self.principal
        pairs = ((0, 1),) if self.dimension == 2 else ((0, 2), (0, 1), (1, 2))
        return tuple(
            (0.5 * (values[i] + values[j]), 0.5 * (values[i] - values[j])) for i, j in pairs
        )

    @property
    def centre(self) -> float:
        """Centre of the circle on the G_n axis, (G_1 + G_D)/2 [-]."""
        return 0.5 * (self.G_1 + self.G_D)

    @property
    def radius(self) -> float:
        """Radius of the circle, (G_1 − G_D)/2 [-]."""
        return 0.5 * (self.G_1 - self.G_D)

    def points(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Projections G_n = G m·m, G_t = G m·t along m(θ) [Radjai2012, eqs. 6–9].

        2D: G_n = p_G + q_G cos 2θ, G_t = q_G sin 2θ. 3D axisymmetric:
        G_n = p_G + q_G (3 cos²θ − 1), G_t = (3/2) q_G sin 2θ. The tangent t is m turned
        clockwise, t = (sin θ, −cos θ) in the plane of m and the axis θ = π/2.

        Args:
            theta: angle from the symmetry axis [rad], any shape.
        Returns:
            (G_n, G_t) [-], each of the shape of ``theta``.
        """
        twice = 2.0 * np.asarray(theta, dtype=np.float64)
        half = 0.5 * (self._along - self._across)
        return self.centre + half * np.cos(twice), half * np.sin(twice)


def mohr(z: float, a: float, dimension: int = 2, b: float | None = None) -> MohrCircle:
    """Mohr circle of the fabric tensor G of a state (z, a) [Radjai2012, eqs. 2–9].

    Args:
        z: coordination number [-], > 0.
        a: anisotropy [-]; signed a' is taken as it is.
        dimension: 2 or 3.
        b: (G_2 − G_3)/(G_1 − G_3) of a 3D state that is not axisymmetric.
    Raises:
        InvalidSettings: z ≤ 0, or a beyond what leaves every principal value ≥ 0
            (2D \\|a\\| ≤ 2, 3D −5/4 ≤ a ≤ 5/2).
    """
    if dimension not in (2, 3):
        raise InvalidSettings(f"dimension is {dimension!r}, must be 2 or 3")
    if b is not None and (dimension == 2 or not 0.0 <= b <= 1.0):
        raise InvalidSettings(f"b is {b!r} in {dimension}D, must lie in 0..1 and be used in 3D")
    if not 0.0 < z < math.inf:
        raise InvalidSettings(f"z is {z!r}, must be > 0")
    if not math.isfinite(a):
        raise InvalidSettings(f"a is {a!r}, must be a finite number")
    circle = MohrCircle(z=float(z), a=float(a), dimension=dimension, b=b)
    if -1e-12 * z > circle.G_D:
        raise InvalidSettings(f"a = {a:g} in {dimension}D gives a negative principal value of G")
    return circle


def limit_circles(domain: AccessibleDomain) -> tuple[MohrCircle, MohrCircle]:
    """The loosest and densest isotropic states: points at z_min/(2D) and z_max/(2D).

    They bound G_D from below and G_1 from above [Radjai2012, Fig. 6].
    """
    return mohr(domain.z_min, 0.0, domain.dimension), mohr(domain.z_max, 0.0, domain.dimension)


def critical_circle(domain: AccessibleDomain) -> MohrCircle:
    """Circle of the critical state: from z_min/(2D) to z_max/(2D) [Radjai2012, Fig. 6b]."""
    extension = domain.dimension == 3 and domain.b is None and domain.mode == "extension"
    a = -domain.a_star if extension else domain.a_star
    return mohr(domain.z_star, a, domain.dimension, domain.b)


def tangent_line(domain: AccessibleDomain) -> tuple[float, tuple[float, float]]:
    """The line G_t = tan α · G_n and the point where the critical circle touches it.

    sin α = (z_max − z_min)/(z_max + z_min) [Radjai2012, Fig. 6b].

    Returns:
        (tan α, (G_n, G_t)) [-].
    """
    angle = domain.tangent_angle
    centre = critical_circle(domain).centre
    normal = centre * math.cos(angle) ** 2
    return math.tan(angle), (normal, normal * math.tan(angle))
