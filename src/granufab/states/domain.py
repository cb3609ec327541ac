"""The accessible states in the (z, a) plane and the critical state at their apex.

One pair of slopes carries every case. With s_loss and s_gain the slopes of the two limits in
(z, a·z), the limits are a = s_loss (1 − z_min/z) and a = s_gain (z_max/z − 1):

=====================  ===============  ===============
loading                s_loss           s_gain
=====================  ===============  ===============
2D                     2                2
3D compression (b=0)   5/2              5/4
3D extension (b=1)     5/4              5/2
3D, general b          (5/2)/(1 + b)    (5/2)/(2 − b)
=====================  ===============  ===============
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granufab.errors import InvalidSettings
from granufab.packing import Array

__all__ = ["AccessibleDomain", "Mode", "saturation_slopes"]

Mode = Literal["compression", "extension"]


def saturation_slopes(
    dimension: int = 2, mode: Mode = "compression", b: float | None = None
) -> tuple[float, float]:
    """Slopes (s_loss, s_gain) of the two limits in (z, a·z), both counted positive.

    Args:
        dimension: 2 or 3.
        mode: axisymmetric loading in 3D; without effect in 2D.
        b: (G_2 − G_3)/(G_1 − G_3) in 3D, 0 (compression) to 1 (extension); overrides ``mode``.
    Raises:
        InvalidSettings: an unknown dimension or mode, b outside 0..1, or b in 2D.
    Source: [Radjai2012], eq. 19 and its 3D form; extension and general b go beyond the paper.
    """
    if dimension not in (2, 3):
        raise InvalidSettings(f"dimension is {dimension!r}, must be 2 or 3")
    if mode not in ("compression", "extension"):
        raise InvalidSettings(f"mode is {mode!r}, must be 'compression' or 'extension'")
    if b is not None and dimension == 2:
        raise InvalidSettings(f"b = {b!r} is given in 2D; b exists only in 3D, leave it out")
    if b is not None and not 0.0 <= b <= 1.0:
        raise InvalidSettings(f"b is {b!r}, must lie in 0..1")
    if dimension == 2:
        return 2.0, 2.0
    ratio = float(mode == "extension") if b is None else float(b)
    return 2.5 / (1.0 + ratio), 2.5 / (2.0 - ratio)


@dataclass(frozen=True, slots=True, kw_only=True)
class AccessibleDomain:
    """The states with G_1 ≤ z_max/(2D) and G_D ≥ z_min/(2D) [Radjai2012, eq. 19].

    G is the fabric tensor that counts contacts per grain, tr G = z/2, with principal values
    G_1 ≥ … ≥ G_D. In 2D the anisotropy may carry a sign (a'): only its size matters. In 3D with
    ``b=None`` a negative a' is an extension-like fabric and meets the limits of extension,
    whatever ``mode`` says; ``mode`` gives the meaning of a ≥ 0, so that |a| can be used
    throughout an extension test. With ``b`` given only |a| matters.

    Attributes:
        z_min: coordination number of the loosest isotropic state [-].
        z_max: coordination number of the densest isotropic state [-].
        dimension: 2 or 3.
        mode: "compression" or "extension" (3D).
        b: (G_2 − G_3)/(G_1 − G_3), or None for the axisymmetric ``mode``.
    Raises:
        InvalidSettings: not 0 < z_min < z_max, or see :func:`saturation_slopes`.
    """

    z_min: float
    z_max: float
    dimension: int = 2
    mode: Mode = "compression"
    b: float | None = None

    def __post_init__(self) -> None:
        saturation_slopes(self.dimension, self.mode, self.b)
        low, high = _number(self.z_min, "z_min"), _number(self.z_max, "z_max")
        if not 0.0 < low < high < math.inf:
            raise InvalidSettings(f"z_min = {low:g}, z_max = {high:g}: must obey 0 < z_min < z_max")
        object.__setattr__(self, "z_min", low)
        object.__setattr__(self, "z_max", high)

    @classmethod
    def from_critical(
        cls,
        z_star: float,
        a_star: float,
        dimension: int = 2,
        mode: Mode = "compression",
        b: float | None = None,
    ) -> Self:
        """The domain whose critical state is (z*, \\|a*\\|): eqs. 20–22 solved for the limits.

        z_min = z* (1 − \\|a*\\|/s_loss) and z_max = z* (1 + \\|a*\\|/s_gain).

        Raises:
            InvalidSettings: z* ≤ 0, or \\|a*\\| outside 0 < \\|a*\\| < s_loss.
        """
        loss, gain = saturation_slopes(dimension, mode, b)
        z, a = _number(z_star, "z_star"), abs(_number(a_star, "a_star"))
        if not 0.0 < z < math.inf:
            raise InvalidSettings(f"z_star is {z:g}, must be > 0")
        if not 0.0 < a < loss:
            raise InvalidSettings(f"|a_star| is {a:g}, must lie between 0 and {loss:g} (z_min > 0)")
        return cls(
            z_min=z * (1.0 - a / loss),
            z_max=z * (1.0 + a / gain),
            dimension=dimension,
            mode=mode,
            b=b,
        )

    @property
    def slopes(self) -> tuple[float, float]:
        """(s_loss, s_gain) of the limits in (z, a·z); see :func:`saturation_slopes`."""
        return saturation_slopes(self.dimension, self.mode, self.b)

    @property
    def z_star(self) -> float:
        """Critical z* = (s_loss z_min + s_gain z_max)/(s_loss + s_gain) [Radjai2012, eqs. 21–22].

        2D (z_min + z_max)/2; 3D compression (z_max + 2 z_min)/3; extension (2 z_max + z_min)/3;
        general b [z_max + 2 z_min + b (z_max − z_min)]/3.
        """
        loss, gain = self.slopes
        return (loss * self.z_min + gain * self.z_max) / (loss + gain)

    @property
    def a_star(self) -> float:
        """Critical \\|a*\\|, where loss and gain saturate together [Radjai2012, eqs. 20, 22].

        2D 2(z_max − z_min)/(z_max + z_min); 3D (5/6)(z_max − z_min)/z*.
        """
        loss, _ = self.slopes
        return loss * (1.0 - self.z_min / self.z_star)

    @property
    def tangent_angle(self) -> float:
        """Angle α [rad] of the Mohr-plane line touched by the critical circle.

        sin α = (z_max − z_min)/(z_max + z_min) in any dimension; in 2D sin α = a*/2.
        """
        return math.asin((self.z_max - self.z_min) / (self.z_max + self.z_min))

    def loss_saturation(self, z: ArrayLike) -> Array:
        """Anisotropy where G_D = z_min/(2D): a = s_loss (1 − z_min/z) [-], shape of ``z``."""
        return self.slopes[0] * (1.0 - self.z_min / _coordination(z))

    def gain_saturation(self, z: ArrayLike) -> Array:
        """Anisotropy where G_1 = z_max/(2D): a = s_gain (z_max/z − 1) [-], shape of ``z``.

        The paper's text prints z_min here; the limit follows from z_max.
        """
        return self.slopes[1] * (self.z_max / _coordination(z) - 1.0)

    def a_max(self, z: ArrayLike) -> Array:
        """Largest accessible \\|a\\| at z: the lower of the two limits [Radjai2012, eq. 19].

        Args:
            z: coordination number [-], any shape.
        Returns:
            Shape of ``z``; nan where no state is accessible (z outside z_min..z_max).
        """
        values = _coordination(z)
        limit = np.minimum(self.loss_saturation(values), self.gain_saturation(values))
        return np.where((values >= self.z_min) & (values <= self.z_max), limit, np.nan)

    def loss_line(self, z: ArrayLike) -> Array:
        """Loss saturation in (z, a·z): the straight line s_loss (z − z_min) [-]."""
        return self.slopes[0] * (_coordination(z) - self.z_min)

    def gain_line(self, z: ArrayLike) -> Array:
        """Gain saturation in (z, a·z): the straight line s_gain (z_max − z) [-]."""
        return self.slopes[1] * (self.z_max - _coordination(z))

    def extremes(self, z: ArrayLike, a: ArrayLike) -> tuple[Array, Array]:
        """Extreme principal values as coordination numbers, (2D·G_D, 2D·G_1) [-].

        Each is the z of the isotropic state with that principal value, so a state is accessible
        if z_min ≤ 2D·G_D and 2D·G_1 ≤ z_max: 2D·G_D = z(1 − \\|a\\|/s_loss),
        2D·G_1 = z(1 + \\|a\\|/s_gain).
        """
        values, signed = _coordination(z), np.asarray(a, dtype=np.float64)
        loss, gain = self.slopes
        if self.dimension == 3 and self.b is None:
            turned_loss, turned_gain = saturation_slopes(3, "extension")
            loss = np.where(signed < 0.0, turned_loss, loss)
            gain = np.where(signed < 0.0, turned_gain, gain)
        size = np.abs(signed)
        return values * (1.0 - size / loss), values * (1.0 + size / gain)

    def excess(self, z: ArrayLike, a: ArrayLike) -> Array:
        """How far outside the states lie, in contacts per grain [-]; 0 inside.

        max(z_min − 2D·G_D, 2D·G_1 − z_max, 0): the change of z_min or z_max that would just
        admit the state.
        """
        low, high = self.extremes(z, a)
        return np.maximum(np.maximum(self.z_min - low, high - self.z_max), 0.0)

    def contains(self, z: ArrayLike, a: ArrayLike) -> NDArray[np.bool_]:
        """Whether each state is accessible, edges included (to 1e-12 of z_max)."""
        return self.excess(z, a) <= 1e-12 * self.z_max


def _number(value: object, name: str) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InvalidSettings(f"{name} is {value!r}, must be a number") from None


def _coordination(z: ArrayLike) -> Array:
    values = np.asarray(z, dtype=np.float64)
    if not (values > 0.0).all():
        raise InvalidSettings(f"z holds {np.min(values):g}, must be > 0 everywhere")
    return values
