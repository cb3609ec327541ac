"""The rows of one or more jobs as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]


def setting_of(row: Row) -> tuple[Any, ...]:
    """What tells one row of the table from another, the seed apart."""
    return (
        row["grains"], row["rate"], row["program"], _number(row["kappa"]), row["residual"] or 0.0,
        row.get("time_step_setting") or 0.0, row.get("tangential") or 0.0, row.get("role") or "",
    )  # fmt: skip


def grouped(rows: Sequence[Row]) -> list[list[Row]]:
    """Rows of the same setting together, programs and stiffnesses in order."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(setting_of(row), []).append(row)
    order = sorted(groups, key=lambda key: (key[0], key[1], key[2] != "LAMMPS", *key[3:]))
    return [groups[key] for key in order]


def seconds_of(rows: Sequence[Row]) -> float:
    """Mean CPU seconds."""
    return float(np.mean([row["cpu_seconds"] for row in rows]))


def ratio(reference: Sequence[Row], rows: Sequence[Row]) -> float | None:
    """Mean of reference / row CPU seconds over the seeds that both have; None without any."""
    theirs = {row["seed"]: row["cpu_seconds"] for row in reference}
    shared = [theirs[row["seed"]] / row["cpu_seconds"] for row in rows if row["seed"] in theirs]
    return float(np.mean(shared)) if shared else None


def difference(reference: Sequence[Row], rows: Sequence[Row], name: str) -> float | None:
    """Mean of row − reference of one measure over the seeds that both have."""
    theirs = {row["seed"]: row[name] for row in reference}
    shared = [row[name] - theirs[row["seed"]] for row in rows if row["seed"] in theirs]
    return float(np.mean(shared)) if shared else None


def report(rows: Sequence[Row], references: Sequence[float]) -> str:
    """One table for each job that the rows hold, with the rates and strains in both measures.

    Args:
        rows: of any jobs.
        references: κ of the LAMMPS rows to compare with.
    """
    parts = []
    for job in sorted({(row["grains"], row["rate"], row["strain"]) for row in rows}):
        same = [row for row in rows if (row["grains"], row["rate"], row["strain"]) == job]
        walked = float(np.mean([row["eps_q_end"] for row in same]))
        grains, rate, strain = job
        parts.append(
            f"**{grains} disks, axial I = {rate:g} (I_q ≈ {2 * rate:g}), "
            f"ε_1 = 0 to {strain:g} (ε_q to {walked:.2f})**\n\n" + table(same, references)
        )
    return "\n\n".join(parts)


def table(rows: Sequence[Row], references: Sequence[float] = ()) -> str:
    """One table of a job; the last columns compare with LAMMPS at the stiffnesses asked for.

    Args:
        rows: of one number of grains and rate.
        references: κ of the LAMMPS rows to compare with; those that were not run are left out.
    """
    groups = grouped(rows)
    theirs = [(k, g) for k in references for g in groups if _is_lammps(g[0], k)]
    names = [
        "program", "κ", "residual", "h", "seeds", "z_backbone", "z", "rattlers", "a", "q/p",
        "σ_lateral", "sweeps", "capped", "CPU s", "timed", "wall s", "load",
    ]  # fmt: skip
    names += [f"Δz, speed against LAMMPS {_kappa(k)}" for k, _ in theirs]
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    for group in groups:
        cells = [*_settings(group[0]), str(len(group)), *_answers(group), *_costs(group)]
        cells += [_against(reference, group) for _, reference in theirs]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _is_lammps(row: Row, kappa: float) -> bool:
    return row["program"] == "LAMMPS" and _number(row["kappa"]) == kappa


def _number(kappa: float | str) -> float:
    return float("inf") if kappa == "rigid" else float(kappa)


def _kappa(kappa: float | str) -> str:
    return kappa if isinstance(kappa, str) else f"{kappa:.1e}".replace(".0e", "e").replace("+0", "")


def _settings(row: Row) -> list[str]:
    residual = "–" if row["residual"] is None else f"{row['residual']:.0e}".replace("-0", "-")
    name = row["program"] + (f", {row['role']}" if row.get("role") else "")
    return [name, _kappa(row["kappa"]), residual, f"{row['time_step']:.2g}"]


def _answers(rows: Sequence[Row]) -> list[str]:
    def cell(name: str) -> str:
        values = np.array([row[name] for row in rows])
        spread = f" ± {np.ptp(values) / 2:.3f}" if len(values) > 1 else ""
        return f"{values.mean():.3f}{spread}"

    share = 100 * float(np.mean([row["rattler_fraction"] for row in rows]))
    stress = float(np.mean([row["lateral_stress"] for row in rows]))
    scatter = float(np.mean([row["lateral_scatter"] for row in rows]))
    middle = [cell("z_backbone"), cell("z"), f"{share:.1f} %", cell("a"), cell("q_over_p")]
    return [*middle, f"{stress:.3f} ± {scatter:.3f}"]


def _costs(rows: Sequence[Row]) -> list[str]:
    first = rows[0]
    sweeps = "–" if first["sweeps"] is None else f"{np.mean([r['sweeps'] for r in rows]):.0f}"
    capped = first["unconverged"]
    capped = "–" if capped is None else f"{100 * np.mean([r['unconverged'] for r in rows]):.2f} %"
    wall = float(np.mean([row["seconds"] for row in rows]))
    load = float(np.mean([row["load_before"] for row in rows]))
    timed = "/".join(str(len(row["timings"])) for row in rows)
    return [sweeps, capped, f"{seconds_of(rows):.3g}", timed, f"{wall:.3g}", f"{load:.1f}"]


def _against(reference: Sequence[Row], rows: Sequence[Row]) -> str:
    apart, faster = difference(reference, rows, "z_backbone"), ratio(reference, rows)
    return "–" if apart is None else f"{apart:+.3f}, {faster:.3g} ×"


def present(rows: Sequence[Row], earlier: Sequence[Row]) -> str:
    """Rows of the present solver beside the LAMMPS rows of the same samples among earlier ones.

    Args:
        rows: granufab's, timed after the others.
        earlier: those of the large table.
    """
    if not rows:
        return "None: all rows above are of this version."
    names = ("settings", "κ", "residual", "h", "sample", "z_backbone", "CPU s")
    kappas = (1e4, 1e5)
    against = [f"Δz, speed against LAMMPS {_kappa(kappa)}" for kappa in kappas]
    lines = ["| " + " | ".join((*names, *against)) + " |", "|" + "---|" * (len(names) + 2)]
    for row in sorted(rows, key=lambda r: (not r["role"], *setting_of(r)[3:6], r["seed"])):
        cells = [row["role"] or "chosen", _kappa(row["kappa"]), f"{row['residual']:.0e}"]
        cells += [f"{row['time_step_setting']:g}", str(row["seed"])]
        cells += [f"{row['z_backbone']:.3f}", f"{row['cpu_seconds']:.1f}"]
        for kappa in kappas:
            theirs = [one for one in earlier if _is_lammps(one, kappa) and _same_job(one, row)]
            cells.append(_against(theirs, [row]))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _same_job(one: Row, other: Row) -> bool:
    return all(one[name] == other[name] for name in ("grains", "rate", "strain", "seed"))
