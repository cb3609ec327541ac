"""Multicontact texture: how many contacts a grain has and what angles they leave each other.

Source: Troadec, Radjai, Roux & Charmet, Phys. Rev. E 66, 041305 (2002); [Radjai2012], eq. 17.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion, select_contacts
from granufab.fabric.ensemble import ContactSample, States, pool_contacts
from granufab.fabric.environment import opening_angle
from granufab.fabric.rattlers import contact_number
from granufab.fabric.tensors import anisotropy, fabric_tensor, major_angle, signed_anisotropy
from granufab.fabric.variables import describe
from granufab.packing import Array, IntArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["texture"]


def texture(
    states: States,
    *,
    bins: int = 60,
    windows: int = 36,
    quantile: float = 0.01,
    delta_theta: float | None = None,
    axis: Array | None = None,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    reach: float | None = None,
) -> xr.Dataset:
    r"""Connectivity of the grains, angles between their contacts, and the exclusion these show.

    Angles are between neighbouring contacts of one grain: successive ones going round it in 2D
    (they sum to 2π), each contact and the one nearest to it in 3D. The exclusion angle δθ is the
    ``quantile`` of these: a few smaller ones, where two small grains touch a large one, do not
    decide. Geometry gives the second value: neighbours j, k of i that touch it are
    :math:`\cos\delta\theta=(\ell_{ij}^2+\ell_{ik}^2-\ell_{jk}^2)/2\ell_{ij}\ell_{ik}` apart
    at least, with ℓ sums of radii; its mean runs over triplets of radii drawn from the grains.
    The occupation of a window is the mean number of a grain's contacts in it, :math:`\int E`
    over δθ around θ_0 (eq. 17), in 3D over the cap of half angle δθ/2; above 1 excluded volume
    would be violated on the average.

    Args:
        states: a packing, a frame, or several.
        bins: of the angles, over 0..2π in 2D and 0..π in 3D.
        windows: window centres over half of all directions.
        quantile: of the angles, that δθ is.
        delta_theta: width of the windows [rad], 0 < δθ < π; default the quantile.
        axis: of the polar angle in 3D, shape (D,).
        criterion: contact criterion.
        z_definition: whose contacts and grains the angles and the occupation use.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
    Returns:
        Over ``contact_number`` c: fraction (of all grains, contacts of the criterion),
        fraction_backbone (grains and contacts in use), each with ``_error``. Over ``angle``
        [rad]: P_angle, P_angle_error [1/rad], and in 3D P_pair, of all pairs of contacts of a
        grain. Over ``theta`` (window centres [rad]): occupation, occupation_error. Scalars:
        delta_theta (the quantile), delta_theta_error, delta_theta_geometric,
        delta_theta_geometric_min (worst triplet of the sizes), smallest_angle,
        smallest_excess (of an angle over its own three grains' δθ; ≥ 0 but for overlaps) [rad],
        z, a (in 3D along the axis), theta_c (2D) [degree], z_steric (2π/δθ in 2D,
        2/(1 − cos δθ/2) in 3D), steric_margin (1 − worst occupation).
    Raises:
        MissingData: no contacts, or no grain with two.
        InvalidSettings: bins, quantile or δθ out of range; an unknown criterion or definition.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    if bins < 3 or windows < 3:
        raise InvalidSettings(f"texture needs at least 3 bins and windows, got {bins}, {windows}")
    if not 0.0 <= quantile < 1.0:
        raise InvalidSettings(f"quantile is {quantile!r}, must lie in 0..1")
    sample = pool_contacts(
        states,
        criterion=criterion,
        z_definition=z_definition,
        minimum=minimum,
        reach=reach,
        axis=axis,
    )
    angle, excess, pairs = _angles(sample)
    if not len(angle):
        raise MissingData("no grain has two contacts, so there are no angles between them")
    measured = float(np.quantile(angle, quantile))
    width = measured if delta_theta is None else delta_theta
    if not 0.0 < width < math.pi:
        raise InvalidSettings(f"delta_theta is {width!r} rad, must lie between 0 and π")
    data, numbers = _connectivity(sample, reach)
    top = 2.0 * math.pi if sample.dimension == 2 else math.pi
    edges = np.linspace(0.0, top, bins + 1)
    data |= _density(angle, edges, "P_angle", "angle to the next contact")
    if sample.dimension == 3:
        data |= _density(pairs, edges, "P_pair", "angle between two contacts of a grain")
    theta, occupation = _occupation(sample, width, windows)
    data |= occupation
    data |= _exclusion(sample, angle, excess, measured, width, quantile)
    worst = float(np.max(occupation["occupation"][1]))
    data["steric_margin"] = ((), 1.0 - worst, describe("room left in the fullest window"))
    plane = sample.dimension == 2
    text = "orientation from the x axis" if plane else "polar angle from the axis"
    middle = 0.5 * (edges[1:] + edges[:-1])
    coordinates = {
        "contact_number": ("contact_number", numbers, describe("contacts of a grain")),
        "angle": ("angle", middle, describe("angle between contacts", "rad")),
        "theta": ("theta", theta, describe(text, "rad")),
    }
    definitions = {"quantile": quantile, "window": width}
    return xr.Dataset(data, coordinates, sample.attributes | definitions)


def _connectivity(sample: ContactSample, reach: float | None) -> tuple[dict, IntArray]:
    everything, counted = [], []
    for packing, network in zip(sample.packings, sample.networks, strict=True):
        listed = select_contacts(packing, network.criterion, reach=reach)
        everything.append(contact_number(listed.pair, packing.grains.count))
        inside = contact_number(network.contacts.pair, packing.grains.count)
        counted.append(inside[network.counted])
    most = int(max(max(part.max(initial=0) for part in rows) for rows in (everything, counted)))
    data = {}
    texts = ("of all grains", "of the grains in use")
    for name, rows, text in zip(
        ("fraction", "fraction_backbone"), (everything, counted), texts, strict=True
    ):
        values = np.concatenate(rows)
        share = np.bincount(values, minlength=most + 1) / max(len(values), 1)
        error = np.sqrt(share * (1.0 - share) / max(len(values), 1))
        data[name] = ("contact_number", share, describe(f"fraction {text} with c contacts"))
        data[f"{name}_error"] = ("contact_number", error, describe(f"standard error of {name}"))
    return data, np.arange(most + 1)


def _angles(sample: ContactSample) -> tuple[Array, Array, Array]:
    """Angles between neighbouring contacts, their excess over δθ of the grains, all pairs."""
    rows = []
    for packing, network in zip(sample.packings, sample.networks, strict=True):
        pair, normal = network.contacts.pair, network.contacts.normal
        grain = np.concatenate([pair[:, 0], pair[:, 1]])
        other = np.concatenate([pair[:, 1], pair[:, 0]])
        outward = np.concatenate([normal, -normal])
        find = _successive if packing.dimension == 2 else _nearest
        rows.append(find(grain, other, outward, packing.grains.radius))
    angle, excess, pairs = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    return angle, excess, pairs


def _successive(
    grain: IntArray, other: IntArray, outward: Array, radius: Array
) -> tuple[Array, Array, Array]:
    theta = np.mod(np.arctan2(outward[:, 1], outward[:, 0]), 2.0 * math.pi)
    order = np.lexsort((theta, grain))
    grain, other, theta = grain[order], other[order], theta[order]
    number = np.bincount(grain)
    several = number[grain] >= 2
    grain, other, theta = grain[several], other[several], theta[several]
    after = np.arange(1, len(grain) + 1)
    ends = np.flatnonzero(np.append(grain[1:] != grain[:-1], True)) if len(grain) else after
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(grain) else after
    after[ends] = starts
    turn = theta[after] - theta
    turn[ends] += 2.0 * math.pi
    bound = _exclusion_angle(radius[grain], radius[other], radius[other[after]])
    return turn, turn - bound, np.zeros(0)


def _nearest(
    grain: IntArray, other: IntArray, outward: Array, radius: Array
) -> tuple[Array, Array, Array]:
    order = np.argsort(grain, kind="stable")
    grain, other, outward = grain[order], other[order], outward[order]
    first = np.searchsorted(grain, grain)
    first, second = _pairs_within(grain, first)
    cosine = np.einsum("pi,pi->p", outward[first], outward[second])
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    bound = _exclusion_angle(radius[grain[first]], radius[other[first]], radius[other[second]])
    nearest = np.full(len(grain), np.inf)
    np.minimum.at(nearest, first, angle)
    np.minimum.at(nearest, second, angle)
    return nearest[np.isfinite(nearest)], angle - bound, angle


def _pairs_within(grain: IntArray, start: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs of rows of one grain; rows are sorted by grain, ``start`` is its first row."""
    row = np.arange(len(grain))
    before = row - start
    second = np.repeat(row, before)
    step = np.arange(len(second)) - np.repeat(np.cumsum(before) - before, before)
    return np.repeat(start, before) + step, second


def _exclusion_angle(radius: Array, first: Array, second: Array) -> Array:
    """Smallest angle between two grains that touch a third one [rad]."""
    return opening_angle(radius + first, radius + second, first + second)


def _density(angle: Array, edges: Array, name: str, text: str) -> dict:
    count = np.histogram(angle, edges)[0]
    scale = 1.0 / (max(len(angle), 1) * np.diff(edges))
    error = scale * np.sqrt(np.maximum(count * (1.0 - count / max(len(angle), 1)), 0.0))
    return {
        name: ("angle", scale * count, describe(f"density of the {text}", "1/rad")),
        f"{name}_error": ("angle", error, describe(f"standard error of {name}", "1/rad")),
    }


def _occupation(sample: ContactSample, width: float, windows: int) -> tuple[Array, dict]:
    """Mean number of contacts of a grain within δθ/2 of each window centre."""
    grains = sum(network.grain_count for network in sample.networks)
    if sample.dimension == 2:
        theta = (np.arange(windows) + 0.5) * math.pi / windows
        inside = _ends_in_windows(sample.normal, theta, width)
    else:
        theta = np.arccos(1.0 - (np.arange(windows) + 0.5) / windows)
        inside = _cap_share(sample.normal @ sample.axis, theta, width)
    # n and −n are contacts of the two grains of a pair.
    occupation = inside.sum(axis=0) / grains
    error = np.sqrt((inside**2).sum(axis=0)) / grains
    text = "mean number of contacts of a grain in the window"
    return theta, {
        "occupation": ("theta", occupation, describe(text)),
        "occupation_error": ("theta", error, describe(f"standard error of the {text}")),
    }


def _ends_in_windows(normal: Array, theta: Array, width: float) -> Array:
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    inside = np.zeros((len(normal), len(theta)))
    for turn in (0.0, math.pi):
        away = np.mod(angle[:, None] + turn - theta + math.pi, 2.0 * math.pi) - math.pi
        # A contact on the edge of a window belongs to half of it.
        distance = np.abs(away) - 0.5 * width
        inside += np.where(np.abs(distance) < 1e-9, 0.5, distance < 0.0)
    return inside


def _cap_share(cosine: Array, theta: Array, width: float) -> Array:
    """Share of azimuths at which ±n lies in the cap around each polar angle."""
    share = np.zeros((len(cosine), len(theta)))
    for height in (cosine, -cosine):
        sine = np.sqrt(np.maximum(1.0 - height**2, 0.0))
        across = sine[:, None] * np.sin(theta)
        level = math.cos(0.5 * width) - height[:, None] * np.cos(theta)
        bound = np.divide(level, across, out=np.sign(level) * 2.0, where=across > 1e-12)
        share += np.arccos(np.clip(bound, -1.0, 1.0)) / math.pi
    return share


def _exclusion(
    sample: ContactSample,
    angle: Array,
    excess: Array,
    measured: float,
    width: float,
    quantile: float,
) -> dict:
    radius = np.concatenate([packing.grains.radius for packing in sample.packings])
    drawn = np.random.default_rng(0).choice(radius, (3, 20000))
    low, high = float(radius.min()), float(radius.max())
    worst = float(_exclusion_angle(*(np.array(r) for r in (high, low, low))))
    weights = [network.grain_count for network in sample.networks]
    z = float(np.average([network.z for network in sample.networks], weights=weights))
    plane = sample.dimension == 2
    fabric = fabric_tensor(sample.normal)
    a = anisotropy(fabric) if plane else signed_anisotropy(fabric, sample.axis)
    steric = 2.0 * math.pi / width if plane else 2.0 / (1.0 - math.cos(0.5 * width))
    values = {
        "delta_theta": (measured, "effective exclusion angle", "rad"),
        "delta_theta_error": (_quantile_error(angle, quantile), "its standard error", "rad"),
        "delta_theta_geometric": (
            float(_exclusion_angle(*drawn).mean()),
            "mean exclusion angle of random triplets of sizes",
            "rad",
        ),
        "delta_theta_geometric_min": (worst, "exclusion angle of the worst triplet", "rad"),
        "smallest_angle": (float(angle.min()), "smallest angle between contacts", "rad"),
        "smallest_excess": (float(excess.min()), "smallest angle beyond its own bound", "rad"),
        "z": (z, "coordination number in use", "-"),
        "a": (a, "fabric anisotropy, in 3D along the axis", "-"),
        "z_steric": (steric, "coordination number that fills every window", "-"),
    }
    if plane:
        values["theta_c"] = (major_angle(fabric), "major direction of the fabric", "degree")
    return {name: ((), value, describe(text, unit)) for name, (value, text, unit) in values.items()}


def _quantile_error(angle: Array, quantile: float) -> float:
    """Half the spread of the order statistics one standard error around the quantile."""
    step = math.sqrt(quantile * (1.0 - quantile) / len(angle))
    low, high = np.quantile(angle, [max(quantile - step, 0.0), min(quantile + step, 1.0)])
    return 0.5 * float(high - low)
