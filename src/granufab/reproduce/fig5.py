"""Figure 5: z and a' against strain, from a dense and a loose start and through a reversal."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from granufab.plots import new_figure, series
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe
from granufab.reproduce.transients import dip, reversal

__all__ = ["RECIPE"]

STRAIN = 0.3


def _draw(outcome: Outcome) -> Figure:
    figure, panels = new_figure(rows=2, height=4.2)
    fit = outcome.fits["critical"]
    series(
        outcome.labelled,
        columns=(outcome.z_definition, "a_signed"),
        critical=(fit.z_star.value, fit.a_star.value),
        ax=panels,
    )
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(low - 0.12 * (high - low), high)  # the panel's letter covers no curve
    return figure


def _extra(outcome: Outcome) -> dict[str, Any]:
    dense = outcome.runs["dense"]
    return {
        "dip": dip(dense, outcome.z_definition),
        "reversal": reversal(dense, outcome.z_definition),
    }


RECIPE = Recipe(
    figure="fig5",
    paths=(
        PathRecipe(
            name="dense",
            label="dense, $z_0 = {z_0}$, reversed",
            coordination=4.0,
            strains=(STRAIN, -STRAIN),
        ),
        PathRecipe(name="loose", label="loose, $z_0 = {z_0}$", coordination=3.3),
    ),
    draw=_draw,
    extra=_extra,
)
