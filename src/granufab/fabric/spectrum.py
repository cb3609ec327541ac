"""Power spectrum of the non-affine displacements over the wave vectors of a periodic cell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.displacements import Range, States, Track, follow
from granufab.fabric.fluctuations import samples
from granufab.fabric.relative_velocity import Tally, cluster_error
from granufab.fabric.variables import describe
from granufab.packing import Array

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fluctuation_spectrum"]

_CHUNK = 4096
_CLASSES = 8


def fluctuation_spectrum(
    states: States,
    *,
    window: int = 1,
    stage: int | None = None,
    strain: Range = None,
    bins: int = 16,
    shortest: float = 2.0,
    fit: tuple[float, float] | None = None,
) -> xr.Dataset:
    r"""Power spectrum of the field of non-affine displacements [Radjai & Roux 2002].

    :math:`S(k) = \frac{1}{N\langle|u'|^2\rangle}\,\Bigl|\sum_i u'_i e^{-i k\cdot r_i}\Bigr|^2`
    on the wave vectors k = 2π M⁻ᵀ m (m integer, M the lattice vectors), with r_i half way
    between start and end, averaged over shells of |k| and over windows that do not overlap.
    S = 1 at every k for grains that move independently. Where S ∝ k^−s, a line through the
    sample has the spectrum k^−(s − D + 1).

    Args:
        states: as for :func:`~granufab.fabric.fluctuations`; all axes periodic.
        window: number of frame intervals; 0 takes the recorded velocities.
        stage: keep the frames of this stage.
        strain: keep the frames with ∫|dε_q| in this range.
        bins: shells, equal in log k from the cell's longest wave to the shortest; empty ones
            are left out.
        shortest: shortest wavelength [mean diameters].
        fit: range of wavelengths of the power law [mean diameters]; default from 4 diameters
            to half of the longest.
    Returns:
        Over ``k`` (mean |k| d of the shell): S, S_error, modes (wave vectors, ±k once, summed
        over windows), longitudinal (share of S along k times D: 1 if directions are equal, less
        where the motion is of vortices), longitudinal_error. Scalars: slope s of S ∝ k^−s and
        line_slope = s − D + 1, with slope_error. Errors: groups of consecutive windows; with
        fewer than 8 windows, classes of wave vectors; at least that of exponentially distributed
        powers.
    Raises:
        MissingData: a state has no cell, or window 0 no velocities.
        InvalidSettings: walls, too few states for the window, or a setting out of range.
    """
    track = follow(states, stage=stage, strain=strain)
    _check(track, window, bins, shortest)
    dimension = track.place.shape[2]
    longest = float(np.linalg.norm(track.matrix[0], axis=0).max()) / track.diameter
    edges = np.geomspace(0.9 * 2 * np.pi / longest, 2 * np.pi / shortest, bins + 1)
    tally = Tally(np.zeros((_CLASSES, 4, bins)))
    for start, end, moved in samples(track, window):
        tally.add(_shell_sums(track, start, end, moved, edges))
    return _dataset(tally, dimension, fit or (4.0, 0.5 * longest)).assign_attrs(
        window=window,
        window_strain=window * track.interval,
        windows=tally.states,
        diameter=track.diameter,
        definition="|sum of u' exp(-i k r)|^2 / (N <u'^2>), summed over components",
    )


def _check(track: Track, window: int, bins: int, shortest: float) -> None:
    if not all(track.periodic):
        raise InvalidSettings("a spectrum needs a cell that is periodic along every axis")
    most = len(track.strain) - 1
    if not 0 <= window <= most:
        raise InvalidSettings(f"window must lie between 0 and {most}, got {window}")
    if window == 0 and (track.velocity is None or not (track.deviatoric_rate > 0).all()):
        raise MissingData("window 0 needs velocities and a shearing cell in every state")
    if bins < 2 or not shortest > 0:
        raise InvalidSettings(f"bins must be ≥ 2 and shortest > 0, got {bins} and {shortest}")


def _shell_sums(track: Track, start: int, end: int, moved: Array, edges: Array) -> Array:
    """Sums of 1, |k|d, S and its longitudinal part, by class of wave vectors and shell."""
    place = 0.5 * (track.place[start] + track.place[end])
    lattice = 0.5 * (track.matrix[start] + track.matrix[end]) / track.diameter
    most = np.floor(edges[-1] * np.linalg.norm(lattice, axis=0) / (2 * np.pi)).astype(int)
    amplitude = _fourier_sums(place, moved, most)
    axes = [np.arange(most[0] + 1), *(np.arange(-m, m + 1) for m in most[1:])]
    modes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(most))
    waves = 2 * np.pi * np.linalg.solve(lattice.T, modes.T).T
    length = np.linalg.norm(waves, axis=1)
    # One of each pair ±k: the first component that is not zero is positive.
    leading = modes[np.arange(len(modes)), np.argmax(modes != 0, axis=1)]
    shell = np.searchsorted(edges, length, side="right") - 1
    keep = (leading > 0) & (shell >= 0) & (length <= edges[-1])
    amplitude, waves, length, shell = (a[keep] for a in (amplitude, waves, length, shell))
    shell = np.minimum(shell, len(edges) - 2)
    scale = len(moved) * max(float((moved**2).sum(axis=1).mean()), 1e-300)
    power = (np.abs(amplitude) ** 2).sum(axis=1) / scale
    along = np.abs((amplitude * waves).sum(axis=1) / length) ** 2 / scale
    key = (modes[keep].sum(axis=1) % _CLASSES) * (len(edges) - 1) + shell
    size = _CLASSES * (len(edges) - 1)
    sums = [np.bincount(key, w, size) for w in (None, length, power, along)]
    return np.stack([s.reshape(_CLASSES, -1) for s in sums], axis=1).astype(np.float64)


def _fourier_sums(place: Array, moved: Array, most: np.ndarray) -> np.ndarray:
    """Σ_i u_i exp(−2πi m·s_i) for m_0 = 0…, m_k = −most_k…most_k; shape (mode_count, D)."""
    total: np.ndarray | float = 0.0
    for first in range(0, len(place), _CHUNK):
        part, own = place[first : first + _CHUNK], moved[first : first + _CHUNK]
        waves = [np.exp(-2j * np.pi * np.outer(part[:, 0], np.arange(most[0] + 1)))]
        for axis in range(1, place.shape[1]):
            number = np.arange(-most[axis], most[axis] + 1)
            waves.append(np.exp(-2j * np.pi * np.outer(part[:, axis], number)))
        rest = waves[1]
        for other in waves[2:]:
            rest = (rest[:, :, None] * other[:, None, :]).reshape(len(part), -1)
        total = total + np.stack([(waves[0] * u[:, None]).T @ rest for u in own.T], axis=-1)
    return np.asarray(total).reshape(-1, place.shape[1])


def _dataset(tally: Tally, dimension: int, fit: tuple[float, float]) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    clusters = tally.clusters
    whole = clusters.sum(axis=0)
    held = whole[0] > 0
    clusters, whole = clusters[:, :, held], whole[:, held]
    number, length, power, along = whole
    length, power = length / number, power / number
    floor = power / np.sqrt(number)
    error = np.fmax(cluster_error(clusters[:, 2], clusters[:, 0]), floor)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = dimension * along / whole[2]
    slope, slope_error = _slope(length, power, error, fit)
    data: dict[str, Any] = {
        "S": ("k", power, describe("power of the non-affine displacements")),
        "S_error": ("k", error, describe("standard error of S")),
        "modes": ("k", number, describe("wave vectors in the shell, over all windows")),
        "longitudinal": ("k", share, describe("share along k times the dimension")),
        "longitudinal_error": (
            "k",
            dimension * cluster_error(clusters[:, 3], clusters[:, 2]),
            describe("standard error of longitudinal"),
        ),
        "slope": ((), slope, describe("s of S ~ k^-s")),
        "slope_error": ((), slope_error, describe("standard error of slope")),
        "line_slope": ((), slope - dimension + 1, describe("exponent of the spectrum on a line")),
    }
    words = describe("wave number times mean diameter")
    result = xr.Dataset(data, coords={"k": ("k", length, words)})
    return result.assign_attrs(fit=fit, dimension=dimension)


def _slope(
    length: Array, power: Array, error: Array, fit: tuple[float, float]
) -> tuple[float, float]:
    """Weighted power law over a range of wavelengths; its error grows with a poor fit."""
    wave = 2 * np.pi / length
    keep = (wave >= fit[0]) & (wave <= fit[1]) & (power > 0)
    if keep.sum() < 3:
        return np.nan, np.nan
    x, y, weight = np.log(length[keep]), np.log(power[keep]), power[keep] / error[keep]
    coefficients, covariance = np.polyfit(x, y, 1, w=weight, cov="unscaled")
    misfit = float((((y - np.polyval(coefficients, x)) * weight) ** 2).sum()) / (keep.sum() - 2)
    return -float(coefficients[0]), float(np.sqrt(covariance[0, 0] * max(1.0, misfit)))
