"""Figure 8: one sample sheared with five friction coefficients, in the (z, az) plane.

All five paths start from the same sample, made once. Each has its
own accessible domain; the file's ``fit`` is that of µ = 0.5, ``fits`` holds all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from granufab.plots import new_figure, zaz
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe, column
from granufab.reproduce.report import fit_entry

__all__ = ["FRICTIONS", "RECIPE"]

FRICTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
APPROACHED, FEWEST_RECORDS = 0.9, 4


def _draw(outcome: Outcome) -> Figure:
    figure, panels = new_figure(height=3.1)
    zaz(
        outcome.labelled,
        domain={outcome.labels[name]: fit for name, fit in outcome.path_fits.items()},
        z_definition=outcome.z_definition,
        ax=panels[0],
    )
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    fits = []
    for path in outcome.recipe.paths:
        entry = {"friction": path.friction, **fit_entry(outcome.path_fits[path.name])}
        fits.append({**entry, "approach": _approach(outcome, path.name)})
    return {"fits": fits}


def _approach(outcome: Outcome, name: str) -> dict[str, float] | None:
    """Straight line a z = s (z_max − z) through the approach to the critical state.

    Least squares over the records before a z first reaches 90 % of its critical value; on the
    gain-saturation line s = 2. None where the path has too few records there, or does not come
    down in z by 0.1.
    """
    fit = outcome.path_fits[name]
    z_star, a_star = fit.z_star.value, fit.a_star.value
    points = []
    for run in outcome.runs[name]:
        z, a = (column(run.series, key) for key in (outcome.z_definition, "a_signed"))
        reached = np.flatnonzero(a * z >= APPROACHED * a_star * z_star)
        end = int(reached[0]) if len(reached) else len(z)
        points.append(np.column_stack([z[:end], (a * z)[:end]]))
    z, az = np.concatenate(points).T
    if len(z) < FEWEST_RECORDS or z.max() - z_star < 0.1:
        return None
    slope, height = np.polyfit(z, az, 1)
    return {"slope": -float(slope), "z_max": -float(height / slope), "records": float(len(z))}


RECIPE = Recipe(
    figure="fig8",
    paths=tuple(
        PathRecipe(name=f"mu{mu:g}", label=rf"$\mu = {mu:g}$", coordination=3.72, friction=mu)
        for mu in FRICTIONS
    ),
    grain_count=13_000,
    draw=_draw,
    extra=_extra,
    fit_from="mu0.5",
    fit_each=True,
)
