"""The samples of disks and of spheres that Figs 1 to 3 look at."""

from __future__ import annotations

from typing import Any

from granufab.fabric import measure
from granufab.history import Frame, Run
from granufab.reproduce.recipe import PathRecipe

__all__ = ["DISKS", "SPHERES", "WITHOUT_FIT", "state_numbers"]

DISKS = PathRecipe(name="disks", label="disks", coordination=3.7)
"""The dense path of Figs 6 and 7."""

SPHERES = PathRecipe(name="spheres", label="spheres", dimension=3, compaction_friction=0.1)
"""Triaxial compression at constant mean stress."""

WITHOUT_FIT = "the figure shows single states; no accessible domain is fitted"

NAMES = (
    "z",
    "z_backbone",
    "z_mechanical",
    "rattler_fraction",
    "a",
    "a_signed",
    "q_over_p",
    "phi",
    "contact_count",
    "grain_count",
)


def state_numbers(run: Run, frame: Frame) -> dict[str, Any]:
    """Where on its path a state lies, and its fabric, as plain data."""
    values = measure(
        frame.packing,
        z_definition=run.settings["record"]["z_definition"],
        direction=frame.direction,
        minor=frame.extension,
    )
    place = {"dimension": frame.packing.dimension, "eps_q": frame.eps_q}
    return place | {name: values[name] for name in NAMES}
