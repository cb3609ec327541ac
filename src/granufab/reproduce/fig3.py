"""Figure 3: orientations of the branches before and after shearing, in 2D and in 3D.

θ is counted from the direction of contraction, which lies at θ = 0 as in the paper.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from granufab.fabric import orientation, select_network
from granufab.history import Frame
from granufab.packing import Array, Contacts
from granufab.plots import new_figure, rose
from granufab.reproduce.recipe import Outcome, Recipe
from granufab.reproduce.two_samples import DISKS, SPHERES, WITHOUT_FIT, state_numbers

__all__ = ["RECIPE"]

CONTACTS_PER_BIN = 80
BINS = (12, 24)
"""Fewest and most bins."""

STATES = {"before": 0, "after": -1}


def _orientations(outcome: Outcome, name: str) -> dict[str, xr.Dataset]:
    """E(θ) before and after, over the contacts of all repeats."""
    found = {}
    for state, index in STATES.items():
        frames = [run.frames[index] for run in outcome.runs[name]]
        found[state] = _orientation(frames, outcome.z_definition)
    return found


def _orientation(frames: list[Frame], z_definition: Any) -> xr.Dataset:
    networks = [select_network(frame.packing, z_definition=z_definition) for frame in frames]
    normal = np.concatenate(
        [_turned(n.contacts.normal, f.direction) for n, f in zip(networks, frames, strict=True)]
    )
    pair = np.concatenate([network.contacts.pair for network in networks])
    grains = sum(network.grain_count for network in networks)
    bins = int(np.clip(len(pair) // CONTACTS_PER_BIN, *BINS))
    solid = normal.shape[1] == 3
    return orientation(
        Contacts(pair=pair, normal=normal),
        z=sum(network.z * network.grain_count for network in networks) / grains,
        bins=bins // 2 if solid else bins,
        axis=np.array([1.0, 0.0, 0.0]) if solid else None,
        criterion="force",
    )


def _turned(normal: Array, direction: Array) -> Array:
    """The normals in a frame whose first axis is the direction of contraction."""
    if normal.shape[1] == 2:
        return normal @ np.array([[direction[0], -direction[1]], [direction[1], direction[0]]])
    second = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    frame = [direction, second, np.cross(direction, second)]
    return np.asarray(np.column_stack([normal @ (k / np.linalg.norm(k)) for k in frame]))


def _draw(outcome: Outcome) -> Figure:
    figure, panels = new_figure(rows=2, height=6.0, share=False, projection="polar")
    for panel, name in zip(panels, ("disks", "spheres"), strict=True):
        rose(_orientations(outcome, name), ax=panel)
        polar = cast(PolarAxes, panel)
        polar.set_theta_zero_location("E")
        polar.set_theta_direction(1)
    for panel, title in zip(panels, ("(a) 2D", "(b) 3D"), strict=True):
        panel.set_title(title, loc="left", pad=3)
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    result = {}
    for name, runs in outcome.runs.items():
        orientations = _orientations(outcome, name)
        result[name] = {
            state: state_numbers(runs[0], runs[0].frames[STATES[state]]) | _harmonics(data)
            for state, data in orientations.items()
        }
    return {"orientation": result}


def _harmonics(data: xr.Dataset) -> dict[str, Any]:
    """The second-order fit and what it leaves out, as plain data."""
    modes = [int(mode) for mode in data["mode"].to_numpy()]
    amplitude, error = (data[key].to_numpy() for key in ("amplitude", "amplitude_error"))
    entry: dict[str, Any] = {
        "bins": data.sizes["theta"],
        "contacts": int(data.attrs["contact_count"]),
        "z_fitted": float(data.attrs["z"]),
        "a_fitted": float(data["a"]),
        "a_error": float(data["a_error"]),
        "modes": modes,
        "amplitude": amplitude.tolist(),
        "amplitude_error": error.tolist(),
        "share_above_2": float(data["share_above_2"]),
        "share_above_2_corrected": float(data["share_above_2_corrected"]),
        "misfit": float(data["misfit"]),
    }
    if "phase" in data:
        angle = float(data["phase"][0])
        entry["theta_c_degrees"] = angle - 180.0 if angle > 90.0 else angle
        entry["theta_c_error_degrees"] = float(data["phase_error"][0])
    columns = ("theta", "E", "E_error", "E_fit")
    return entry | {"distribution": {key: data[key].to_numpy().tolist() for key in columns}}


RECIPE = Recipe(
    figure="fig3",
    paths=(DISKS, SPHERES),
    draw=_draw,
    extra=_extra,
    without_fit=WITHOUT_FIT,
)
