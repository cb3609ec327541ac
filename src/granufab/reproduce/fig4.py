"""Figure 4: mean relative velocities around a disk in simple shear, beside the affine field."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from granufab.fabric.velocity_field import velocity_field
from granufab.plots.velocity_field import velocity_panels
from granufab.reproduce.recipe import Outcome, PathRecipe, Recipe

__all__ = ["RECIPE"]

STEADY = 0.1
"""Strain from which the field is averaged [-]."""

WINDOW = 1
"""Recorded intervals over which velocities are averaged; instantaneous ones jump."""


def _field(outcome: Outcome) -> xr.Dataset:
    run = outcome.runs["shear"][0]
    return velocity_field(run, window=WINDOW, strain=(STEADY, np.inf))


def _draw(outcome: Outcome) -> Figure:
    return cast(Figure, velocity_panels(_field(outcome))[0].figure)


def _extra(outcome: Outcome) -> dict[str, Any]:
    field = _field(outcome)
    profile = ("distance", "normal_share", "tangential_share", "pair_count")
    errors = ("normal_share_error", "tangential_share_error")
    return {
        "velocity_field": {
            "eps_q_from": STEADY,
            "states": int(field.attrs["states"]),
            "window": WINDOW,
            "mean_branch": float(field.attrs["length"]),
            "rate": field["rate"].to_numpy().tolist(),
            "rate_far": field["rate_far"].to_numpy().tolist(),
            "rate_far_error": field["rate_far_error"].to_numpy().tolist(),
            **{name: field[name].to_numpy().tolist() for name in (*profile, *errors)},
        }
    }


RECIPE = Recipe(
    figure="fig4",
    paths=(
        PathRecipe(name="shear", label="simple shear", coordination=3.7, loading="simple-shear"),
    ),
    draw=_draw,
    extra=_extra,
    without_fit="the figure shows a mean velocity field; no accessible domain is fitted",
)
"""Of several repeats the first is drawn."""
