"""The numbers of paper/paper.md, from the same JSON files as the documentation."""

from __future__ import annotations

from typing import Any

from figures_page import interval

Result = dict[str, Any]


def cells(data: dict[str, Any]) -> dict[str, str]:
    """The text of each marked place.

    Args:
        data: contents of the JSON files, by their names without ending.
    """
    dense, loose = data["figures"]["fig7"]["paths"][:2]
    fit = data["figures"]["fig7"]["fit"]["default"]
    changes = "tests/io/test_damaged_run_file.py::test_many_mutations_are_never_silent slow"
    counts = ("refused", "some frames", "same", "shorter")
    told = data["reliability"][changes]["told"]
    changed = sum(one.get(name, 0) for one in told for name in counts)
    extension = [
        path["z_star"]["value"] for path in data["triaxial"]["paths"] if path["mode"] == "extension"
    ]
    return {
        "force_z": _critical(data["critical-states"], "force"),
        "gap_z": _critical(data["critical-states"], "gap:0.015"),
        "dense_z": interval(dense["z_star"]),
        "loose_z": interval(loose["z_star"]),
        "z_min": interval(fit["z_min"]),
        "z_max": interval(fit["z_max"]),
        "changes": f"{changed:,}",
        "predicted": f"{data['triaxial']['predicted']['extension z_star']['value']:.2f}",
        "extension": f"{min(extension):.2f} to {max(extension):.2f}",
        **_peers(data["peers"]),
    }


def _critical(data: Result, criterion: str) -> str:
    row = next(r for r in data["rows"] if r["mu"] == 0.5 and r["criterion"] == criterion)
    return f"{row['z_backbone']['value']:.2f}"


def _peers(data: Result) -> dict[str, str]:
    theirs = [row for row in data["rows"] if row["program"] == "LAMMPS"]

    def beside(row: Result, kappa: float) -> Result:
        job = ("grains", "rate", "strain", "seed")
        return next(r for r in theirs if r["kappa"] == kappa and all(r[k] == row[k] for k in job))

    now = next(row for row in data["present"] if row["role"] == "default")
    stiff = beside(now, 1e5)
    fast = next(r for r in data["rows"] if r.get("role") == "default" and r["rate"] == 1e-3)
    return {
        "speed": f"{stiff['cpu_seconds'] / now['cpu_seconds']:.1f}",
        "apart": f"{now['z_backbone'] - stiff['z_backbone']:.3f}",
        "slower": f"{beside(fast, 1e4)['cpu_seconds'] / fast['cpu_seconds']:.1f}",
    }
