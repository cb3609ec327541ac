"""Non-affine displacements of the grains against the window of strain: distribution and growth."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.displacements import Range, States, Track, follow
from granufab.fabric.relative_velocity import block_count, spatial_blocks
from granufab.packing import Array, IntArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fluctuations"]

_WIDEST = 6.0
_PARTS = 5
_ERROR = "the larger of two jackknifes: over spatial blocks of grains and over 5 parts of the path"


def fluctuations(
    states: States,
    *,
    windows: Sequence[int] | None = None,
    stage: int | None = None,
    strain: Range = None,
    bins: int = 60,
) -> xr.Dataset:
    r"""Statistics of the non-affine displacements u' over windows of strain [Radjai & Roux 2002].

    u' is the displacement less the affine motion of the cell
    (:func:`~granufab.fabric.nonaffine_displacement`), over windows of m frame intervals that do
    not overlap. Its distribution is taken of u'_k/√<u'_k²>, components together; its excess
    kurtosis <u'_k⁴>/<u'_k²>² − 3 is 0 for a Gaussian; its growth <|u'|²> ∝ Δε^α has α = 1 for
    independent steps and 2 for straight ones. Window 0 stands for the recorded velocities
    (fluctuations c over ε̇_q), the limit of small windows.

    Args:
        states: a run, frames or packings of one stage at equal intervals of strain; a steady
            state, as what changes along the path widens the distribution.
        windows: numbers m of frame intervals; default 0 where velocities are known, and
            1, 2, 4… up to half of the states.
        stage: keep the frames of this stage.
        strain: keep the frames with ∫|dε_q| in this range.
        bins: of the distribution, over ±6 standard deviations.
    Returns:
        Over ``window``: strain, msd [d²], relative_rms = √(<|u'|²>/D)/(Δε_q d),
        local_exponent (to the next window). Over ``window``, ``component``: msd_component,
        kurtosis. Over ``window``, ``value``: pdf. Scalar: exponent. All but strain
        with ``…_error``, by jackknife: over spatial blocks of grains (25 in 2D, 27 in 3D) or
        over 5 parts of the path, whichever is larger. Motion is correlated over the whole cell
        in quasistatic shear, so samples differ by more: compare replicas.
    Raises:
        MissingData: a state has no cell, or window 0 no velocities.
        InvalidSettings: too few states for a window, or states at uneven intervals.
    """
    track = follow(states, stage=stage, strain=strain)
    chosen = _windows(track, windows)
    block = spatial_blocks(np.mod(track.place[0], 1.0))
    edges = np.linspace(-_WIDEST, _WIDEST, bins + 1)
    parts = [_window_sums(track, window, block, edges) for window in chosen]
    sums = {name: np.array([part[name] for part in parts]) for name in parts[0]}
    lengths = np.array([window * track.interval for window in chosen])

    def values(own: dict[str, Array]) -> dict[str, Array]:
        return _statistics(own, lengths, float(edges[1] - edges[0]))

    apart = [_jackknife(sums, values, axis) for axis in (1, 2)]
    error = {name: np.fmax(value, apart[1][name]) for name, value in apart[0].items()}
    return _dataset(values(sums), error, lengths, chosen, edges).assign_attrs(
        diameter=track.diameter,
        states=len(track.strain),
        interval=track.interval,
        dimension=track.place.shape[2],
        definition="u' = displacement less affine motion; mean 0 in periodic directions",
        error_bars=_ERROR,
    )


def _windows(track: Track, windows: Sequence[int] | None) -> list[int]:
    most = len(track.strain) - 1
    still = track.velocity is None or not (track.deviatoric_rate > 0).all()
    if windows is None:
        powers = [2**k for k in range(32) if 2**k <= max(1, most // 2)]
        return powers if still else [0, *powers]
    chosen = sorted({int(window) for window in windows})
    if not chosen or chosen[0] < 0 or chosen[-1] > most:
        raise InvalidSettings(
            f"windows must lie between 0 and {most}, the intervals there are; got {list(windows)}"
        )
    if chosen[0] == 0 and still:
        raise MissingData("window 0 needs velocities and a shearing cell in every state")
    return chosen


def samples(track: Track, window: int) -> list[tuple[int, int, Array]]:
    """Start, end and non-affine displacements over windows without overlap, in diameters.

    Args:
        track: the states.
        window: number of intervals; 0 gives the velocities over ε̇_q d.
    Returns:
        One entry per window, u' of shape (grain_count, D).
    """
    if window == 0:
        found = []
        for state in range(len(track.strain)):
            assert track.velocity is not None
            velocity = track.velocity[state]
            velocity = velocity - velocity.mean(axis=0) * np.array(track.periodic)
            found.append((state, state, velocity / (track.deviatoric_rate[state] * track.diameter)))
        return found
    starts = range(0, len(track.strain) - window, window)
    return [(s, s + window, track.displacement(s, s + window) / track.diameter) for s in starts]


def _window_sums(track: Track, window: int, block: IntArray, edges: Array) -> dict[str, Array]:
    """Count, squares, fourth powers and histogram by part of the path and spatial block."""
    blocks, bins = block_count(track.place.shape[2]), len(edges) - 1
    found = samples(track, window)
    moved = np.array([u for _, _, u in found])
    start = np.array([first for first, _, _ in found])
    part = start * _PARTS // len(track.strain)
    cluster = (part[:, None] * blocks + block[None]).ravel()
    size = _PARTS * blocks
    rms = np.sqrt(np.mean(moved**2, axis=(0, 1)))
    flat = moved.reshape(-1, moved.shape[2])
    slot = (flat / np.where(rms > 0, rms, 1.0) - edges[0]) / (edges[1] - edges[0])
    slot = np.floor(slot).astype(np.int64)
    key = cluster[:, None] * bins + slot
    inside = (slot >= 0) & (slot < bins)
    sums = {
        "count": np.bincount(cluster, minlength=size),
        "square": np.stack([np.bincount(cluster, u**2, size) for u in flat.T], axis=1),
        "fourth": np.stack([np.bincount(cluster, u**4, size) for u in flat.T], axis=1),
        "histogram": np.bincount(key[inside], minlength=size * bins).reshape(size, bins),
    }
    return {
        name: total.astype(np.float64).reshape(_PARTS, blocks, *total.shape[1:])
        for name, total in sums.items()
    }


def _statistics(sums: dict[str, Array], lengths: Array, width: float) -> dict[str, Array]:
    """Everything that is reported, from sums by window, part of the path and block."""
    count, square, fourth, histogram = (
        sums[name].sum(axis=(1, 2)) for name in ("count", "square", "fourth", "histogram")
    )
    dimension = square.shape[1]
    count = np.where(count > 0, count, np.nan)
    component = square / count[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        kurtosis = fourth / count[:, None] / component**2 - 3.0
        total = component.sum(axis=1)
        span = np.where(lengths > 0, lengths, 1.0)
        local = np.full(len(lengths), np.nan)
        local[:-1] = np.diff(np.log(total)) / np.diff(np.log(lengths))
        local[lengths == 0] = np.nan
    moved = lengths > 0
    return {
        "msd": np.where(moved, total, np.nan),
        "msd_component": np.where(moved[:, None], component, np.nan),
        "relative_rms": np.sqrt(total / dimension) / span,
        "local_exponent": local,
        "kurtosis": kurtosis,
        "pdf": histogram / (dimension * count[:, None] * width),
        "exponent": _exponent(lengths[moved], total[moved]),
    }


def _exponent(lengths: Array, msd: Array) -> Array:
    if len(lengths) < 2 or not (msd > 0).all():
        return np.array(np.nan)
    return np.array(np.polyfit(np.log(lengths), np.log(msd), 1)[0])


def _jackknife(
    sums: dict[str, Array], values: Callable[[dict[str, Array]], dict[str, Array]], axis: int
) -> dict[str, Array]:
    """Standard errors from leaving out each cluster along ``axis`` that holds grains."""
    others = tuple(k for k in range(sums["count"].ndim) if k != axis)
    held = np.flatnonzero(sums["count"].sum(axis=others) > 0)
    replicas = [
        values({name: np.delete(total, cluster, axis) for name, total in sums.items()})
        for cluster in held
    ]
    scale = np.sqrt(max(len(held) - 1.0, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a window that no replica can lack
        return {
            name: scale * np.nanstd([replica[name] for replica in replicas], axis=0)
            for name in replicas[0]
        }


_TEXT = {
    "msd": ("mean square non-affine displacement", "mean diameter squared", ("window",)),
    "msd_component": (
        "mean square non-affine displacement of a component",
        "mean diameter squared",
        ("window", "component"),
    ),
    "relative_rms": ("rms non-affine displacement over strain and diameter", "-", ("window",)),
    "local_exponent": ("exponent of the growth to the next window", "-", ("window",)),
    "kurtosis": ("excess kurtosis of the displacements", "-", ("window", "component")),
    "pdf": ("probability density of the scaled displacements", "-", ("window", "value")),
    "exponent": ("exponent of the growth over all windows", "-", ()),
}


def _dataset(
    best: dict[str, Array],
    error: dict[str, Array],
    lengths: Array,
    windows: list[int],
    edges: Array,
) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    data: dict[str, Any] = {}
    for name, (text, unit, dims) in _TEXT.items():
        data[name] = (dims, best[name], {"units": unit, "long_name": text})
        words = {"units": unit, "long_name": f"standard error of {name}"}
        data[f"{name}_error"] = (dims, error[name], words)
    data["strain"] = ("window", lengths, {"units": "-", "long_name": "strain of the window"})
    middle = 0.5 * (edges[1:] + edges[:-1])
    return xr.Dataset(
        data,
        coords={
            "window": ("window", windows, {"units": "frame intervals", "long_name": "window"}),
            "component": list("xyz"[: best["kurtosis"].shape[1]]),
            "value": ("value", middle, {"units": "-", "long_name": "u'_k over its rms"}),
        },
    )
