"""Table and figures of the convergence study, from the jobs that ``convergence.py`` left."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from convergence import means

from granufab.plots import new_figure, save

QUANTITIES = ("z_backbone", "a_signed", "q_over_p")
LABELS = {
    "z_backbone": r"$z_\mathrm{backbone}$ [-]",
    "a_signed": r"$a'$ [-]",
    "q_over_p": r"$q/p$ [-]",
    "overlap": r"worst overlap [$d$]",
}
TRUSTED = 0.01
Key = tuple[float, float, float, float]


def load(folder: Path) -> dict[Key, dict[str, dict[str, float]]]:
    """Means of every job: by (residual, k/p, I, strain per step), then by sample."""
    found: dict[Key, dict[str, dict[str, float]]] = defaultdict(dict)
    for path in sorted(folder.glob("*.json")):
        data = json.loads(path.read_text())
        s = {name: float(value) for name, value in data["setting"].items()}
        key = (s["tolerance"], s["stiffness"], s["inertial"], s["step"])
        found[key][f"{data['sample'][0]}{data['sample'][2]}"] = means(data)
    return dict(found)


def compare(
    runs: dict[str, dict[str, float]], reference: dict[str, dict[str, float]], name: str
) -> tuple[float, float, int]:
    """Mean paired difference over the common samples, its standard error, and their number."""
    common = sorted(set(runs) & set(reference))
    difference = np.array([runs[s][name] - reference[s][name] for s in common])
    if name == "q_over_p":
        difference = difference / np.array([reference[s][name] for s in common])
    if len(common) < 2:
        return float(difference.mean()) if len(common) else math.nan, math.nan, len(common)
    error = float(difference.std(ddof=1) / math.sqrt(len(common)))
    return float(difference.mean()), error, len(common)


def trusted(runs: dict[str, dict[str, float]]) -> bool:
    """Whether fewer than 1 % of the steps of every run ended unconverged."""
    return max(run["unconverged"] for run in runs.values()) < TRUSTED


def reference_of(table: dict[Key, Any], stiffness: float, inertial: float, step: float) -> Key:
    """The tightest trustworthy residual at this stiffness, rate and step."""
    rows = [k for k in table if k[1:] == (stiffness, inertial, step) and trusted(table[k])]
    return min(rows)


def rows_of(table: dict[Key, Any]) -> list[dict[str, Any]]:
    """One row per setting: means, paired differences to its reference, cost."""
    rows = []
    for key in sorted(table, key=lambda k: (-k[2], k[3], k[1], -k[0])):
        runs = table[key]
        tolerance, stiffness, inertial, step = key
        reference = reference_of(table, stiffness, inertial, step)
        row: dict[str, Any] = {
            "residual": tolerance,
            "stiffness": "rigid" if math.isinf(stiffness) else stiffness,
            "inertial_number": inertial,
            "step_strain": step,
            "samples": len(runs),
            "reference_residual": reference[0],
        }
        for name in (*QUANTITIES, "z"):
            row[name] = float(np.mean([run[name] for run in runs.values()]))
        for name in QUANTITIES:
            row[f"{name}_difference"] = compare(runs, table[reference], name)[:2]
        row["overlap"] = max(run["overlap"] for run in runs.values())
        row["unconverged"] = max(run["unconverged"] for run in runs.values())
        for name in ("sweeps", "steps", "seconds", "contact_updates"):
            row[name] = float(np.mean([run[name] for run in runs.values()]))
        rows.append(row)
    return rows


def markdown(rows: list[dict[str, Any]]) -> str:
    """The table of the docs page."""
    head = (
        "| I | k/p | strain/step | residual | z_backbone | Δ | a' | Δ | q/p | Δ [%] | overlap/d "
        "| unconverged | sweeps/step | updates/10⁹ |\n|" + "---|" * 14
    )
    lines = [head]
    for r in rows:
        cells = [f"{r['inertial_number']:.0e}"]
        cells.append(r["stiffness"] if isinstance(r["stiffness"], str) else f"{r['stiffness']:.1e}")
        cells += [f"{r['step_strain']:.0e}", f"{r['residual']:.0e}"]
        for name in QUANTITIES:
            difference, error = r[f"{name}_difference"]
            factor, digits = (100, 1) if name == "q_over_p" else (1, 3)
            cells.append(f"{r[name]:.3f}")
            same = r["residual"] == r["reference_residual"]
            text = f"{factor * difference:+.{digits}f} ± {factor * error:.{digits}f}"
            cells.append("reference" if same else text)
        cells += [f"{r['overlap']:.1e}", f"{100 * r['unconverged']:.2f} %", f"{r['sweeps']:.0f}"]
        cells.append(f"{r['contact_updates'] / 1e9:.2f}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def draw(table: dict[Key, Any], axis: int, curves: dict[str, Any], label: str, stem: Path) -> None:
    """z_backbone, a', q/p and the worst overlap against one setting; bars over samples."""
    figure, axes = new_figure(height=6.0, rows=4)
    for text, wanted in curves.items():
        keys = sorted(k for k in table if wanted(k))
        if not keys:
            continue
        x = [k[axis] for k in keys]
        for ax, name in zip(axes, (*QUANTITIES, "overlap"), strict=True):
            values = [np.array([run[name] for run in table[k].values()]) for k in keys]
            mean = [v.max() if name == "overlap" else v.mean() for v in values]
            error = [
                0.0 if name == "overlap" or len(v) < 2 else v.std(ddof=1) / math.sqrt(len(v))
                for v in values
            ]
            ax.errorbar(x, mean, yerr=error, marker="o", markersize=3, capsize=2, label=text)
            ax.set_ylabel(LABELS[name])
    axes[0].set_xscale("log")
    axes[3].set_yscale("log")
    axes[3].axhline(2e-3, color="0.6", linewidth=0.8, linestyle=":")
    axes[3].set_xlabel(label)
    if axes[0].get_legend_handles_labels()[0]:
        axes[0].legend(fontsize=7, frameon=False)
    save(figure, stem)


def write(folder: Path, docs: Path) -> str:
    """Numbers and figures into ``docs``; returns the table as Markdown."""
    table = load(folder)
    rows = rows_of(table)
    images = docs / "images"
    images.mkdir(parents=True, exist_ok=True)
    (docs / "convergence.json").write_text(json.dumps(rows, indent=1))
    names = {1.6e4: "1.6·10⁴", 5e4: "5·10⁴", 1.6e5: "1.6·10⁵", math.inf: "rigid"}

    def at(stiffness: float, inertial: float, step: float) -> Any:
        return lambda k: k[1:] == (stiffness, inertial, step)

    residual = {f"$k/p$ = {t}": at(k, 1e-3, 5e-5) for k, t in names.items()}
    draw(table, 0, residual, "residual [-]", images / "convergence-residual")
    slow = {"$k/p$ = 5·10⁴": at(5e4, 1e-4, 5e-6), "rigid": at(math.inf, 1e-4, 2e-5)}
    draw(table, 0, slow, "residual [-]", images / "convergence-slow")
    one = {"$k/p$ = 1.6·10⁵": lambda k: k[1] == 1.6e5 and k[0] == CHOSEN and _rate_step(k)}
    draw(table, 2, one, r"inertial number $I$ [-]", images / "convergence-rate")
    one = {"$k/p$ = 1.6·10⁵, $I$ = 10⁻³": lambda k: k[:3] == (CHOSEN, 1.6e5, 1e-3)}
    draw(table, 3, one, r"$\varepsilon_q$ per step [-]", images / "convergence-step")
    return markdown(rows).rstrip()


CHOSEN = 1e-4


def _rate_step(key: Key) -> bool:
    """Settings of the rate axis: one step size per inertial number."""
    step = {1e-2: 1e-4, 3e-3: 1e-4, 1e-3: 5e-5, 3e-4: 1.5e-5, 1e-4: 5e-6, 3e-5: 5e-6}
    return math.isclose(step.get(key[2], -1.0), key[3])
