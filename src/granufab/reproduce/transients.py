"""Numbers of the transients in Fig. 5: the dip of z in a dense sample, and the reversal.

Extremes of a noisy series are read from its running mean. Their intervals come from adding
fluctuations of the critical state, drawn in moving blocks so that their memory is kept, to the
running mean and reading the extremes again; the offset that this doubled noise brings is taken
off, so only the scatter remains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from granufab.history import Run
from granufab.packing import Array, IntArray
from granufab.plots.curves import running_mean
from granufab.reproduce.recipe import column, first_stage, last_stage
from granufab.states.bootstrap import autocorrelation_time, block_length
from granufab.states.series import plateau_rows

__all__ = ["dip", "reversal"]

WINDOW = 0.01
SAMPLES = 400
LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Stage:
    """One stage of several repeats on a common strain, counted from its start.

    Attributes:
        strain: shape (record_count,).
        z: shape (repeat_count, record_count).
        a: signed anisotropy, > 0 before a reversal, shaped like ``z``.
        plateau: rows of the late-strain plateau.
    """

    strain: Array
    z: Array
    a: Array
    plateau: slice


def dip(
    runs: Sequence[Run], z_definition: str = "z_backbone", *, before: float = 0.1
) -> dict[str, Any]:
    """Smallest z early on the path and its depth below z*.

    Args:
        runs: repeats of the path of a dense sample.
        z_definition: column of the coordination number.
        before: strain up to which the smallest value is looked for [-].
    Returns:
        ``z_smallest``, ``depth`` = z* − z_smallest (> 0 where there is a dip) and ``eps_q`` of
        the smallest value, each with value, low, high; ``window``, the strain of the running mean.
    """
    stage = _stage([first_stage(run.series) for run in runs], z_definition)

    def read(z: Array, a: Array) -> Array:
        early = np.flatnonzero((stage.strain > 0) & (stage.strain < before))
        row = early[np.argmin(z[early])]
        return np.array([z[row], z[stage.plateau].mean() - z[row], stage.strain[row]])

    low_z, depth, strain = _estimates(stage, read)
    return {"z_smallest": low_z, "depth": depth, "eps_q": strain, "window": WINDOW}


def reversal(runs: Sequence[Run], z_definition: str = "z_backbone") -> dict[str, Any] | None:
    """How z and a' answer to a reversal of the strain; None where the path has none.

    Returns:
        ``a_signed_plateau`` and ``z_plateau`` over the last third of the strain after the
        reversal, ``strain_to_zero``, the strain since the reversal at which a' crosses 0 (None
        if it does not), ``z_smallest`` after the reversal and ``z_dip``, its depth below the
        plateau; each with value, low, high. a' is > 0 before the reversal.
    """
    parts = [last_stage(run.series) for run in runs]
    series = [part for part in parts if part is not None]
    if len(series) < len(parts):
        return None
    stage = _stage(series, z_definition)

    def read(z: Array, a: Array) -> Array:
        late = z[stage.plateau].mean()
        return np.array(
            [a[stage.plateau].mean(), late, _crossing(stage.strain, a), z.min(), late - z.min()]
        )

    names = ("a_signed_plateau", "z_plateau", "strain_to_zero", "z_smallest", "z_dip")
    return dict(zip(names, _estimates(stage, read), strict=True)) | {"window": WINDOW}


def _stage(series: Sequence[xr.Dataset], z_definition: str) -> _Stage:
    strains = [np.abs(column(item, "eps_q") - column(item, "eps_q")[0]) for item in series]
    common = strains[int(np.argmin([strain[-1] for strain in strains]))]
    z, a = (
        np.array(
            [
                np.interp(common, strain, column(item, name))
                for strain, item in zip(strains, series, strict=True)
            ]
        )
        for name in (z_definition, "a_signed")
    )
    return _Stage(strain=common, z=z, a=a, plateau=plateau_rows(common, None))


def _crossing(strain: Array, a: Array) -> float:
    below = np.flatnonzero(a <= 0)
    if len(below) == 0 or below[0] == 0:
        return float("nan")
    row = below[0]
    share = a[row - 1] / (a[row - 1] - a[row])
    return float(strain[row - 1] + share * (strain[row] - strain[row - 1]))


def _estimates(
    stage: _Stage, read: Callable[[Array, Array], Array]
) -> list[dict[str, float] | None]:
    value = read(_smooth_mean(stage.strain, stage.z), _smooth_mean(stage.strain, stage.a))
    random = np.random.default_rng(1)
    draws = np.array([read(*_drawn(stage, random)) for _ in range(SAMPLES)])
    results: list[dict[str, float] | None] = []
    for number, column_ in zip(value, draws.T, strict=True):
        known = column_[np.isfinite(column_)]
        if not np.isfinite(number) or len(known) < SAMPLES // 2:
            results.append(None)
            continue
        tails = np.quantile(known, [(1 - LEVEL) / 2, (1 + LEVEL) / 2]) - np.median(known)
        results.append(
            {
                "value": float(number),
                "low": float(number + min(tails[0], 0.0)),
                "high": float(number + max(tails[1], 0.0)),
            }
        )
    return results


def _smooth_mean(strain: Array, values: Array) -> Array:
    return np.mean([running_mean(strain, row, WINDOW)[0] for row in values], axis=0)


def _drawn(stage: _Stage, random: np.random.Generator) -> tuple[Array, Array]:
    """Running means of z and a' with other fluctuations, and other repeats where several."""
    count = len(stage.z)
    chosen = random.integers(count, size=count) if count > 1 else np.zeros(1, dtype=int)
    z, a = [], []
    for repeat in chosen:
        rows = _blocks(stage, repeat, random)
        for values, out in ((stage.z[repeat], z), (stage.a[repeat], a)):
            late = values[stage.plateau]
            smooth = running_mean(stage.strain, values, WINDOW)[0]
            out.append(smooth + (late - late.mean())[rows])
    return _smooth_mean(stage.strain, np.array(z)), _smooth_mean(stage.strain, np.array(a))


def _blocks(stage: _Stage, repeat: int, random: np.random.Generator) -> IntArray:
    """Rows of the plateau, in blocks as long as its memory, one for each record of the stage."""
    late = stage.z[repeat][stage.plateau]
    length = block_length(autocorrelation_time(late), len(late))
    number = -(-len(stage.strain) // length)
    starts = random.integers(len(late) - length + 1, size=number)
    return (starts[:, None] + np.arange(length)).reshape(-1)[: len(stage.strain)]
