"""What a run says of its own measurement: criterion, definition of z, rattler rule, reach."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from granufab.fabric.coordination import ZDefinition, check_definition
from granufab.fabric.criterion import Criterion, parse_criterion
from granufab.fabric.rattlers import minimum_contacts
from granufab.history import Run

__all__ = ["recorded_reach", "run_definitions", "run_friction"]


def run_definitions(
    run: Run,
    criterion: str | Criterion | None = None,
    z_definition: ZDefinition | None = None,
    minimum: int | None = None,
) -> tuple[Criterion, ZDefinition, int]:
    """Criterion, definition of z and fewest contacts of a held grain: by default the run's own.

    A run without friction holds its grains by D + 1 contacts, any other by 2.

    Args:
        run: with the settings it was recorded with, if any.
        criterion: what counts as a contact, instead of the run's.
        z_definition: which grains count, instead of the run's.
        minimum: fewest contacts of a grain that is no rattler.
    Raises:
        InvalidSettings: an unknown criterion or definition.
    """
    record = _section(run, "record")
    rule = parse_criterion(criterion or record.get("criterion", "force"))
    definition = check_definition(z_definition or record.get("z_definition", "z_backbone"))
    if minimum is None:
        smooth = run_friction(run) == 0
        minimum = minimum_contacts("frictionless" if smooth else "frictional", run.dimension)
    return rule, definition, minimum


def recorded_reach(run: Run) -> float | None:
    """Gap up to which a run lists every pair [mean diameters]: no more than its search margin."""
    record, solver = _section(run, "record"), _section(run, "solver")
    if record.get("reach") is None:
        return None
    return min(float(record["reach"]), float(solver.get("skin", math.inf)))


def run_friction(run: Run) -> float | None:
    """Friction coefficient µ between the grains of a run [-], or None where it does not tell."""
    value = _section(run, "material").get("friction")
    return None if value is None else float(value)


def _section(run: Run, name: str) -> Mapping[str, Any]:
    section = run.settings.get(name, {})
    return section if isinstance(section, Mapping) else {}
