"""Loading: which components of the velocity gradient L are rate-driven and which stress-driven.

L > 0 expands. A free component a obeys M dL_a/dt = V (σ_a − σ_a^ext); the others are imposed.
One record describes them all; the named functions fill it for the usual tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidSettings
from granufab.packing import Array
from granufab.simulate.settings import Stage

__all__ = ["Biaxial", "ConstantMean", "Isotropic", "Loading", "SimpleShear", "loading_of_stage"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loading:
    """Imposed rates and free, stress-driven components of the cell.

    Attributes:
        rate: imposed velocity gradient [1/s], shape (D, D); 0 at free components.
        free: stress-driven single components, shape (D, D), bool.
        dilation: whether the uniform dilation is free (then no single component may be).
        stress: external stress on the free components, compression positive [N/m^(D−1)],
            shape (D, D); for the dilation its mean p is used.
        direction: contraction axis that counts as ε_q > 0, unit vector, shape (D,).
        extension: the matching extension axis, unit vector, shape (D,).
    """

    rate: Array
    free: NDArray[np.bool_]
    dilation: bool
    stress: Array
    direction: Array
    extension: Array

    def __post_init__(self) -> None:
        dimension = len(self.rate)
        for name, dtype in (("rate", float), ("free", bool), ("stress", float)):
            value = np.array(getattr(self, name), dtype=dtype, order="C")
            if value.shape != (dimension, dimension):
                raise InvalidSettings(
                    f"loading {name} has shape {value.shape}, expected {(dimension, dimension)}"
                )
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if self.dilation and self.free.any():
            raise InvalidSettings("loading: free dilation excludes single free components")
        if (self.rate[self.free] != 0).any():
            raise InvalidSettings("loading: a component is either rate-driven or stress-driven")

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.rate)

    @property
    def free_count(self) -> int:
        """Number of stress-driven components n_free."""
        return int(self.dilation) + int(self.free.sum())

    @property
    def axisymmetric(self) -> bool:
        """Whether the axes across ``direction`` are driven alike, as always in 2D."""
        if self.dimension == 2:
            return True
        across = np.eye(3) - np.outer(self.direction, self.direction)
        for matrix in (self.rate, self.free.astype(float)):
            lateral = across @ matrix @ across
            rest = (
                matrix
                - lateral
                - np.outer(self.direction, self.direction)
                * (self.direction @ matrix @ self.direction)
            )
            alike = lateral - across * (np.trace(lateral) / 2)
            if np.abs(rest).max() + np.abs(alike).max() > 1e-12 * (1 + np.abs(matrix).max()):
                return False
        return True

    @property
    def deviatoric_rate(self) -> float:
        """Imposed ε̇_q along direction and extension [1/s]."""
        d, e = self.direction, self.extension
        return float(e @ self.rate @ e - d @ self.rate @ d)

    @property
    def nominal_rate(self) -> float:
        """ε̇_q that the loading aims at [1/s]: the imposed one; where the extension is
        stress-driven (biaxial, triaxial), the one without volume change, D/(D−1) of the axial.
        """
        free = self.free.astype(float)
        if self.extension @ free @ self.extension == 1.0:
            return self.deviatoric_rate * self.dimension / (self.dimension - 1)
        return self.deviatoric_rate

    def reversed(self) -> Loading:
        """The same loading with the opposite imposed rates; ε_q keeps its sign convention."""
        return Loading(
            rate=-self.rate,
            free=self.free,
            dilation=self.dilation,
            stress=self.stress,
            direction=self.direction,
            extension=self.extension,
        )


def _axes(axis: int, dimension: int) -> tuple[Array, Array]:
    if not 0 <= axis < dimension:
        raise InvalidSettings(f"loading axis is {axis}, allowed 0..{dimension - 1}")
    return np.eye(dimension)[axis], np.eye(dimension)[(axis + 1) % dimension]


def Isotropic(*, pressure: float = 1.0, dimension: int = 2, diagonals: bool = False) -> Loading:
    """Isotropic stress p; free dilation, or all diagonal components free.

    Args:
        pressure: p [N/m^(D−1)].
        dimension: 2 or 3.
        diagonals: free diagonals (n_free = D) instead of dilation only (n_free = 1).
    """
    direction, extension = _axes(1, dimension)
    return Loading(
        rate=np.zeros((dimension, dimension)),
        free=np.eye(dimension, dtype=bool) & diagonals,
        dilation=not diagonals,
        stress=pressure * np.eye(dimension),
        direction=direction,
        extension=extension,
    )


def ConstantMean(
    *,
    rate: float,
    pressure: float = 1.0,
    axis: int = 1,
    dimension: int = 2,
    b: float | None = None,
) -> Loading:
    """Shear at constant mean stress with imposed ε̇_q: the loading of [Radjai2012, Figs 5, 7, 8].

    L = λ1 + deviator, λ free; contraction along ``axis`` x_1. 2D: ε̇_q = ε̇1 − ε̇2, 3D: ε̇1 − ε̇3.
    In 3D two equal extensions by default (triaxial compression); rate < 0 makes it triaxial
    extension along ``axis``. True triaxial: ``b`` = (ε̇2 − ε̇3)/(ε̇1 − ε̇3), the extension ε̇3
    along the axis after ``axis``; b = 0 compression, 1/2 pure shear, 1 two equal contractions.

    Args:
        rate: ε̇_q [1/s].
        pressure: mean stress that is held [Pa].
        axis: of the contraction, from 0.
        dimension: 2 or 3.
        b: of the strain rate [-], in 3D.
    Raises:
        InvalidSettings: b in 2D or outside 0..1.
    """
    direction, extension = _axes(axis, dimension)
    if b is not None and (dimension == 2 or not 0 <= b <= 1):
        raise InvalidSettings(f"loading b is {b}, allowed 0..1 in 3D")
    gradient = np.eye(dimension) * (rate / dimension)
    gradient[axis, axis] -= rate
    if b is not None:
        gradient += np.eye(dimension) * (rate * b / dimension)
        middle = (axis + 2) % dimension
        gradient[middle, middle] -= rate * b
    return Loading(
        rate=gradient,
        free=np.zeros((dimension, dimension), dtype=bool),
        dilation=True,
        stress=pressure * np.eye(dimension),
        direction=direction,
        extension=extension,
    )


def Biaxial(
    *, axial_rate: float, pressure: float = 1.0, axis: int = 1, dimension: int = 2
) -> Loading:
    """Compression at ``axial_rate`` along ``axis`` with constant stress on the other axes.

    Biaxial in 2D, triaxial in 3D.

    Args:
        axial_rate: > 0 contracts [1/s].
        pressure: stress on the other axes [Pa].
        axis: of the compression, from 0.
        dimension: 2 or 3.
    """
    direction, extension = _axes(axis, dimension)
    gradient = np.zeros((dimension, dimension))
    gradient[axis, axis] = -axial_rate
    free = np.eye(dimension, dtype=bool)
    free[axis, axis] = False
    return Loading(
        rate=gradient,
        free=free,
        dilation=False,
        stress=pressure * np.eye(dimension),
        direction=direction,
        extension=extension,
    )


def SimpleShear(
    *,
    rate: float,
    pressure: float = 1.0,
    axis: int = 1,
    constant_volume: bool = False,
    dimension: int = 2,
) -> Loading:
    """Simple shear L_xy = ``rate`` with gradient along ``axis`` and flow along the axis before it.

    Normal stress σ_yy = ``pressure`` is held, or the volume (``constant_volume``).

    Args:
        rate: L_xy [1/s].
        pressure: normal stress on the plane of shear [Pa].
        axis: of the gradient, from 0.
        constant_volume: hold the cell's height instead of the stress.
        dimension: 2 or 3.
    """
    _axes(axis, dimension)
    flow = (axis - 1) % dimension
    gradient = np.zeros((dimension, dimension))
    gradient[flow, axis] = rate
    free = np.zeros((dimension, dimension), dtype=bool)
    free[axis, axis] = not constant_volume
    unit = np.eye(dimension)
    return Loading(
        rate=gradient,
        free=free,
        dilation=False,
        stress=pressure * np.eye(dimension),
        direction=(unit[axis] - unit[flow]) / np.sqrt(2),
        extension=(unit[axis] + unit[flow]) / np.sqrt(2),
    )


def loading_of_stage(
    stage: Stage, *, dimension: int, pressure: float, rate: float, forward: bool = True
) -> Loading:
    """The loading that a stage of a case describes, at deviatoric rate ``rate`` [1/s].

    In biaxial and triaxial compression the axial rate is (D−1)/D of ``rate``, so that without
    volume change ε̇_q equals ``rate``.
    """
    signed = rate if forward else -rate
    if stage.loading == "isotropic":
        return Isotropic(pressure=pressure, dimension=dimension)
    if stage.loading == "constant-mean":
        return ConstantMean(
            rate=signed, pressure=pressure, axis=stage.axis, dimension=dimension, b=stage.b
        )
    if stage.loading in ("biaxial", "triaxial"):
        axial = signed * (dimension - 1) / dimension
        return Biaxial(axial_rate=axial, pressure=pressure, axis=stage.axis, dimension=dimension)
    return SimpleShear(
        rate=signed,
        pressure=pressure,
        axis=stage.axis,
        constant_volume=stage.loading == "simple-shear-volume",
        dimension=dimension,
    )
