"""Orientations of the contacts: E(θ) with error bars, its harmonics and their noise.

Sources: [Radjai2012], eqs. 10–15 and Fig. 3. P_n is normalised on the half space of directions,
so E = (z/2) P_n integrates to z/2 there.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its parts load where they are used

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.tensors import fabric_tensor
from granufab.fabric.variables import describe
from granufab.packing import Array, Contacts, IntArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["orientation", "symmetry_axis"]

_MODES = np.array([2, 4, 6])
_ERROR = (
    "contacts taken as independent (multinomial counts; an empty bin has the error of one count); "
    "neighbours of a grain repel, so the true error is smaller"
)


def orientation(
    contacts: Contacts,
    *,
    z: float,
    bins: int = 36,
    axis: Array | None = None,
    criterion: str = "",
) -> xr.Dataset:
    r"""Distribution of contact orientations per grain, E = (z/2) P_n [Radjai2012, eqs. 14, 15].

    2D: equal angles over θ ∈ [0, π); harmonics
    :math:`P_n = \frac1\pi\{1+\sum_m A_m \cos m(\theta-\theta_m)\}` with
    :math:`A_m = 2|\langle e^{im\theta}\rangle|`, so A_2 = a. 3D: equal solid angles of the polar
    angle from ``axis`` over the hemisphere;
    :math:`P_n = \frac1{2\pi}\{1+\sum_l A_l P_l(\cos\theta)\}` with
    :math:`A_l = (2l+1)\langle P_l\rangle`, so A_2 = 2a. Modes 2, 4 and 6.

    Args:
        contacts: those that z counts (:func:`~granufab.fabric.select_network`).
        z: coordination number in use [-].
        bins: number of bins.
        axis: symmetry axis of a 3D state, shape (3,); default :func:`symmetry_axis`.
        criterion: contact criterion, kept in the attributes.
    Returns:
        Over ``theta`` (bin centres [rad]): count, E, E_error, E_fit (the second-order fit).
        Over ``mode``: amplitude, amplitude_error and in 2D phase, phase_error [degree]. Scalars:
        a, a_error, share_above_2 (power of modes 4 and 6 over that of 2, 4 and 6),
        share_above_2_corrected (the expected noise power taken off each mode), misfit (reduced
        χ² of the second-order fit: near 1 or below where mode 2 says all).
    Raises:
        MissingData: there are no contacts.
        InvalidSettings: fewer than 3 bins.
    """
    if bins < 3:
        raise InvalidSettings(f"orientation needs at least 3 bins, got {bins}")
    if contacts.count == 0:
        raise MissingData("there are no contacts, so their orientation is not defined")
    dataset = (
        _plane(contacts.normal, z, bins)
        if contacts.dimension == 2
        else _sphere(contacts.normal, z, bins, axis)
    )
    return dataset.assign_attrs(
        z=z, contact_count=contacts.count, criterion=criterion, error_bars=_ERROR
    )


def symmetry_axis(contacts: Contacts | Array) -> Array:
    """Axis of a 3D fabric: the principal direction whose value stands apart, shape (3,).

    The major direction in compression, the minor one in extension.

    Raises:
        MissingData: there are no contacts.
    """
    values, vectors = np.linalg.eigh(fabric_tensor(contacts))
    axis = vectors[:, 2 if values[2] - values[1] >= values[1] - values[0] else 0]
    return axis * np.sign(axis[np.argmax(np.abs(axis))])


def _plane(normal: Array, z: float, bins: int) -> xr.Dataset:
    angle = np.mod(np.arctan2(normal[:, 1], normal[:, 0]), math.pi)
    width = math.pi / bins
    index = np.minimum((angle / width).astype(np.int64), bins - 1)
    harmonics = _fourier(angle)
    a, theta_c = harmonics["amplitude"][1][0], math.radians(harmonics["phase"][1][0])
    theta = np.linspace(0.5, bins - 0.5, bins) * width
    # Mean of cos 2(θ−θc) over a bin.
    mean = np.sinc(1.0 / bins) * np.cos(2.0 * (theta - theta_c))
    fit = 1.0 + a * np.cos(2.0 * (theta - theta_c))
    data = _binned(np.bincount(index, minlength=bins), z, math.pi, fit, 1.0 + a * mean)
    power = harmonics["amplitude"][1] ** 2
    noise = (4.0 - power) / max(len(normal) - 1, 1)
    data |= harmonics | _shares(power, noise)
    data["a"] = ((), a, {"units": "-", "long_name": "fabric anisotropy of mode 2"})
    data["a_error"] = ((), harmonics["amplitude_error"][1][0], describe("standard error of a"))
    return _dataset(data, theta, "orientation from the x axis")


def _fourier(angle: Array) -> dict:
    turned = np.exp(1j * np.outer(_MODES, angle))
    moment = turned.mean(axis=1)
    amplitude = 2.0 * np.abs(moment)
    along = turned * np.exp(-1j * np.angle(moment))[:, None]
    error = 2.0 * along.real.std(axis=1) / math.sqrt(len(angle))
    across = 2.0 * along.imag.std(axis=1) / math.sqrt(len(angle))
    with np.errstate(divide="ignore"):
        phase_error = np.degrees(across / amplitude) / _MODES
    phase = np.degrees(np.mod(np.angle(moment), 2.0 * math.pi) / _MODES)
    return {
        "amplitude": ("mode", amplitude, describe("A_m of 1 + Σ A_m cos m(θ − θ_m)")),
        "amplitude_error": ("mode", error, describe("standard error of A_m")),
        "phase": ("mode", phase, describe("direction θ_m of mode m", "degree")),
        "phase_error": (
            "mode",
            np.minimum(phase_error, 180.0 / _MODES),
            describe("standard error of θ_m, at most half its period", "degree"),
        ),
    }


def _sphere(normal: Array, z: float, bins: int, axis: Array | None) -> xr.Dataset:
    direction = symmetry_axis(normal) if axis is None else np.asarray(axis, dtype=float)
    direction = direction / np.linalg.norm(direction)
    cosine = np.minimum(np.abs(normal @ direction), 1.0)
    index = np.minimum(((1.0 - cosine) * bins).astype(np.int64), bins - 1)
    middle = 1.0 - (np.arange(bins) + 0.5) / bins
    legendre = np.array([scipy.special.eval_legendre(mode, cosine) for mode in _MODES])
    factor = 2.0 * _MODES + 1.0
    amplitude = factor * legendre.mean(axis=1)
    error = factor * legendre.std(axis=1) / math.sqrt(len(cosine))
    fit = 1.0 + amplitude[0] * scipy.special.eval_legendre(2, middle)
    # Mean of u² over a bin of width w is u² + w²/12.
    mean = fit + amplitude[0] * 1.5 / (12.0 * bins**2)
    data = _binned(np.bincount(index, minlength=bins), z, 2.0 * math.pi, fit, mean)
    data["amplitude"] = ("mode", amplitude, describe("A_l of 1 + Σ A_l P_l(cos θ)"))
    data["amplitude_error"] = ("mode", error, describe("standard error of A_l"))
    data |= _shares(amplitude**2 / factor, error**2 / factor)
    data["a"] = ((), 0.5 * amplitude[0], describe("signed fabric anisotropy along the axis"))
    data["a_error"] = ((), 0.5 * error[0], describe("standard error of a"))
    dataset = _dataset(data, np.arccos(middle), "polar angle from the axis")
    return dataset.assign_attrs(axis=direction)


def _binned(count: IntArray, z: float, whole: float, fit: Array, mean: Array) -> dict:
    """Histogram of one distribution; ``fit`` at the centres, ``mean`` over the bins, both × 1."""
    bins, total = len(count), float(count.sum())
    scale = 0.5 * z * bins / (total * whole)
    spread = np.sqrt(np.maximum(count * (1.0 - count / total), 1.0))
    expected = total * np.maximum(mean, 1e-12) / bins
    misfit = float(np.sum((count - expected) ** 2 / expected)) / max(bins - 3, 1)
    unit = "1/rad" if whole < 4.0 else "1/sr"
    return {
        "count": ("theta", count, describe("contacts in the bin")),
        "E": ("theta", scale * count, describe("contacts per grain and direction", unit)),
        "E_error": ("theta", scale * spread, describe("standard error of E", unit)),
        "E_fit": ("theta", 0.5 * z / whole * fit, describe("second-order fit of E", unit)),
        "misfit": ((), misfit, describe("reduced χ² of the second-order fit")),
    }


def _shares(power: Array, noise: Array) -> dict:
    def share(values: Array) -> float:
        return float(values[1:].sum() / values.sum()) if values.sum() > 0 else 0.0

    return {
        "share_above_2": ((), share(power), describe("power of modes 4, 6 over that of 2, 4, 6")),
        "share_above_2_corrected": (
            (),
            share(np.maximum(power - noise, 0.0)),
            describe("the same, expected noise power taken off each mode"),
        ),
    }


def _dataset(data: dict, theta: Array, text: str) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    return xr.Dataset(
        data,
        coords={
            "theta": ("theta", theta, describe(text, "rad")),
            "mode": ("mode", _MODES, describe("order of the harmonic")),
        },
    )
