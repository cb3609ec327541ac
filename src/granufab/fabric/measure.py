"""Everything of one state as flat named values, and of a whole run as a Dataset."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.bootstrap import bootstrap_errors
from granufab.fabric.coordination import (
    ZDefinition,
    check_definition,
    coordination,
    counted_contacts,
)
from granufab.fabric.criterion import Criterion, force_threshold, mean_diameter, parse_criterion
from granufab.fabric.force_values import FORCE_VALUES
from granufab.fabric.neighbours import branch_vectors, neighbours_within
from granufab.fabric.network import Network, select_network
from granufab.fabric.stress import solid_fraction, stress_ratio, stress_tensor
from granufab.fabric.tensors import (
    anisotropy,
    anisotropy_bias,
    anisotropy_noise,
    deviatoric_part,
    enriched_tensor,
    fabric_tensor,
    intermediate_ratio,
    major_angle,
    major_direction,
    mean_part,
    principal_values,
    signed_anisotropy,
)
from granufab.history import SERIES_UNITS
from granufab.packing import Array, IntArray, Packing

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Value", "measure", "quick_measure", "values_dataset"]

Value = float | str | None

_UNITS: dict[str, tuple[str, str]] = (
    SERIES_UNITS
    | {
        "a_noise": ("-", "standard error of a' if contacts were independent"),
        "a_bias": ("-", "mean unsigned a of an isotropic state, contacts independent"),
        "p_g": ("-", "mean part p_G of the enriched fabric tensor"),
        "q_g": ("-", "deviatoric part q_G of the enriched fabric tensor"),
        "b_g": ("-", "intermediate ratio b_G of the enriched fabric tensor"),
        "contact_count": ("-", "contacts under the criterion"),
        "grain_count": ("-", "grains"),
        "overlap": ("mean diameter", "worst overlap of the state"),
        "stage": ("-", "stage of the path"),
        "z_error": ("-", "bootstrap standard error of the z in use"),
        "a_signed_error": ("-", "bootstrap standard error of a'"),
    }
    | FORCE_VALUES
)
_AXES = "xyz"


def measure(
    packing: Packing,
    *,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    direction: Array | None = None,
    minor: Array | None = None,
    minimum: int = 2,
    reach: float | None = None,
    bootstrap: int = 0,
) -> dict[str, Value]:
    """All fabric and stress values of one state; None where the data do not tell.

    a, θ_c, F and G use the contacts and the number of grains of the z in use.

    Args:
        packing: the state.
        criterion: ``force``, ``gap:δ`` or ``listed``.
        z_definition: ``z``, ``z_backbone`` or ``z_mechanical``.
        direction: axis of the signed anisotropy, shape (D,); without it ``a_signed`` is None.
        minor: its axis of least contraction in true triaxial states, shape (D,).
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
        bootstrap: number of resampled states for ``z_error`` and ``a_signed_error``; 0 for none.
    Returns:
        z, z_backbone, z_mechanical, rattler_fraction, a, a_signed, theta_c (degrees from x in
        2D, from ``direction`` or else z in 3D), a_noise, a_bias, p_g, q_g, g_1…, f_xx…, b_g (3D),
        q_over_p, p, phi, overlap (mean diameters), contact_count, grain_count, dimension,
        criterion, z_definition, and ``missing``: why values are None, in words.
    Raises:
        MissingData: nothing at all can be measured.
        InvalidSettings: an unknown criterion or definition, or a direction of wrong shape.
    """
    rule, definition = parse_criterion(criterion), check_definition(z_definition)
    direction = _check_direction(direction, packing.dimension)
    values = _blank(packing.dimension)
    reasons: list[str] = []

    def attempt(part: Callable[[], Mapping[str, Value]]) -> None:
        try:
            values.update(part())
        except MissingData as error:
            if str(error) not in reasons:
                reasons.append(str(error))

    attempt(
        lambda: _fabric_values(
            select_network(
                packing, criterion=rule, z_definition=definition, minimum=minimum, reach=reach
            ),
            direction,
            minor,
        )
    )
    attempt(lambda: {"phi": solid_fraction(packing)})
    attempt(lambda: _stress_values(packing))
    if all(value is None for value in values.values()):
        raise MissingData("; ".join(reasons))
    values["overlap"] = _overlap(packing)
    if bootstrap:
        attempt(lambda: _errors(packing, rule, definition, direction, minimum, reach, bootstrap))
    return values | {
        "grain_count": float(packing.grains.count),
        "dimension": float(packing.dimension),
        "criterion": rule.text,
        "z_definition": definition,
        "missing": "; ".join(reasons) or None,
    }


def quick_measure(
    pair: IntArray,
    normal: Array,
    normal_force: Array,
    grain_count: int,
    *,
    direction: Array | None = None,
    minor: Array | None = None,
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    support: IntArray | None = None,
) -> dict[str, float]:
    """z in three ways, rattlers, a, a' and θ_c from plain arrays, for every few steps of a run.

    Args:
        pair: candidate pairs, shape (contact_count, 2).
        normal: unit normals [-], shape (contact_count, D).
        normal_force: force or impulse along them, shape (contact_count,); the criterion is
            ``force``: above 10⁻⁶ of its mean.
        grain_count: number of grains.
        direction: axis of a', shape (D,).
        minor: its axis of least contraction in true triaxial states, shape (D,).
        z_definition: whose contacts a uses.
        minimum: fewest contacts that hold a grain.
        support: wall contacts of each grain that bear force, shape (grain_count,).
    Returns:
        z, z_backbone, z_mechanical, rattler_fraction, a, a_signed, theta_c (degrees, as in
        :func:`measure`); NaN where no contact is left, or for a_signed without a direction.
    """
    bearing = np.abs(normal_force) > force_threshold(normal_force)
    pair, normal = pair[bearing], normal[bearing]
    numbers = coordination(pair, grain_count, minimum=minimum, support=support)
    values = {
        "z": numbers.z,
        "z_backbone": numbers.z_backbone,
        "z_mechanical": numbers.z_mechanical,
        "rattler_fraction": numbers.rattler_fraction,
        "a": math.nan,
        "a_signed": math.nan,
        "theta_c": math.nan,
    }
    normal = normal[counted_contacts(pair, numbers, z_definition)]
    if len(normal):
        fabric = fabric_tensor(normal)
        values["a"] = anisotropy(fabric)
        values["theta_c"] = _theta_c(fabric, direction)
        if direction is not None:
            values["a_signed"] = signed_anisotropy(fabric, direction, minor=minor)
    return values


def _blank(dimension: int) -> dict[str, Value]:
    names = ["z", "z_backbone", "z_mechanical", "rattler_fraction", "a", "a_signed", "theta_c"]
    names += ["a_noise", "a_bias", "p_g", "q_g", *(["b_g"] if dimension == 3 else [])]
    names += [f"g_{k + 1}" for k in range(dimension)]
    names += [f"f_{_AXES[i]}{_AXES[j]}" for i in range(dimension) for j in range(i, dimension)]
    return dict.fromkeys([*names, "q_over_p", "p", "phi", "contact_count"])


def _fabric_values(
    network: Network, direction: Array | None, minor: Array | None
) -> dict[str, Value]:
    numbers, count = network.coordination, network.contacts.count
    values: dict[str, Value] = {
        "z": numbers.z,
        "z_backbone": numbers.z_backbone,
        "z_mechanical": numbers.z_mechanical,
        "rattler_fraction": numbers.rattler_fraction,
        "contact_count": float(network.contact_count),
    }
    if count == 0:
        return values
    fabric = fabric_tensor(network.contacts)
    enriched = enriched_tensor(fabric, network.z)
    dimension = len(fabric)
    a = anisotropy(fabric)
    signed = None if direction is None else signed_anisotropy(fabric, direction, minor=minor)
    values |= {
        "a": a,
        "a_signed": signed,
        "theta_c": _theta_c(fabric, direction),
        "a_noise": anisotropy_noise(count, dimension, a if signed is None else signed),
        "a_bias": anisotropy_bias(count, dimension),
        "p_g": mean_part(enriched),
        "q_g": deviatoric_part(enriched),
    }
    values |= {f"g_{k + 1}": float(g) for k, g in enumerate(principal_values(enriched))}
    for i in range(dimension):
        values |= {f"f_{_AXES[i]}{_AXES[j]}": float(fabric[i, j]) for j in range(i, dimension)}
    if dimension == 3 and a > 1e-12:
        values["b_g"] = intermediate_ratio(enriched)
    return values


def _theta_c(fabric: Array, direction: Array | None) -> float:
    if len(fabric) == 2:
        return major_angle(fabric)
    axis = np.array([0.0, 0.0, 1.0]) if direction is None else np.asarray(direction)
    cosine = abs(float(major_direction(fabric) @ axis)) / float(np.linalg.norm(axis))
    return math.degrees(math.acos(min(cosine, 1.0)))


def _stress_values(packing: Packing) -> dict[str, Value]:
    stress = stress_tensor(packing)
    mean = mean_part(stress)
    return {"p": mean, "q_over_p": stress_ratio(stress) if mean != 0.0 else None}


def _overlap(packing: Packing) -> float:
    """Worst overlap of grains with grains or walls [mean diameters], ≥ 0."""
    contacts, radius = packing.contacts, packing.grains.radius
    if contacts is None:
        gap = neighbours_within(packing, 0.0).gap
    elif contacts.gap is not None:
        gap = contacts.gap
    else:
        length = np.linalg.norm(branch_vectors(packing), axis=1)
        gap = length - radius[contacts.pair].sum(axis=1)
    gaps = [np.zeros(1), gap if gap is not None else np.zeros(0)]
    if packing.wall_contacts is not None:
        gaps.append(packing.wall_contacts.gap)
    return max(0.0, -float(np.concatenate(gaps).min())) / mean_diameter(packing)


def _errors(
    packing: Packing,
    rule: Criterion,
    definition: ZDefinition,
    direction: Array | None,
    minimum: int,
    reach: float | None,
    replicas: int,
) -> dict[str, Value]:
    errors = bootstrap_errors(
        packing, criterion=rule, z_definition=definition, direction=direction,
        minimum=minimum, reach=reach, replicas=replicas,
    )  # fmt: skip
    return {f"{name}_error": value for name, value in errors.items()}


def _check_direction(direction: Array | None, dimension: int) -> Array | None:
    if direction is None:
        return None
    direction = np.asarray(direction, dtype=float)
    if direction.shape != (dimension,) or not np.linalg.norm(direction) > 0:
        raise InvalidSettings(
            f"direction must be a non-zero vector of {dimension} numbers, got {direction.tolist()}"
        )
    return direction


def values_dataset(
    rows: Sequence[Mapping[str, Value]], dim: str, attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Rows of :func:`measure` as variables over ``dim``, NaN where unknown; words are left out."""

    import xarray as xr  # slow to import: only where a Dataset is made

    data = {}
    for name in rows[0]:
        column = [row[name] for row in rows]
        if any(isinstance(value, str) for value in column) or name == "missing":
            continue
        values = np.array([math.nan if value is None else value for value in column], dtype=float)
        units, text = _UNITS.get(name, ("-", name))
        data[name] = (dim, values, {"units": units, "long_name": text})
    return xr.Dataset(data, attrs=dict(attributes))
