"""How z, a and az depend on what counts as a contact: curves against force and gap thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.bootstrap import network_errors
from granufab.fabric.coordination import ZDefinition, check_definition
from granufab.fabric.criterion import FORCE_FRACTION, Criterion, mean_diameter, normal_force
from granufab.fabric.measure import measure, values_dataset
from granufab.fabric.neighbours import neighbours_within
from granufab.fabric.network import Network, select_network
from granufab.fabric.run_definitions import run_definitions
from granufab.fabric.tensors import anisotropy, fabric_tensor, signed_anisotropy
from granufab.fabric.variables import describe
from granufab.history import Frame, Run
from granufab.packing import Array, Packing

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["criterion_curves", "criterion_sweep"]

Kind = Literal["force", "gap"]
Row = dict[str, float]

FORCE_THRESHOLDS = np.geomspace(1e-8, 1.0, 33)
"""Default shares of the mean normal force, four to the decade."""

GAP_THRESHOLDS = np.geomspace(1e-5, 0.1, 33)
"""Default gaps [mean diameters], eight to the decade."""

_QUANTITIES = {
    "z": "coordination number",
    "a": "fabric anisotropy",
    "az": "anisotropy times coordination number",
    "rattler_fraction": "fraction of rattlers",
}
_AXES: dict[Kind, tuple[str, str]] = {
    "force": ("least normal force of a contact, in mean normal forces", "-"),
    "gap": ("largest gap of a contact", "mean diameter"),
}
_FEWEST_FOR_MEMORY = 6


@dataclass(frozen=True, slots=True)
class _State:
    packing: Packing
    direction: Array | None


def criterion_curves(
    states: Packing | Run | Sequence[Packing | Frame],
    *,
    force_thresholds: ArrayLike | None = None,
    gap_thresholds: ArrayLike | None = None,
    z_definition: ZDefinition | None = None,
    direction: Array | None = None,
    minimum: int | None = None,
    frame: int = -1,
    window: float = 0.0,
    bootstrap: int = 200,
) -> xr.Dataset:
    r"""z, a, az and the rattlers against the contact criterion, with error bars.

    Once for :math:`|f_n| > x \langle f_n\rangle` and once for gap < δ d. The pairs of the gap
    curve come from positions and radii, so it may go beyond what the source lists. Each point
    equals :func:`~granufab.fabric.measure` with the criterion ``force:x`` or ``gap:δ``.

    Error bars of one state: resampled blocks of grains. Of several states: √(τ s²/n) with s² the
    variance between states; frames are a series in strain, τ = (1 + ρ)/(1 − ρ) from the
    correlation ρ of neighbouring frames, at most n/2 (τ = 1 for fewer than 6); packings are
    independent, τ = 1.

    Args:
        states: a packing, several of them, frames, or a run.
        force_thresholds: x [mean normal forces], any order; default 33 from 10⁻⁸ to 1.
        gap_thresholds: δ [mean diameters], 0..1; default 33 from 10⁻⁵ to 0.1.
        z_definition: the z, and the contacts that a uses; default the run's own, else
            ``z_backbone``.
        direction: axis of the signed anisotropy, shape (D,); default each frame's contraction
            axis. Without any, a is the unsigned one.
        minimum: fewest contacts that hold a grain; default the run's own rule, else 2.
        frame: of a run, the state or the last of the states.
        window: of a run, ∫|dε_q| before ``frame``, within its stage, whose frames are averaged;
            0 for one state.
        bootstrap: number of resampled states for the error bars of one state; 0 for none.
    Returns:
        Over ``force_threshold``: z_force, a_force, az_force, rattler_fraction_force and the same
        with ``_error``; over ``gap_threshold`` likewise. The force curve is absent, and attrs
        ``missing`` says why, where the data hold no forces. In attrs: z_definition,
        minimum_contacts, anisotropy (signed or unsigned), state_count, default_force_threshold,
        error_bars.
    Raises:
        MissingData: there are no states, or frames.
        InvalidSettings: a threshold out of range, an unknown definition, or a frame that the run
            does not have.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    if isinstance(states, Run):
        _, z_definition, minimum = run_definitions(states, None, z_definition, minimum)
    definition, fewest = check_definition(z_definition or "z_backbone"), minimum or 2
    correlated, chosen = _chosen(states, direction, frame, window)
    thresholds: dict[Kind, Array] = {
        "force": _thresholds(force_thresholds, FORCE_THRESHOLDS, "force", 10.0),
        "gap": _thresholds(gap_thresholds, GAP_THRESHOLDS, "gap", 1.0),
    }
    replicas = bootstrap if len(chosen) == 1 else 0
    data: dict[str, tuple[str, Array, dict[str, str]]] = {}
    missing = []
    for kind, values in thresholds.items():
        pick = _force_networks if kind == "force" else _gap_networks
        try:
            tables = [
                [_row(s, n, replicas) for n in pick(s.packing, values, definition, fewest)]
                for s in chosen
            ]
        except MissingData as error:
            missing.append(f"{kind}: {error}")
            continue
        data |= _curves(kind, tables, correlated)
    if not data:
        raise MissingData("; ".join(missing))
    return xr.Dataset(
        data,
        coords={
            f"{kind}_threshold": (f"{kind}_threshold", thresholds[kind], describe(*_AXES[kind]))
            for kind in thresholds
            if f"z_{kind}" in data
        },
        attrs={
            "z_definition": definition,
            "minimum_contacts": fewest,
            "anisotropy": "unsigned" if chosen[0].direction is None else "signed",
            "state_count": len(chosen),
            "default_force_threshold": FORCE_FRACTION,
            "missing": "; ".join(missing),
            "error_bars": _error_text(len(chosen), replicas, correlated),
        },
    )


def criterion_sweep(
    packing: Packing,
    criteria: Sequence[str] = ("force", "gap:0.001", "gap:0.005", "gap:0.015", "gap:0.05"),
    *,
    z_definition: ZDefinition = "z_backbone",
    direction: Array | None = None,
) -> xr.Dataset:
    """z, a and az of one state for some named criteria (:func:`criterion_curves` for many).

    Args:
        packing: the state.
        criteria: words of the criteria.
        z_definition: the z, and the contacts that a uses.
        direction: axis of a', shape (D,).
    Returns:
        Variables of :func:`measure` over ``criterion``, and ``az`` with the z in use.
    """
    rows = [
        measure(packing, criterion=text, z_definition=z_definition, direction=direction)
        for text in criteria
    ]
    data = values_dataset(rows, "criterion", {"z_definition": z_definition})
    az = data["a"] * data[z_definition]
    data["az"] = az.assign_attrs(units="-", long_name=_QUANTITIES["az"])
    return data.assign_coords(criterion=list(criteria))


def _chosen(
    states: Packing | Run | Sequence[Packing | Frame],
    direction: Array | None,
    frame: int,
    window: float,
) -> tuple[bool, list[_State]]:
    """Whether the states are a series in strain, and the states."""
    if isinstance(states, Packing):
        return False, [_State(states, direction)]
    items: Sequence[Packing | Frame] = (
        _last_frames(states, frame, window) if isinstance(states, Run) else list(states)
    )
    if not items:
        raise MissingData("criterion curves need at least one state, got none")
    chosen = []
    for item in items:
        if isinstance(item, Packing):
            chosen.append(_State(item, direction))
        else:
            axis = item.direction if direction is None else direction
            chosen.append(_State(item.packing, axis))
    if len({state.direction is None for state in chosen}) > 1:
        raise InvalidSettings("packings and frames are mixed; give a direction for all of them")
    return not isinstance(items[0], Packing), chosen


def _last_frames(run: Run, frame: int, window: float) -> list[Frame]:
    """The frame and those of its stage within ``window`` of ∫|dε_q| before it."""
    count = len(run.frames)
    if count == 0:
        raise MissingData(f"run {run.name!r} has no recorded frames")
    if not -count <= frame < count:
        raise InvalidSettings(f"frame {frame}: run {run.name!r} holds frames 0..{count - 1}")
    if not 0.0 <= window < math.inf:
        raise InvalidSettings(f"window is {window}, must be a strain >= 0")
    last = run.frames[frame]
    found = [last]
    for index in range(frame % count - 1, -1, -1):
        earlier = run.frames[index]
        if earlier.stage != last.stage or earlier.eps_q_total < last.eps_q_total - window - 1e-9:
            break
        found.append(earlier)
    return found[::-1]


def _thresholds(given: ArrayLike | None, default: Array, name: str, highest: float) -> Array:
    if given is None:
        return default
    values = np.sort(np.atleast_1d(np.asarray(given, dtype=np.float64)))
    if not len(values) or not ((values >= 0.0) & (values <= highest)).all():
        raise InvalidSettings(
            f"{name}_thresholds are {values.tolist()}, must lie in 0..{highest:g}"
        )
    return values


def _force_networks(
    packing: Packing, thresholds: Array, definition: ZDefinition, minimum: int
) -> Iterator[Network]:
    if packing.contacts is None:
        raise MissingData("contacts are not in this data, so there is no force curve")
    normal_force(packing.contacts)
    for share in thresholds.tolist():
        rule = Criterion("force", share=share)
        yield select_network(packing, criterion=rule, z_definition=definition, minimum=minimum)


def _gap_networks(
    packing: Packing, thresholds: Array, definition: ZDefinition, minimum: int
) -> Iterator[Network]:
    """One search for all thresholds; walls are searched anew, since their list may end sooner."""
    found = neighbours_within(packing, float(thresholds.max()) * mean_diameter(packing))
    near = replace(packing, contacts=found, wall_contacts=None)
    for gap in thresholds.tolist():
        rule = Criterion("gap", gap)
        yield select_network(
            near, criterion=rule, z_definition=definition, minimum=minimum, reach=math.inf
        )


def _row(state: _State, network: Network, replicas: int) -> Row:
    row = {"z": network.z, "rattler_fraction": network.coordination.rattler_fraction}
    if not network.contacts.count:
        return row
    fabric = fabric_tensor(network.contacts)
    axis = state.direction
    a = anisotropy(fabric) if axis is None else signed_anisotropy(fabric, axis)
    row |= {"a": a, "az": a * network.z}
    if replicas:
        try:
            error = network_errors(state.packing, network, direction=axis, replicas=replicas)
        except MissingData:
            return row
        row |= {f"{name}_error": error["a_signed" if name == "a" else name] for name in _QUANTITIES}
    return row


def _curves(kind: Kind, tables: list[list[Row]], correlated: bool) -> dict:
    """Mean and standard error over the states of each quantity at each threshold."""
    data = {}
    spread: Callable[[Array], float] = _series_error if correlated else _independent_error
    for name, text in _QUANTITIES.items():
        value = _column(tables, name)
        if len(tables) == 1:
            error = _column(tables, f"{name}_error")[0]
        else:
            error = np.array([spread(column) for column in value.T])
        axis = f"{kind}_threshold"
        data[f"{name}_{kind}"] = (axis, value.mean(axis=0), describe(text))
        data[f"{name}_{kind}_error"] = (axis, error, describe(f"standard error of the {text}"))
    return data


def _column(tables: list[list[Row]], name: str) -> Array:
    """Shape (state_count, threshold_count), NaN where a state has no value."""
    return np.array([[row.get(name, math.nan) for row in rows] for rows in tables])


def _independent_error(values: Array) -> float:
    return float(values.std(ddof=1)) / math.sqrt(len(values))


def _series_error(values: Array) -> float:
    """Standard error of the mean of a series with exponential memory (Kendall's bias removed)."""
    count, centred = len(values), values - values.mean()
    power = float(centred @ centred)
    if count < _FEWEST_FOR_MEMORY or not power > 0.0:
        return _independent_error(values)
    raw = float(centred[1:] @ centred[:-1]) / power
    memory = min(max(raw + (1.0 + 3.0 * raw) / count, 0.0), 0.99)
    time = min((1.0 + memory) / (1.0 - memory), 0.5 * count)
    return _independent_error(values) * math.sqrt(time)


def _error_text(count: int, replicas: int, correlated: bool) -> str:
    if count == 1:
        return f"{replicas} resamples of blocks of grains" if replicas else "none"
    return "between frames, their memory in strain allowed for" if correlated else "between states"
