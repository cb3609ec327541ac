"""Stress from the anisotropies of contacts, branches and forces.

Source: Rothenburg & Bathurst, Géotechnique 39, 601 (1989), in the form of [Radjai2012]'s
truncated harmonics. With ψ the angle from the axis and e_ψ the direction of growing ψ:

2D: P_n = (1/π){1 + a cos2ψ}, <ℓ> = ℓ_0{1 + a_ℓ cos2ψ}, <f_n> = f_0{1 + a_n cos2ψ};
3D: the same with 3cos²ψ − 1 in place of cos2ψ and 1/2π in place of 1/π;
both: <f·e_ψ> = −a_t f_0 sin2ψ, so a_t > 0 where tangential forces pull towards the axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.directional import (
    Directions,
    binned_mean,
    directions,
    even_columns,
    odd_columns,
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
from granufab.fabric.stress import stress_ratio, stress_tensor
from granufab.fabric.variables import describe
from granufab.packing import Array, require

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["anisotropy_stress_ratio", "stress_force_fabric"]

_SCALARS = {
    "a": "fabric anisotropy along the axis",
    "a_l": "branch-length anisotropy along the axis",
    "a_n": "normal-force anisotropy along the axis",
    "a_t": "tangential-force anisotropy along the axis",
    "q_over_p_signed": "stress ratio of these contacts along the axis",
    "q_over_p_linear": "stress ratio from the sum of the anisotropies",
    "q_over_p_full": "stress ratio from the full form of the anisotropies",
    "q_over_p_harmonic": "stress ratio from the harmonics of order 2, 4 and 6",
    "full_over_measured": "full form over the measured signed stress ratio",
}


def anisotropy_stress_ratio(
    a: ArrayLike,
    a_l: ArrayLike,
    a_n: ArrayLike,
    a_t: ArrayLike,
    *,
    dimension: int = 2,
    full: bool = True,
) -> Array:
    r"""q/p of a state whose densities and forces are second-order harmonics, along their axis.

    Linear, with :math:`\Sigma = a+a_\ell+a_n+a_t`: Σ/2 in 2D, (2/5)Σ in 3D. Full:
    2D :math:`\frac{4\Sigma+3aa_\ell a_n+aa_\ell a_t}{4\{2+aa_\ell+aa_n+a_\ell a_n\}}`; 3D, with
    :math:`\Pi = aa_\ell+aa_n+a_\ell a_n`,
    :math:`\frac{2\{7\Sigma+4\Pi+2(a+a_\ell)a_t+12aa_\ell a_n+4aa_\ell a_t\}}
    {35+28\Pi+16aa_\ell a_n}`. They integrate σ = n_c∫P_n<ℓ>{<f_n>n + <f_t>e_ψ}⊗n dΩ exactly;
    what they leave out are higher harmonics and correlations of force and length among the
    contacts of one direction.

    Args:
        a: signed fabric anisotropy [-], any shape.
        a_l: signed branch-length anisotropy [-].
        a_n: signed normal-force anisotropy [-].
        a_t: signed tangential-force anisotropy [-].
        dimension: 2 or 3.
        full: False for the linear form.
    Returns:
        Signed q/p [-]: (σ_d − σ_⊥)/2p in 2D, (σ_d − σ_⊥)/3p in 3D, d the axis.
    Raises:
        InvalidSettings: the dimension is neither 2 nor 3.
    """
    if dimension not in (2, 3):
        raise InvalidSettings(f"dimension is {dimension!r}, must be 2 or 3")
    a, a_l, a_n, a_t = (np.asarray(value, dtype=np.float64) for value in (a, a_l, a_n, a_t))
    total = a + a_l + a_n + a_t
    if not full:
        return np.asarray((0.5 if dimension == 2 else 0.4) * total)
    pairs, triple = a * a_l + a * a_n + a_l * a_n, a * a_l * a_n
    if dimension == 2:
        return np.asarray((4 * total + 3 * triple + a * a_l * a_t) / (4 * (2 + pairs)))
    shear = 2 * (a + a_l) * a_t + 4 * a * a_l * a_t
    top = 2 * (7 * total + 4 * pairs + 12 * triple + shear)
    return np.asarray(top / (35 + 28 * pairs + 16 * triple))


def stress_force_fabric(
    states: States,
    *,
    bins: int = 18,
    axis: Array | None = None,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    replicas: int = 200,
) -> xr.Dataset:
    r"""Forces and branches by direction, their anisotropies, and the q/p that these predict.

    a is a mean over contacts (2<cos2ψ>, (5/4)<3cos²ψ−1>). a_n, a_t and a_ℓ belong to means *at*
    a direction: averages over contacts would weight them by P_n and mix a in. They are fitted
    to the contacts by least squares with the orders 2, 4 and 6 together, which is unbiased
    whatever P_n, and f_0, ℓ_0 are means over directions, not over contacts.

    Args:
        states: a packing, a frame, or several (:func:`~granufab.fabric.late_frames`).
        bins: over half of all directions, for the curves only.
        axis: shape (D,); default the loading direction of the first frame, else a principal
            axis of the fabric.
        criterion: contact criterion; the contacts need forces.
        z_definition: the contacts that this z counts are used.
        minimum: fewest contacts that hold a grain.
        replicas: number of bootstrap draws, of contacts, or of states where there are 8.
    Returns:
        Over ``theta``: count, normal_force, tangential_force (along e_θ: counter-clockwise in
        2D, away from the axis in 3D) [N], mean_length [m], each with ``_error`` and ``_fit``
        (second order), density (P_n [1/rad or 1/sr]). Scalars: a, a_l, a_n, a_t,
        q_over_p_signed (measured, these contacts, along the axis), q_over_p_linear,
        q_over_p_full, q_over_p_harmonic (σ integrated with the orders 4 and 6 too: what still
        misses is the correlation of force and length), full_over_measured, each with ``_error``;
        q_over_p (measured, principal values of the whole contact stress averaged over the
        states), force_0 [N], length_0 [m].
    Raises:
        MissingData: no forces, no cell, no contacts, or these in too few directions.
        InvalidSettings: an unknown criterion or definition, an axis of wrong shape.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    sample = pool_contacts(
        states, criterion=criterion, z_definition=z_definition, minimum=minimum, axis=axis
    )
    require(sample.force, "contact forces", "use the criterion force")
    around = directions(sample.normal, sample.axis, bins)
    harmonics = _Harmonics(sample, around)
    sums = unit_sums(sample, harmonics.statistics)
    values = harmonics.estimate(sums.sum(axis=0)[None])
    spread = harmonics.estimate(resample(sums, replicas)) if replicas else {}
    stress = np.mean([stress_tensor(packing) for packing in sample.packings], axis=0)
    data: dict = {}
    for name, text in _SCALARS.items():
        with np.errstate(invalid="ignore"):  # a ratio to q is not defined where q is 0
            error = float(np.std(spread[name])) if replicas else np.nan
        data[name] = ((), float(values[name][0]), describe(text))
        data[f"{name}_error"] = ((), error, describe(f"bootstrap standard error of {name}"))
    force_0, length_0 = float(values["force_0"][0]), float(values["length_0"][0])
    data["q_over_p"] = ((), stress_ratio(stress), describe("stress ratio, principal values"))
    data["force_0"] = ((), force_0, describe("mean of <f_n> over directions", "N"))
    data["length_0"] = ((), length_0, describe("mean of <l> over directions", "m"))
    data |= _curves(sample, around, {name: float(values[name][0]) for name in values})
    plane = sample.dimension == 2
    text = "orientation from the x axis" if plane else "polar angle from the axis"
    coordinates = {"theta": ("theta", around.theta, describe(text, "rad"))}
    note = "along e_theta: " + ("counter-clockwise" if plane else "away from the axis")
    return xr.Dataset(data, coordinates, sample.attributes | {"tangential_sign": note})


class _Harmonics:
    """Additive statistics of the contacts and the anisotropies that follow from their sums."""

    def __init__(self, sample: ContactSample, around: Directions) -> None:
        dimension = sample.dimension
        even, odd = even_columns(around.offset, dimension), odd_columns(around.offset, dimension)
        self.even = even[:, : usable_columns(even.T @ even, 2)]
        # Where every contact lies along or across the axis, a_t is not defined and stays 0.
        self.odd = odd[:, : usable_columns(odd.T @ odd, 1)] if _spans(odd) else odd[:, :1]
        self.force = require(sample.force, "contact forces")
        self.normal_force = np.einsum("ci,ci->c", self.force, sample.normal)
        self.tangential_force = np.einsum("ci,ci->c", self.force, around.tangent)
        self.branch, self.length = sample.branch, sample.length
        self.axis, self.dimension = sample.axis, dimension
        # Mean squares of the even columns over all directions.
        self.norms = np.array([1.0] + [0.5] * 6 if dimension == 2 else [1.0, 4 / 5, 1 / 9, 1 / 13])

    def statistics(self, part: slice) -> Array:
        """Per contact: 1, XᵀX, Xᵀf_n, Xᵀℓ, YᵀY, Yᵀf_t, trace and axial part of f⊗ℓ."""
        even, odd, force, branch = (
            values[part] for values in (self.even, self.odd, self.force, self.branch)
        )
        along = (force @ self.axis) * (branch @ self.axis)
        return np.concatenate(
            [
                np.einsum("ci,cj->cij", even, even).reshape(len(even), -1),
                even * self.normal_force[part, None],
                even * self.length[part, None],
                np.einsum("ci,cj->cij", odd, odd).reshape(len(odd), -1),
                odd * self.tangential_force[part, None],
                np.einsum("ci,ci->c", force, branch)[:, None],
                along[:, None],
            ],
            axis=1,
        )

    def estimate(self, sums: Array) -> dict[str, Array]:
        """Anisotropies and stress ratios of each row of sums, shape (rows,)."""
        m, k = self.even.shape[1], self.odd.shape[1]
        edges = np.cumsum([m * m, m, m, k * k, k, 1])
        square, by_force, by_length, odd_square, by_shear, trace, along = np.split(
            sums, edges, axis=1
        )
        square = square.reshape(-1, m, m)
        force = solve_harmonics(square, by_force)
        length = solve_harmonics(square, by_length)
        shear = solve_harmonics(odd_square.reshape(-1, k, k), by_shear)
        cosine = square[:, 0, 1] / square[:, 0, 0]
        ratio = along[:, 0] / trace[:, 0]
        four = {
            "a": (2.0 if self.dimension == 2 else 1.25) * cosine,
            "a_l": length[:, 1] / length[:, 0],
            "a_n": force[:, 1] / force[:, 0],
            "a_t": -shear[:, 0] / force[:, 0],
        }
        measured = 2.0 * ratio - 1.0 if self.dimension == 2 else 0.5 * (3.0 * ratio - 1.0)
        full = self._ratio(four, True)
        linear = self._ratio(four, False)
        density = square[:, 0] / square[:, :1, 0] / self.norms[:m]
        harmonic = self._integrated(density, force, length, shear)
        with np.errstate(divide="ignore", invalid="ignore"):
            quotient = full / measured
        return four | {
            "force_0": force[:, 0],
            "length_0": length[:, 0],
            "q_over_p_signed": measured,
            "q_over_p_linear": linear,
            "q_over_p_full": full,
            "q_over_p_harmonic": harmonic,
            "full_over_measured": quotient,
        }

    def _ratio(self, four: dict[str, Array], full: bool) -> Array:
        return anisotropy_stress_ratio(
            four["a"], four["a_l"], four["a_n"], four["a_t"], dimension=self.dimension, full=full
        )

    def _integrated(self, density: Array, force: Array, length: Array, shear: Array) -> Array:
        """Signed q/p of σ = n_c∫P_n<ℓ>{<f_n>n + <f_t>e_ψ}⊗n dΩ, exact for these orders."""
        if self.dimension == 2:
            angle = np.arange(64) * np.pi / 64
            weight, deviator, lever = np.full(64, 1.0), np.cos(2 * angle), -np.sin(2 * angle)
        else:
            cosine, weight = np.polynomial.legendre.leggauss(32)
            angle = np.arccos(cosine)
            deviator, lever = 1.5 * cosine**2 - 0.5, -0.75 * np.sin(2 * angle)
        even = even_columns(angle, self.dimension)[:, : force.shape[1]].T
        odd = odd_columns(angle, self.dimension)[:, : shear.shape[1]].T
        arm = (density @ even) * (length @ even) * weight
        top = (arm * ((force @ even) * deviator + (shear @ odd) * lever)).sum(axis=1)
        return top / (arm * (force @ even)).sum(axis=1)


def _spans(odd: Array) -> bool:
    return float(np.mean(odd[:, 0] ** 2)) > 1e-12


def _curves(sample: ContactSample, around: Directions, values: dict[str, float]) -> dict:
    bins, dimension = len(around.theta), sample.dimension
    force = require(sample.force, "contact forces")
    turn = np.arctan2(sample.axis[1], sample.axis[0]) if dimension == 2 else 0.0
    shape = even_columns(around.theta - turn, dimension)[:, 1]
    sine = np.sin(2.0 * (around.theta - turn))
    force_0, length_0 = values["force_0"], values["length_0"]
    quantities = (
        (
            ("normal_force", "N", "mean normal force"),
            np.einsum("ci,ci->c", force, sample.normal),
            force_0 * (1.0 + values["a_n"] * shape),
        ),
        (
            ("tangential_force", "N", "mean tangential force along e_theta"),
            np.einsum("ci,ci->c", force, around.tangent),
            -force_0 * values["a_t"] * sine,
        ),
        (
            ("mean_length", "m", "mean branch length"),
            sample.length,
            length_0 * (1.0 + values["a_l"] * shape),
        ),
    )
    data: dict = {}
    for (name, unit, text), value, fit in quantities:
        mean, error = binned_mean(around.index, _folded(value, name, sample, around), bins)
        data[name] = ("theta", mean, describe(text, unit))
        data[f"{name}_error"] = ("theta", error, describe(f"standard error of the {text}", unit))
        data[f"{name}_fit"] = ("theta", fit, describe(f"second-order fit of the {text}", unit))
    count = np.bincount(around.index, minlength=bins)
    unit = "1/rad" if dimension == 2 else "1/sr"
    scale = 1.0 / (sample.count * around.width)
    spread = np.sqrt(np.maximum(count * (1.0 - count / sample.count), 1.0))
    whole = np.pi if dimension == 2 else 2.0 * np.pi
    fit = (1.0 + values["a"] * shape) / whole
    return data | {
        "count": ("theta", count, describe("contacts in the bin")),
        "density": ("theta", scale * count, describe("density P_n of contact normals", unit)),
        "density_error": ("theta", scale * spread, describe("standard error of P_n", unit)),
        "density_fit": ("theta", fit, describe("second-order fit of P_n", unit)),
    }


def _folded(value: Array, name: str, sample: ContactSample, around: Directions) -> Array:
    """In 3D, e_θ of a normal below the equator is that of its opposite, which bears −f."""
    if name != "tangential_force" or sample.dimension == 2:
        return value
    return np.where(np.cos(around.offset) < 0.0, -value, value)
