"""Figure 1: contact networks of disks and of spheres, both after shearing."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from granufab.plots import network, network_3d, new_figure
from granufab.plots.style import COLUMN
from granufab.reproduce.recipe import Outcome, Recipe
from granufab.reproduce.two_samples import DISKS, SPHERES, WITHOUT_FIT, state_numbers

__all__ = ["RECIPE"]

PART = 8.0
"""Diameter of the ball of spheres that is drawn [mean diameters]."""


def _draw(outcome: Outcome) -> Figure:
    disks = outcome.runs["disks"][0].frames[-1].packing
    spheres = outcome.runs["spheres"][0].frames[-1].packing
    shape = 1.0
    if disks.cell is not None:
        extent = np.abs(disks.cell.matrix).sum(axis=1)
        shape = float(extent[1] / extent[0])
    ratios = (shape, 0.95)
    figure, panels = new_figure(
        rows=2, height=COLUMN * (sum(ratios) + 0.14), share=False, ratios=ratios
    )
    network(disks, ax=panels[0])
    network_3d(spheres, part=PART, ax=panels[1])
    for panel, title in zip(panels, ("(a) 2D", "(b) 3D"), strict=True):
        panel.set_title(title, loc="left", pad=3)
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    states = {}
    for name, runs in outcome.runs.items():
        states[name] = state_numbers(runs[0], runs[0].frames[-1])
    return {"states": states, "part_drawn": {"spheres": {"diameter": PART}}}


RECIPE = Recipe(
    figure="fig1",
    paths=(DISKS, SPHERES),
    draw=_draw,
    extra=_extra,
    without_fit=WITHOUT_FIT,
)
"""One sample of each is drawn, whatever the number of repeats."""
