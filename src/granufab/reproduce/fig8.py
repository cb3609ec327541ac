"""Figure 8: one sample sheared with five friction coefficients, in the (z, az) plane.

All five paths start from the same sample, made once. Each has its
own accessible domain; the file's ``fit`` is that of µ = 0.5, ``fits`` holds all.
"""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from granufab.plots import new_figure, zaz
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe
from granufab.reproduce.report import fit_entry

__all__ = ["FRICTIONS", "RECIPE"]

FRICTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)


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
        fits.append({"friction": path.friction, **fit_entry(outcome.path_fits[path.name])})
    return {"fits": fits}


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
