"""Figure 7: two samples on their way to the critical state in the (z, a) plane.

The paper's z_0 are 3.7 and 3.1; its friction is not given. Mean stress and strain rate are
constant, as in all of its simulations.
"""

from __future__ import annotations

from matplotlib.figure import Figure

from granufab.plots import new_figure, path
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe

__all__ = ["RECIPE"]


def _draw(outcome: Outcome) -> Figure:
    figure, panels = new_figure()
    path(
        outcome.labelled,
        domain=outcome.fits["critical"],
        z_definition=outcome.z_definition,
        ax=panels[0],
    )
    return figure


RECIPE = Recipe(
    figure="fig7",
    paths=(
        PathRecipe(name="dense", label="$z_0 = {z_0}$", coordination=3.7),
        PathRecipe(name="loose", label="$z_0 = {z_0}$", coordination=3.1),
    ),
    draw=_draw,
)
