"""Contact orientations on the whole sphere: spherical harmonics of all m, and equal-area cells.

No axis is needed. The power of each order does not change under rotation; the part of it that a
finite number of contacts adds is known exactly and taken off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.variables import describe
from granufab.packing import Array, Contacts, IntArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["real_harmonics", "sphere_density", "sphere_orientation"]

_HIGHEST = 20


def real_harmonics(direction: Array, order: int) -> Array:
    r"""Real spherical harmonics of one order, normalised to :math:`\int Y_{lm}^2 d\Omega = 4\pi`.

    With this norm :math:`\sum_m Y_{lm}^2 = 2l+1` in every direction.

    Args:
        direction: unit vectors [-], shape (..., 3); the polar axis is z.
        order: l ≥ 0.
    Returns:
        m = −l…l (sines for m < 0), shape (..., 2l + 1).
    """
    direction = np.asarray(direction, dtype=np.float64)
    cosine = np.clip(direction[..., 2], -1.0, 1.0)
    azimuth = np.arctan2(direction[..., 1], direction[..., 0])
    columns = [np.zeros(0)] * (2 * order + 1)
    for m in range(order + 1):
        ratio = math.factorial(order - m) / math.factorial(order + m)
        scale = math.sqrt((2 * order + 1) * ratio * (1 if m == 0 else 2))
        value = scale * scipy.special.lpmv(m, order, cosine)
        columns[order - m] = value * np.sin(m * azimuth)
        columns[order + m] = value * np.cos(m * azimuth)
    return np.stack(columns, axis=-1)


def sphere_orientation(
    contacts: Contacts,
    *,
    z: float,
    orders: Sequence[int] = (2, 4, 6),
    rings: int = 6,
    criterion: str = "",
) -> xr.Dataset:
    r"""Orientations of 3D contacts per grain without an axis, E = (z/2) P_n on the sphere.

    Harmonics: :math:`P_n = \frac1{2\pi}\{1+\sum_{lm} c_{lm} Y_{lm}(n)\}` with
    :math:`c_{lm} = \langle Y_{lm}\rangle` (:func:`real_harmonics`). The power
    :math:`S_l = \sum_m c_{lm}^2` is the same in every frame of reference: S_2 = (15/2) F′:F′ with
    F′ the deviator of the fabric tensor, 4a²/5 in an axisymmetric state; A_l²/(2l + 1) with the
    A_l of :func:`~granufab.fabric.orientation` where the fabric is axisymmetric. N independent
    contacts add (2l + 1 − S_l)/N on average, so
    :math:`\hat S_l = [N S_l - (2l+1)]/(N-1)` is free of that bias (it may be negative).
    Its error is on the safe side, up to a quarter too large, where there is no power.

    Cells: 3 ``rings``\ ² of one area on the hemisphere z ≥ 0, n and −n being one direction.

    Args:
        contacts: those that z counts (:func:`~granufab.fabric.select_network`), in 3D.
        z: coordination number in use [-].
        orders: even l ≥ 2.
        rings: of cells; ring k holds 3(2k + 1).
        criterion: contact criterion, kept in the attributes.
    Returns:
        Over ``term`` (with coordinates l, m): coefficient, coefficient_error. Over ``l``: power,
        power_noise, power_corrected, power_error. Over ``cell``: direction (cell, axis), count,
        E, E_error. Scalars share_above_2 and share_above_2_corrected (noise taken off and no
        power below 0): the power above order 2 over the whole.
    Raises:
        MissingData: fewer than 2 contacts, or contacts in 2D.
        InvalidSettings: an order that is odd or out of 2..20, or no ring.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    _check(contacts, orders, rings)
    values = {order: real_harmonics(contacts.normal, order) for order in sorted(set(orders))}
    data = _terms(values) | _powers(values) | _cells(contacts.normal, z, rings)
    data |= _shares(data["power"][1], data["power_corrected"][1], np.array(list(values)))
    coordinates = {
        "l": ("l", np.array(list(values)), describe("order of the harmonic")),
        "term_l": ("term", np.concatenate([np.full(2 * o + 1, o) for o in values])),
        "term_m": ("term", np.concatenate([np.arange(-o, o + 1) for o in values])),
        "axis": ("axis", list("xyz")),
    }
    text = "contacts taken as independent; neighbours of a grain repel, so the true error is less"
    attributes = {"z": z, "contact_count": contacts.count, "rings": rings}
    return xr.Dataset(
        data, coords=coordinates, attrs=attributes | {"criterion": criterion, "error_bars": text}
    )


def sphere_density(
    sphere: xr.Dataset, direction: Array, *, orders: Sequence[int] | None = None
) -> Array:
    r"""E(n) of the harmonics, :math:`E = \frac{z}{4\pi}\{1+\sum_{lm} c_{lm} Y_{lm}(n)\}` [1/sr].

    Args:
        sphere: result of :func:`sphere_orientation`.
        direction: unit vectors [-], shape (..., 3).
        orders: of the sum; default all that ``sphere`` holds.
    Returns:
        Shape (...); it can dip below 0 where the contacts are rare.
    Raises:
        InvalidSettings: an order that ``sphere`` does not hold.
    """
    direction = np.asarray(direction, dtype=np.float64)
    total = np.ones(direction.shape[:-1])
    held = sphere["l"].to_numpy().tolist()
    for order in held if orders is None else orders:
        if order not in held:
            raise InvalidSettings(f"order l = {order} is not in these harmonics; they hold {held}")
        own = sphere["coefficient"].to_numpy()[sphere["term_l"].to_numpy() == order]
        total = total + real_harmonics(direction, order) @ own
    return float(sphere.attrs["z"]) / (4.0 * math.pi) * total


def _check(contacts: Contacts, orders: Sequence[int], rings: int) -> None:
    if contacts.dimension != 3:
        raise MissingData("spherical harmonics need 3D contacts; use orientation in 2D")
    if contacts.count < 2:
        raise MissingData(f"spherical harmonics need at least 2 contacts, got {contacts.count}")
    wrong = [order for order in orders if order % 2 or not 2 <= order <= _HIGHEST]
    if wrong or not len(orders):
        raise InvalidSettings(f"orders are {list(orders)}, must be even numbers of 2..{_HIGHEST}")
    if rings < 1:
        raise InvalidSettings(f"rings is {rings}, must be >= 1")


def _terms(values: dict[int, Array]) -> dict:
    columns = np.concatenate(list(values.values()), axis=1)
    error = columns.std(axis=0) / math.sqrt(len(columns))
    return {
        "coefficient": ("term", columns.mean(axis=0), describe("c_lm of 1 + Σ c_lm Y_lm")),
        "coefficient_error": ("term", error, describe("standard error of c_lm")),
    }


def _powers(values: dict[int, Array]) -> dict:
    power, noise, corrected, error = [], [], [], []
    for order, value in values.items():
        count, mean = len(value), value.mean(axis=0)
        raw = float(mean @ mean)
        known = (count * raw - (2 * order + 1)) / (count - 1)
        covariance = np.cov(value, rowvar=False, bias=True)
        # Variance of the mean of n_i, n_j over pairs: from pairs alone, and from each contact
        # against the mean, whose own noise adds twice the first part.
        pairs = 2.0 * float((covariance**2).sum()) / count**2
        singles = 4.0 * float(mean @ covariance @ mean) / count - 2.0 * pairs
        power.append(raw)
        noise.append(raw - known)
        corrected.append(known)
        error.append(math.sqrt(pairs + max(singles, 0.0)))
    return {
        "power": ("l", np.array(power), describe("rotation-invariant power S_l = Σ_m c_lm²")),
        "power_noise": ("l", np.array(noise), describe("part of S_l expected of the noise alone")),
        "power_corrected": ("l", np.array(corrected), describe("S_l without its noise")),
        "power_error": ("l", np.array(error), describe("standard error of the corrected S_l")),
    }


def _shares(power: Array, corrected: Array, orders: IntArray) -> dict:
    def share(values: Array) -> float:
        total = float(values.sum())
        return float(values[orders > 2].sum()) / total if total > 0 else 0.0

    text = "power above order 2 over that of all orders"
    return {
        "share_above_2": ((), share(power), describe(text)),
        "share_above_2_corrected": (
            (),
            share(np.maximum(corrected, 0.0)),
            describe(f"{text}, expected noise taken off"),
        ),
    }


def _cells(normal: Array, z: float, rings: int) -> dict:
    """Contacts per cell of one area; ring k reaches down to cos θ = 1 − ((k + 1)/rings)²."""
    turned = np.where(normal[:, 2:] < 0.0, -normal, normal)
    depth = np.sqrt(np.clip(1.0 - turned[:, 2], 0.0, 1.0))
    ring = np.minimum((depth * rings).astype(np.int64), rings - 1)
    share = np.mod(np.arctan2(turned[:, 1], turned[:, 0]) / (2.0 * math.pi), 1.0)
    sector = np.minimum((share * 3 * (2 * ring + 1)).astype(np.int64), 3 * (2 * ring + 1) - 1)
    # The rings before ring k hold 3k² cells.
    count = np.bincount(3 * ring**2 + sector, minlength=3 * rings**2)
    scale = 0.5 * z * len(count) / (len(normal) * 2.0 * math.pi)
    spread = np.sqrt(np.maximum(count * (1.0 - count / len(normal)), 1.0))
    return {
        "direction": (("cell", "axis"), _cell_directions(rings), describe("middle of the cell")),
        "count": ("cell", count, describe("contacts in the cell")),
        "E": ("cell", scale * count, describe("contacts per grain and direction", "1/sr")),
        "E_error": ("cell", scale * spread, describe("standard error of E", "1/sr")),
    }


def _cell_directions(rings: int) -> Array:
    """Direction at the middle height and azimuth of each cell, shape (3 rings², 3)."""
    ring = np.repeat(np.arange(rings), 3 * (2 * np.arange(rings) + 1))
    sector = np.arange(len(ring)) - 3 * ring**2
    cosine = 1.0 - (ring**2 + (ring + 1) ** 2) / (2.0 * rings**2)
    azimuth = 2.0 * math.pi * (sector + 0.5) / (3 * (2 * ring + 1))
    sine = np.sqrt(1.0 - cosine**2)
    return np.column_stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])
