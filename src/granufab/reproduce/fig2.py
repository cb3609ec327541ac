"""Figure 2: the geometry of one contact, and one grain's environment with angular exclusions.

Both are drawn to scale from grains of a sheared packing; every angle is in the JSON file.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from granufab.errors import MissingData
from granufab.fabric import Network, branch_vectors, select_network, texture
from granufab.fabric.environment import environment
from granufab.history import Frame
from granufab.packing import Contacts, Packing
from granufab.plots import new_figure
from granufab.plots.environment import contact_geometry, grain_environment
from granufab.reproduce.recipe import Outcome, Recipe
from granufab.reproduce.two_samples import DISKS, WITHOUT_FIT, state_numbers

__all__ = ["RECIPE"]

WANTED = 4
"""Contacts of the grain whose environment is drawn."""

SLANT = 25.0
"""Preferred direction of the contact that is drawn [degree]."""


def _state(outcome: Outcome) -> tuple[Frame, Network]:
    frame = outcome.runs["disks"][0].frames[-1]
    definition: Any = outcome.z_definition
    return frame, select_network(frame.packing, z_definition=definition)


def _draw(outcome: Outcome) -> Figure:
    frame, network = _state(outcome)
    packing, contacts = frame.packing, network.contacts
    figure, panels = new_figure(rows=2, height=5.0, share=False, ratios=(0.6, 1.0))
    contact_geometry(packing, contacts, _choose_contact(packing, contacts), ax=panels[0])
    grain_environment(packing, contacts, _choose_grain(packing, contacts), ax=panels[1])
    for panel, letter in zip(panels, "ab", strict=True):
        panel.set_title(f"({letter})", loc="left", pad=3)
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    frame, network = _state(outcome)
    packing, contacts = frame.packing, network.contacts
    return {
        "state": state_numbers(outcome.runs["disks"][0], frame),
        "contact": _contact_numbers(packing, contacts, _choose_contact(packing, contacts)),
        "environment": _grain_numbers(packing, contacts, _choose_grain(packing, contacts)),
        "texture": _texture_numbers(packing, outcome.z_definition),
    }


def _contact_numbers(packing: Packing, contacts: Contacts, contact: int) -> dict[str, Any]:
    i, j = (int(k) for k in contacts.pair[contact])
    chosen = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    branch, normal = branch_vectors(chosen)[contact], contacts.normal[contact]
    radius = packing.grains.radius
    return {
        "grains": [i, j],
        "radii": [float(radius[i]), float(radius[j])],
        "branch": branch.tolist(),
        "branch_length": float(np.linalg.norm(branch)),
        "normal": normal.tolist(),
        "theta_degrees": float(np.degrees(np.arctan2(normal[1], normal[0]))),
        "contact_vector": (radius[i] * normal).tolist(),
    }


def _grain_numbers(packing: Packing, contacts: Contacts, grain: int) -> dict[str, Any]:
    around = environment(packing, contacts, grain)
    degrees = {
        "theta_degrees": around.angle,
        "angle_to_next_degrees": around.step,
        "exclusion_to_next_degrees": around.exclusion,
        "room_to_next_degrees": around.step - around.exclusion,
    }
    return {
        "grain": grain,
        "radius": float(packing.grains.radius[grain]),
        "contacts": len(around.neighbour),
        "neighbours": around.neighbour.tolist(),
        "radii": packing.grains.radius[around.neighbour].tolist(),
        **{name: np.degrees(values).tolist() for name, values in degrees.items()},
    }


def _texture_numbers(packing: Packing, z_definition: Any) -> dict[str, float]:
    """Exclusions of the whole packing, beside those of the one grain."""
    found = texture(packing, z_definition=z_definition)
    angles = ("delta_theta", "delta_theta_geometric", "smallest_angle")
    numbers = {f"{name}_degrees": float(np.degrees(found[name])) for name in angles}
    return numbers | {"z_steric": float(found["z_steric"])}


def _choose_grain(packing: Packing, contacts: Contacts) -> int:
    """A grain with four contacts (or nearly so), of middle size, evenly surrounded."""
    number = np.bincount(contacts.pair.ravel(), minlength=packing.grains.count)
    if number.max() < 2:
        raise MissingData("no grain has two contacts, so there are no angles between contacts")
    distance = np.where(number < 2, np.inf, np.abs(number - WANTED))
    candidates = np.flatnonzero(distance == distance.min())
    size = packing.grains.radius / packing.grains.radius.mean()
    nearest = candidates[np.argsort(np.abs(size[candidates] - 1), kind="stable")][:40]
    widest = [environment(packing, contacts, int(grain)).step.max() for grain in nearest]
    return int(nearest[int(np.argmin(widest))])


def _choose_contact(packing: Packing, contacts: Contacts) -> int:
    """A contact of a large grain with a small one to its upper right."""
    angle = np.degrees(np.arctan2(contacts.normal[:, 1], contacts.normal[:, 0]))
    one, two = packing.grains.radius[contacts.pair].T
    contrast = (one - two) / (one + two)
    return int(np.argmin(np.abs(angle - SLANT) / 10.0 - 20.0 * contrast))


RECIPE = Recipe(
    figure="fig2",
    paths=(DISKS,),
    draw=_draw,
    extra=_extra,
    without_fit=WITHOUT_FIT,
)
"""Of several repeats the first is drawn."""
