"""Branch vectors: lengths, mean length by direction, and their joint density.

Source: [Radjai2012, §2]: P_ℓ, <ℓ>(n) and P_ℓn.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from granufab.errors import InvalidSettings
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.directional import (
    binned_mean,
    directions,
    even_columns,
    solve_harmonics,
    usable_columns,
)
from granufab.fabric.ensemble import (
    ContactSample,
    States,
    pool_contacts,
    resample,
    unit_sums,
)
from granufab.fabric.variables import describe
from granufab.packing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["branches"]

_NARROWEST = 1e-6


def branches(
    states: States,
    *,
    bins: int = 18,
    length_bins: int = 40,
    orientation: Literal["normal", "branch"] = "normal",
    axis: Array | None = None,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    reach: float | None = None,
    replicas: int = 200,
) -> xr.Dataset:
    r"""Branch lengths: P_ℓ(ℓ), <ℓ>(n) and the joint density P_ℓn(ℓ, n) [Radjai2012, §2].

    :math:`\langle\ell\rangle(n) = \int\ell P_{\ell n}d\ell/\int P_{\ell n}d\ell` is the mean over
    the contacts of one direction, so that its harmonic a_ℓ in
    :math:`\langle\ell\rangle = \ell_0\{1+a_\ell\cos 2\psi\}` (2D),
    :math:`\ell_0\{1+a_\ell(3\cos^2\psi-1)\}` (3D) does not depend on how many contacts point
    there: it is fitted by least squares together with the orders 4 and 6. ψ is the angle from
    ``axis``.

    Args:
        states: a packing, a frame, or several.
        bins: over half of all directions; equal angles in 2D, equal solid angles about the
            axis in 3D.
        length_bins: of equal width, from the smallest to the largest length.
        orientation: direction of a contact is that of its ``normal`` or of its ``branch``; the
            same for disks and spheres.
        axis: shape (D,); default as for :func:`~granufab.fabric.ensemble.pool_contacts`.
        criterion: contact criterion.
        z_definition: the contacts that this z counts are used.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
        replicas: number of bootstrap draws for the error of a_ℓ.
    Returns:
        Over ``length`` (bin centres [m]): P_length, P_length_error [1/m]. Over ``theta`` (bin
        centres [rad]): count, mean_length, mean_length_error, mean_length_fit [m]. Over both:
        P_joint, normalised over half of all directions [1/(m rad) or 1/(m sr)]. Scalars:
        average_length (over contacts), length_deviation, length_0 (over directions) [m],
        a_l, a_l_error.
    Raises:
        MissingData: no contacts, or they point in too few directions.
        InvalidSettings: too few bins, an unknown orientation, criterion or definition.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    if orientation not in ("normal", "branch"):
        raise InvalidSettings(f"orientation {orientation!r} is unknown; allowed: normal, branch")
    if length_bins < 1:
        raise InvalidSettings(f"length_bins must be at least 1, got {length_bins}")
    sample = pool_contacts(
        states,
        criterion=criterion,
        z_definition=z_definition,
        minimum=minimum,
        reach=reach,
        axis=axis,
    )
    vector = sample.normal if orientation == "normal" else sample.branch
    around = directions(vector, sample.axis, bins)
    length, edges = sample.length, _edges(sample.length, length_bins)
    steps = np.diff(edges)
    joint = np.histogram2d(length, around.index, bins=[edges, np.arange(bins + 1) - 0.5])[0]
    count = joint.sum(axis=1)
    mean, error = binned_mean(around.index, length, bins)
    fitted = _harmonic(sample, around.offset, replicas)
    shape = even_columns(_offset_of(around.theta, sample.axis), sample.dimension)[:, 1]
    fit = fitted["length_0"][1] * (1.0 + fitted["a_l"][1] * shape)
    unit, direction = "m", "rad" if sample.dimension == 2 else "sr"
    spread = np.sqrt(np.maximum(count * (1.0 - count / sample.count), 0.0))
    text = {
        "P_length": describe("density of branch lengths", "1/m"),
        "P_length_error": describe("standard error of P_length", "1/m"),
        "P_joint": describe("joint density of length and direction", f"1/(m {direction})"),
    }
    data = {
        "P_length": ("length", count / sample.count / steps, text["P_length"]),
        "P_length_error": ("length", spread / sample.count / steps, text["P_length_error"]),
        "P_joint": (
            ("length", "theta"),
            joint / sample.count / steps[:, None] / around.width,
            text["P_joint"],
        ),
        "count": ("theta", joint.sum(axis=0).astype(np.int64), describe("contacts in the bin")),
        "mean_length": ("theta", mean, describe("mean branch length by direction", unit)),
        "mean_length_error": ("theta", error, describe("standard error of it", unit)),
        "mean_length_fit": ("theta", fit, describe("second-order fit of it", unit)),
        "average_length": ((), length.mean(), describe("mean branch length", unit)),
        "length_deviation": ((), length.std(), describe("standard deviation of lengths", unit)),
    }
    coordinates = {
        "length": ("length", 0.5 * (edges[1:] + edges[:-1]), describe("branch length", unit)),
        "theta": ("theta", around.theta, describe(_angle_text(sample.dimension), "rad")),
    }
    attributes = sample.attributes | {"orientation": orientation}
    return xr.Dataset(data | fitted, coordinates, attributes)


def _edges(length: Array, bins: int) -> Array:
    low, high = float(length.min()), float(length.max())
    # Equal lengths differ by rounding only: one narrow window stands for their delta.
    half = 0.5 * max(high - low, _NARROWEST * high) * (1.0 + 1e-9)
    return np.linspace(0.5 * (low + high) - half, 0.5 * (low + high) + half, bins + 1)


def _offset_of(theta: Array, axis: Array) -> Array:
    return theta - math.atan2(axis[1], axis[0]) if len(axis) == 2 else theta


def _angle_text(dimension: int) -> str:
    return "orientation from the x axis" if dimension == 2 else "polar angle from the axis"


def _harmonic(sample: ContactSample, offset: Array, replicas: int) -> dict:
    length = sample.length
    columns = even_columns(offset, sample.dimension)
    columns = columns[:, : usable_columns(columns.T @ columns, 2)]
    width = columns.shape[1]

    def statistics(part: slice) -> Array:
        block = columns[part]
        square = np.einsum("ci,cj->cij", block, block).reshape(len(block), -1)
        return np.concatenate([square, block * length[part, None]], axis=1)

    def estimate(sums: Array) -> tuple[Array, Array]:
        square = sums[:, : width * width].reshape(-1, width, width)
        beta = solve_harmonics(square, sums[:, width * width :])
        return beta[:, 0], beta[:, 1] / beta[:, 0]

    sums = unit_sums(sample, statistics)
    mean, a_l = (float(value[0]) for value in estimate(sums.sum(axis=0)[None]))
    error = float(np.std(estimate(resample(sums, replicas))[1])) if replicas else math.nan
    return {
        "length_0": ((), mean, describe("mean of <l> over directions", "m")),
        "a_l": ((), a_l, describe("branch-length anisotropy along the axis")),
        "a_l_error": ((), error, describe("bootstrap standard error of a_l")),
    }
