"""Mean of a contact quantity by direction: bins over half of all directions, and harmonics.

Angles: in 2D θ runs from the x axis over [0, π); in 3D it is the polar angle from the axis over
[0, π/2], in bins of equal solid angle. ψ is the angle from the axis in both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidSettings, MissingData
from granufab.packing import Array, IntArray

__all__ = [
    "Directions",
    "binned_mean",
    "directions",
    "even_columns",
    "odd_columns",
    "solve_harmonics",
    "usable_columns",
]

_MODES = (2, 4, 6)
_WORST_CONDITION = 1e6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Directions:
    """Directions of vectors relative to an axis.

    Attributes:
        offset: angle ψ from the axis, turned counter-clockwise in 2D, over a full or half turn
            [rad], shape (count,).
        index: bin of each vector, shape (count,).
        theta: bin centres [rad], shape (bins,).
        width: size of each bin [rad in 2D, sr in 3D].
        tangent: unit vector along which θ grows, shape (count, D); zero on the axis in 3D.
    """

    offset: Array
    index: IntArray
    theta: Array
    width: float
    tangent: Array


def directions(vector: Array, axis: Array, bins: int) -> Directions:
    """Angles, bins and tangents e_θ of vectors of any length; v and −v share a bin.

    Args:
        vector: non-zero, shape (count, D).
        axis: unit vector, shape (D,).
        bins: number of bins over half of all directions.
    Raises:
        InvalidSettings: fewer than 3 bins.
    """
    if bins < 3:
        raise InvalidSettings(f"directions need at least 3 bins, got {bins}")
    unit = vector / np.linalg.norm(vector, axis=1)[:, None]
    if unit.shape[1] == 2:
        angle = np.arctan2(unit[:, 1], unit[:, 0])
        width = math.pi / bins
        index = np.minimum((np.mod(angle, math.pi) / width).astype(np.int64), bins - 1)
        return Directions(
            offset=angle - math.atan2(axis[1], axis[0]),
            index=index,
            theta=(np.arange(bins, dtype=np.float64) + 0.5) * width,
            width=width,
            tangent=np.column_stack([-unit[:, 1], unit[:, 0]]),
        )
    cosine = np.clip(unit @ axis, -1.0, 1.0)
    index = np.minimum(((1.0 - np.abs(cosine)) * bins).astype(np.int64), bins - 1)
    # e_θ = (cos θ n − d)/sin θ.
    away = cosine[:, None] * unit - axis
    sine = np.linalg.norm(away, axis=1)[:, None]
    return Directions(
        offset=np.arccos(cosine),
        index=index,
        theta=np.asarray(np.arccos(1.0 - (np.arange(bins) + 0.5) / bins), dtype=np.float64),
        width=2.0 * math.pi / bins,
        tangent=np.divide(away, sine, out=np.zeros_like(away), where=sine > 1e-12),
    )


def binned_mean(index: IntArray, value: Array, bins: int) -> tuple[Array, Array]:
    """Mean of a value in each bin and its standard error; NaN in an empty bin.

    Args:
        index: bin of each value, shape (count,).
        value: shape (count,).
        bins: number of bins.
    """
    count = np.bincount(index, minlength=bins)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, value, minlength=bins) / count
        square = np.bincount(index, (value - mean[index]) ** 2, minlength=bins)
        error = np.sqrt(square / (count - 1) / count)
    return mean, error


def even_columns(offset: Array, dimension: int) -> Array:
    """Harmonics of a quantity that is the same for n and −n, by rising order.

    2D: 1, cos 2ψ, sin 2ψ, … cos 6ψ, sin 6ψ. 3D, about the axis: 1, 3cos²ψ − 1, P_4, P_6.

    Returns:
        Shape (count, 7) in 2D, (count, 4) in 3D.
    """
    columns = [np.ones_like(offset)]
    for mode in _MODES:
        if dimension == 2:
            columns += [np.cos(mode * offset), np.sin(mode * offset)]
        else:
            columns.append(
                (2.0 if mode == 2 else 1.0) * scipy.special.eval_legendre(mode, np.cos(offset))
            )
    return np.column_stack(columns)


def odd_columns(offset: Array, dimension: int) -> Array:
    """Harmonics of a component along e_θ, by rising order.

    2D: sin 2ψ, 1, cos 2ψ, sin 4ψ, cos 4ψ, … 3D, about the axis: −∂P_l/∂ψ for l = 2, 4, 6,
    the first scaled to sin 2ψ.

    Returns:
        Shape (count, 7) in 2D, (count, 3) in 3D.
    """
    if dimension == 2:
        columns = [np.sin(2 * offset), np.ones_like(offset), np.cos(2 * offset)]
        for mode in _MODES[1:]:
            columns += [np.sin(mode * offset), np.cos(mode * offset)]
        return np.column_stack(columns)
    cosine, sine = np.cos(offset), np.sin(offset)
    columns = [np.sin(2 * offset)]
    for mode in _MODES[1:]:
        # (1 − c²) P_l' = l (P_{l−1} − c P_l).
        slope = mode * (
            scipy.special.eval_legendre(mode - 1, cosine)
            - cosine * scipy.special.eval_legendre(mode, cosine)
        )
        columns.append(np.divide(slope, sine, out=np.zeros_like(sine), where=sine > 1e-12))
    return np.column_stack(columns)


def usable_columns(square: Array, fewest: int) -> int:
    """How many leading harmonics the directions at hand tell apart.

    Contacts of a lattice point in a few directions only, where high harmonics repeat low ones.

    Args:
        square: Xᵀ X of the columns, shape (columns, columns).
        fewest: number of columns that are needed.
    Raises:
        MissingData: not even these can be told apart.
    """
    for count in range(len(square), fewest - 1, -1):
        values = np.linalg.eigvalsh(square[:count, :count])
        if values[0] * _WORST_CONDITION > values[-1]:
            return count
    raise MissingData("the contacts point in too few directions for a harmonic of order 2")


def solve_harmonics(square: Array, product: Array) -> Array:
    """Least-squares coefficients β of Xβ ≈ y from Xᵀ X and Xᵀ y, for stacks of them.

    Args:
        square: shape (…, columns, columns).
        product: shape (…, columns).
    Returns:
        Shape (…, columns).
    """
    return np.einsum("...ij,...j->...i", np.linalg.pinv(square, hermitian=True), product)
