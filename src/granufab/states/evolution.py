"""Evolution of the fabric tensor with strain: the law, and the strain stages that it walks.

With g = 2D·G (so that tr g = D·z and the accessible states are z_min ≤ g ≤ z_max), the deviator d
of the strain rate (contraction positive), its extreme principal values d_1 > d_D, the deviatoric
rate ε̇_q = d_1 − d_D and M = (d − d_D 1)/ε̇_q, which is 1 on the axis of contraction, 0 on that of
extension and b on the one between:

    ġ = ½{R, T − g} − ½{S, g} + W g − g W,   {X, Y} = XY + YX, W the spin

    R = A_l|d_D| 1 + (A_g d_1 − A_l|d_D|) M                      exchange of contacts
    T = z* 1 + (1 + c w)(T_0 − z* 1),  T_0 = z_min 1 + (z_max − z_min) M,  z* = tr T_0/D
    S = B ε̇_q ⟨z − z*⟩²[1 − (1 − ω) M]                            shedding of surplus contacts
    ẇ = −(tr R/D) w,  w = ⟨z − z*⟩ at the start                   memory of a dense start

R, S, T share the principal axes of d. There the law reads, axis by axis, as the minimal form:
contracting axes gain towards z_max at the rate A_g, extending ones lose towards z_min at A_l; an
off-diagonal component fades at the mean rate of its two axes. ⟨x⟩ is x where x > 0, else 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.states.domain import AccessibleDomain

__all__ = ["EvolutionLaw", "Form", "StrainStage", "fabric_from_state", "proportional_gradient"]

Form = Literal["minimal", "early", "shedding", "memory"]
_NOT_NEGATIVE = ("early", "shedding", "shedding_ratio", "memory")


@dataclass(frozen=True, slots=True, kw_only=True)
class EvolutionLaw:
    """How the fabric tensor follows a strain history; the equations stand in the module's text.

    The last five parameters extend the minimal law; left at their defaults they do nothing.

    Attributes:
        z_min: coordination number of the loosest isotropic state [-].
        z_max: coordination number of the densest isotropic state [-].
        gain_rate: A_g, per unit strain of the contracting axis [-].
        loss_rate: A_l, per unit strain of the extending axis [-].
        dimension: 2 or 3.
        early: κ ≥ 0; R is multiplied by 1 + κ(1 − H:N)/2, N the direction of d, where H starts
            at 0 and forgets its past as Ḣ = ε̇_q(N − H)/s_0: faster exchange at the start and,
            twice as much, after a reversal.
        early_strain: s_0, strain over which that fades [-].
        shedding: B, rate at which contacts beyond z* are lost [-].
        shedding_ratio: ω, share of the contracting axis in that loss, the extending one has 1.
        memory: c, how far a dense start widens the limits, per surplus contact [-].
    Raises:
        InvalidSettings: not 0 < z_min < z_max, or a parameter out of range.
    Source: minimal form, theory of the accessible states [Radjai2012, eq. 19] made a rate; the
        other terms go beyond it.
    """

    z_min: float
    z_max: float
    gain_rate: float
    loss_rate: float
    dimension: int = 2
    early: float = 0.0
    early_strain: float = 0.01
    shedding: float = 0.0
    shedding_ratio: float = 0.0
    memory: float = 0.0

    def __post_init__(self) -> None:
        AccessibleDomain(z_min=self.z_min, z_max=self.z_max, dimension=self.dimension)
        for name in ("gain_rate", "loss_rate", "early_strain"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InvalidSettings(f"{name} is {getattr(self, name)!r}, must be > 0")
        for name in _NOT_NEGATIVE:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InvalidSettings(f"{name} is {getattr(self, name)!r}, must be ≥ 0")

    @property
    def form(self) -> Form:
        """The smallest named form that holds the parameters that are not zero."""
        if self.memory > 0.0:
            return "memory"
        if self.shedding > 0.0:
            return "shedding"
        return "early" if self.early > 0.0 else "minimal"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrainStage:
    """A stretch of strain history.

    Attributes:
        gradient: velocity gradient L (L > 0 expands) [1/s], shape (D, D), or a function of the
            time since the stage began [s] that returns it. Only its deviator and spin count:
            where the volume change is unknown, leave it out.
        times: instants recorded, from 0, increasing [s], shape (record_count,).
    Raises:
        InvalidSettings: shapes that do not fit, times that do not start at 0 or increase.
    """

    gradient: Array | Callable[[float], Array]
    times: Array

    def __post_init__(self) -> None:
        times = np.array(self.times, dtype=np.float64)
        if times.ndim != 1 or len(times) < 2 or times[0] != 0.0 or (np.diff(times) <= 0.0).any():
            raise InvalidSettings("times of a strain stage must start at 0 and increase")
        times.flags.writeable = False
        object.__setattr__(self, "times", times)
        if not callable(self.gradient):
            gradient = np.array(self.gradient, dtype=np.float64)
            if gradient.shape not in ((2, 2), (3, 3)) or not np.isfinite(gradient).all():
                raise InvalidSettings(
                    f"velocity gradient of shape {gradient.shape} must be finite, (2, 2) or (3, 3)"
                )
            gradient.flags.writeable = False
            object.__setattr__(self, "gradient", gradient)

    def at(self, time: float) -> Array:
        """Velocity gradient [1/s] at a time since the stage began, shape (D, D)."""
        return np.asarray(self.gradient(time) if callable(self.gradient) else self.gradient)


def proportional_gradient(
    dimension: int = 2, *, b: float = 0.0, axis: int = 1, rate: float = 1.0
) -> Array:
    """Velocity gradient of straight, isochoric loading with ε̇_q = ``rate``.

    Args:
        dimension: 2 or 3.
        b: (d_2 − d_3)/(d_1 − d_3) of the strain rate in 3D: 0 compression along ``axis``,
            1 extension along the axis after it.
        axis: axis of contraction; the one after it extends (the last one has b where 0 < b < 1).
        rate: ε̇_q [1/s]; < 0 reverses.
    Returns:
        L [1/s], shape (D, D), trace 0.
    Raises:
        InvalidSettings: an unknown dimension or axis, or b outside 0..1.
    """
    if dimension not in (2, 3):
        raise InvalidSettings(f"dimension is {dimension!r}, must be 2 or 3")
    if not 0 <= axis < dimension:
        raise InvalidSettings(f"axis is {axis!r}, allowed 0..{dimension - 1}")
    if not 0.0 <= b <= 1.0 or (dimension == 2 and b):
        raise InvalidSettings(f"b is {b!r}, must lie in 0..1 (3D) or be left out (2D)")
    contraction = np.full(dimension, b)
    contraction[axis], contraction[(axis + 1) % dimension] = 1.0, 0.0
    return -rate * np.diag(contraction - contraction.mean())


def fabric_from_state(z: float, a: float = 0.0, *, direction: ArrayLike = (0.0, 1.0)) -> Array:
    """Fabric tensor G with tr G = z/2 and signed anisotropy a' along ``direction``.

    2D: G = (z/4)(1 + (a'/2)(2dd − 1)). 3D: G = (z/6)(1 + (2a'/5)(3dd − 1)), axisymmetric.

    Args:
        z: coordination number [-].
        a: signed anisotropy a' [-].
        direction: symmetry axis, any length but 0, shape (D,).
    Returns:
        G [-], shape (D, D).
    Raises:
        InvalidSettings: z ≤ 0, or |a'| so large that G has a negative principal value.
    """
    axis = np.asarray(direction, dtype=np.float64)
    dimension, length = len(axis), float(np.linalg.norm(axis))
    if dimension not in (2, 3) or length == 0.0:
        raise InvalidSettings(
            f"direction is {direction!r}, must be a vector of 2 or 3 components, not 0"
        )
    low, high = (-2.0, 2.0) if dimension == 2 else (-1.25, 2.5)
    if not z > 0.0 or not math.isfinite(z):
        raise InvalidSettings(f"z is {z!r}, must be > 0")
    if not low <= a <= high:
        raise InvalidSettings(f"a' is {a!r}, must lie in {low:g}..{high:g} (G ≥ 0)")
    unit = np.outer(axis, axis) / length**2
    factor = a / 2.0 if dimension == 2 else 0.4 * a
    return z / (2.0 * dimension) * (np.eye(dimension) * (1.0 - factor) + factor * dimension * unit)
