"""Strain on a coarse grid between two states, to tell homogeneous shear from shear bands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from granufab.errors import InvalidPacking, InvalidSettings, MissingData
from granufab.fabric.neighbours import cell_fractions, wrap
from granufab.packing import Array, Packing, require

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["homogeneity", "local_strain"]

_GRAINS_PER_CELL = 25


def local_strain(before: Packing, after: Packing, *, cells: int | None = None) -> xr.Dataset:
    r"""Local strain between two states, by least squares in each box of a coarse grid.

    In each box the displacements u of its grains are fitted by u_0 + H·(x − x_0); the local
    strain is −(H + Hᵀ)/2, compression positive, and the local deviatoric strain its component
    along the mean strain, :math:`\varepsilon_q^{loc} = \varepsilon_q\,(ε^{loc}:\bar ε')/(\bar
    ε':\bar ε')`, so that its mean is the mean ε_q. Displacements are taken to the
    image nearest to the affine motion: positions may be wrapped or not, the cell remapped.

    Args:
        before: first state, with a cell.
        after: second state, the same grains; a strain below about 0.3 between the two.
        cells: boxes along each axis; default such that a box holds about 25 grains.
    Returns:
        Over ``box``: count, eps_q, eps_q_error (standard error from the scatter of its own
        grains), strain (box, i, j), centre (box, i) in fractions of the cell. Boxes with fewer
        than 2(D + 1) grains are left out.
    Raises:
        InvalidPacking: the two states hold different grains.
        MissingData: no cell, or too few grains for a single box.
        InvalidSettings: ``cells`` is below 1.
    """
    dimension = before.dimension
    place, fraction, displacement = _displacements(before, after)
    side = cells
    if side is None:
        side = max(1, int((len(place) / _GRAINS_PER_CELL) ** (1.0 / dimension)))
    if side < 1:
        raise InvalidSettings(f"cells must be at least 1, got {cells}")
    index = np.clip((fraction * side).astype(np.int64), 0, side - 1)
    box = index @ (side ** np.arange(dimension))
    fits = []
    for number in range(side**dimension):
        inside = np.flatnonzero(box == number)
        if len(inside) >= 2 * (dimension + 1):
            gradient, covariance = _fit(place[inside], displacement[inside])
            fits.append((len(inside), fraction[inside].mean(axis=0), gradient, covariance))
    if not fits:
        raise MissingData(f"no box holds {2 * (dimension + 1)} grains; use fewer cells")
    return _strain_dataset(fits, side)


def homogeneity(strain: xr.Dataset | tuple[Packing, Packing]) -> Mapping[str, float]:
    """How far the local deviatoric strain varies over the cell.

    A band that takes a share s of the cell and all of the strain has a relative variance
    1/s − 1; a homogeneous sample only what the scatter of the grains explains.

    Args:
        strain: result of :func:`local_strain`, or the two states.
    Returns:
        ``relative_variance`` = var(ε_q)/<ε_q>² over the boxes; ``expected``, the part explained
        by the scatter of grains taken as independent; ``excess``, the difference; ``localised``,
        1.0 where the excess is above 1 (a band of less than half of the cell), else 0.0.
    Raises:
        MissingData: there is one box only, or no strain between the states.
    """
    import xarray as xr  # slow to import: only where a Dataset is made

    data = strain if isinstance(strain, xr.Dataset) else local_strain(*strain)
    local, error = data["eps_q"].to_numpy(), data["eps_q_error"].to_numpy()
    if len(local) < 2:
        raise MissingData("homogeneity needs at least 2 boxes; use more cells or grains")
    square = float(local.mean()) ** 2
    if not square > 0:
        raise MissingData("there is no deviatoric strain between the two states")
    variance = float(local.var(ddof=1)) / square
    expected = float(np.mean(error**2)) / square
    excess = variance - expected
    return {
        "relative_variance": variance,
        "expected": expected,
        "excess": excess,
        "localised": float(excess > 1.0),
    }


def _displacements(before: Packing, after: Packing) -> tuple[Array, Array, Array]:
    """Wrapped positions, their fractions of the cell, displacements up to a constant."""
    first = require(before.cell, "cell lengths", "give the cell of the packing")
    second = require(after.cell, "cell lengths", "give the cell of the packing")
    old, new = (require(state.grains.number, "grain numbers") for state in (before, after))
    if not np.array_equal(old, new):
        raise InvalidPacking("the two states hold different grains, so nothing can be compared")
    place = wrap(before.grains.position, first)[0]
    # A sheared cell may have been remapped: its lattice vectors are then integer combinations
    # of the deformed ones; rounding recovers them while the strain is well below a half.
    deformed = second.matrix @ np.rint(np.linalg.solve(second.matrix, first.matrix))
    fraction = cell_fractions(place, first)
    affine = fraction @ deformed.T
    other = after.grains.position - affine
    other = other - other[0]
    turns = np.rint(np.linalg.solve(deformed, other.T).T) * np.array(first.periodic)
    return place, fraction, affine + other - turns @ deformed.T - place


def _fit(place: Array, displacement: Array) -> tuple[Array, Array]:
    """Gradient H[i, j] = ∂u_i/∂x_j, and the covariance of its entries (D, D, D, D)."""
    centred = place - place.mean(axis=0)
    inverse = np.linalg.pinv(centred.T @ centred)
    gradient = (inverse @ centred.T @ (displacement - displacement.mean(axis=0))).T
    residual = displacement - displacement.mean(axis=0) - centred @ gradient.T
    free = len(place) - place.shape[1] - 1
    noise = residual.T @ residual / free
    return gradient, np.einsum("ik,jl->ijkl", noise, inverse)


def _strain_dataset(fits: list, side: int) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    count = np.array([fit[0] for fit in fits])
    centre = np.array([fit[1] for fit in fits])
    strain = np.array([-0.5 * (fit[2] + fit[2].T) for fit in fits])
    mean = strain.mean(axis=0)
    values = np.linalg.eigvalsh(mean)
    eps_q = float(values[-1] - values[0])
    deviator = mean - np.trace(mean) / len(mean) * np.eye(len(mean))
    square = float(np.sum(deviator**2))
    along = eps_q * deviator / square if square > 0 else np.zeros_like(deviator)
    local = np.einsum("bij,ij->b", strain, along)
    # ε = −sym H and the projector is symmetric, so var(ε:A) = A_ij A_kl cov(H_ij, H_kl).
    covariance = np.array([fit[3] for fit in fits])
    error = np.sqrt(np.einsum("ij,kl,bijkl->b", along, along, covariance))
    text = {"units": "-"}
    return xr.Dataset(
        {
            "count": ("box", count, text | {"long_name": "grains in the box"}),
            "eps_q": ("box", local, text | {"long_name": "local deviatoric strain"}),
            "eps_q_error": ("box", error, text | {"long_name": "standard error of eps_q"}),
            "strain": (("box", "i", "j"), strain, text | {"long_name": "local strain"}),
            "centre": (("box", "i"), centre, text | {"long_name": "centre in the cell"}),
        },
        attrs={"cells": side, "eps_q": eps_q},
    )
