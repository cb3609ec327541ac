"""Figure 6: Mohr circles of the fabric between the limit states, and the critical circle."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from granufab.plots import mohr as draw_circles
from granufab.plots import new_figure
from granufab.plots.style import letter_panels
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe, column
from granufab.states import MohrCircle, critical_circle, mohr

__all__ = ["RECIPE"]

STRAIN = 0.02
"""Where the circles of the first panel are taken [-]."""

HALF_WINDOW = 0.005
"""States within this strain are averaged for one circle [-]."""


def _circles(outcome: Outcome) -> dict[str, MohrCircle]:
    circles = {}
    for path in outcome.recipe.paths:
        circles[outcome.labels[path.name]] = mohr(*_state(outcome, path.name, STRAIN))
    return circles


def _state(outcome: Outcome, name: str, strain: float) -> tuple[float, float]:
    states = []
    for run in outcome.runs[name]:
        near = np.abs(column(run.series, "eps_q_total") - strain) <= HALF_WINDOW
        if near.any():
            z, a = (column(run.series, key)[near] for key in (outcome.z_definition, "a_signed"))
            states.append((z.mean(), a.mean()))
    z, a = np.mean(states, axis=0)
    return float(z), float(a)


def _draw(outcome: Outcome) -> Figure:
    figure, panels = new_figure(rows=2, height=4.1, share=False, ratios=(1.2, 1))
    fit = outcome.fits["critical"]
    draw_circles(_circles(outcome), domain=fit, critical=False, ax=panels[0])
    draw_circles(domain=fit, ax=panels[1])
    letter_panels(panels)
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    domain = outcome.fits["critical"].domain
    circle = critical_circle(domain)
    return {
        "mohr": {
            "critical": {"centre": circle.centre, "radius": circle.radius},
            "eps_q": STRAIN,
            "tangent_angle_degrees": float(np.degrees(domain.tangent_angle)),
            "circles": [
                {"label": label, "z": c.z, "a": c.a, "centre": c.centre, "radius": c.radius}
                for label, c in _circles(outcome).items()
            ],
        }
    }


RECIPE = Recipe(
    figure="fig6",
    paths=(
        PathRecipe(name="dense", label="$z_0 = {z_0}$", coordination=3.7),
        PathRecipe(name="loose", label="$z_0 = {z_0}$", coordination=3.1),
    ),
    draw=_draw,
    extra=_extra,
)
