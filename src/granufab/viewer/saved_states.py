"""The numbers of one frame for a saved page, under every criterion that it offers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from granufab.errors import MissingData
from granufab.history import Frame, Run
from granufab.viewer.choice import Choice
from granufab.viewer.saved_rules import Rule
from granufab.viewer.state_data import state_data

__all__ = ["DIGITS", "saved_states"]

DIGITS = 6
"""Significant digits of what is only drawn: the rose, its curve and its surface."""
_EVERY = 2
"""Of the points of curves and surfaces under a level, one in so many."""


def saved_states(run: Run, frame: Frame, rules: Sequence[Rule]) -> bytes:
    """JSON: ``states`` by "place of the criterion, definition", ``units``, ``criterion``.

    ``values``, ``point`` and the fit stay exactly those of
    :func:`~granufab.viewer.state_data.state_data`; ``criterion`` is
    :func:`~granufab.viewer.state_data.criterion_data` at the levels, without error bars.
    """
    states: dict[str, Any] = {}
    for place, rule in enumerate(rules):
        for definition in rule.definitions:
            state = _state(run, frame, rule.under(definition))
            states[f"{place} {definition}"] = _drawn(state, rule.kind in ("force", "gap"))
    units: dict[str, Any] = {}
    for state in states.values():
        units |= state.pop("units", {})
    for state in states.values():
        state["values"] = state["values"] or dict.fromkeys(units)
    data = {"units": units, "states": states, "criterion": _sliders(states, rules)}
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode()


def _state(run: Run, frame: Frame, choice: Choice) -> dict[str, Any]:
    try:
        return state_data(run, frame, choice)
    except MissingData as error:
        return {
            "criterion": choice.criterion.text, "z_definition": choice.z_definition,
            "values": {}, "missing": str(error), "rose": None, "mohr": None,
            "point": {"z": None, "a": None, "az": None},
        }  # fmt: skip


def _drawn(state: dict[str, Any], coarse: bool) -> dict[str, Any]:
    """A state whose rose is rounded, and under a level drawn with fewer points."""
    rose = state["rose"]
    if rose is None:
        return state
    every = slice(None, None, _EVERY if coarse else 1)
    curve = {name: _rounded(values[every]) for name, values in rose["curve"].items()}
    rose = {**rose, "curve": curve}
    for name in ("theta", "E", "E_error"):
        rose[name] = _rounded(rose[name])
    surface = rose.get("surface")
    if surface is not None:
        rose["surface"] = {
            "theta": _rounded(surface["theta"][every]),
            "azimuth": _rounded(surface["azimuth"][every]),
            "E": [_rounded(row[every]) for row in surface["E"][every]],
        }
    return {**state, "rose": rose}


def _rounded(values: Sequence[float | None]) -> list[float | None]:
    return [None if value is None else float(f"{value:.{DIGITS}g}") for value in values]


def _sliders(states: dict[str, Any], rules: Sequence[Rule]) -> dict[str, Any]:
    """The track of each slider from the states at its levels."""
    found: dict[str, Any] = {"missing": None, "z_definition": rules[0].choice.z_definition}
    for kind in ("force", "gap"):
        places = [place for place, rule in enumerate(rules) if rule.kind == kind]
        if not places:
            continue
        mine = [states[f"{place} {rules[place].definitions[0]}"] for place in places]
        rows = {name: [state["point"][name] for state in mine] for name in ("z", "a", "az")}
        rows["rattler_fraction"] = [state["values"].get("rattler_fraction") for state in mine]
        found[kind] = {
            "threshold": [rules[place].threshold for place in places],
            **rows,
            **{f"{name}_error": [None] * len(places) for name in rows},
        }
    return found
