"""The part of the result of ``granufab reproduce all`` that the pages draw on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Result = dict[str, Any]

KEPT = (
    *("seed", "criterion", "z_definition", "states", "environment", "texture", "velocity_field"),
    *("dip", "reversal", "mohr", "fits"),
)
"""Parts of a result that are stored as they are."""


def kept(result: Result) -> Result:
    """What the pages need of a figure's result."""
    cases = {
        name: {
            "sample": {"grain_count": case["sample"]["grain_count"]},
            "material": {"friction": case["material"]["friction"]},
            "path": [{"inertial_number": case["path"][0]["inertial_number"]}],
        }
        for name, case in result["settings"]["cases"].items()
    }
    part = {name: result[name] for name in KEPT if name in result}
    part["settings"] = {"seeds": result["settings"]["seeds"], "cases": cases}
    solver = ("tolerance", "stiffness", "steps", "nonconverged_steps")
    part["solver"] = {name: result["solver"][name] for name in solver}
    named = ("name", "z_0", "z_star", "a_star")
    part["paths"] = [{key: path[key] for key in named} for path in result["paths"]]
    if result["fit"] is not None:
        part["fit"] = {"default": result["fit"]["default"]}
    if "orientation" in result:
        part["orientation"] = {
            name: {
                state: {key: value for key, value in data.items() if key != "distribution"}
                for state, data in states.items()
            }
            for name, states in result["orientation"].items()
        }
    return part


def gathered(folder: Path) -> dict[str, Result]:
    """What is kept of ``folder/fig1.json`` … ``fig8.json``."""
    names = [f"fig{number}" for number in range(1, 9)]
    return {
        name: kept(json.loads((folder / f"{name}.json").read_text(encoding="utf-8")))
        for name in names
    }
