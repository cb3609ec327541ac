"""The tables of docs/benchmarks.md from the result of ``benchmarks/suite.py``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

Result = dict[str, Any]


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A Markdown table; a dash where a value is unknown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(_text(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def _text(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def ratio(value: Result | None) -> str:
    """Median with quartiles."""
    if value is None:
        return "–"
    return f"{value['median']:.2f} ({value['low']:.2f} to {value['high']:.2f})"


def machine(data: Result) -> str:
    """One paragraph on what it ran on."""
    m, v = data["machine"], data["versions"]
    return (
        f"{m['processor']}, {m['usable_cores']} cores ({' '.join(m['vector_sets'])}); Python "
        f"{v['python']}, numba {v['numba']}, LLVM {v['llvm']}, numpy {v['numpy']}; "
        f"{v['compiler'] or 'no C++ compiler'}, `{v['compiler_flags'] or '–'}`."
    )


def kernels(rows: list[Result]) -> str:
    """ns per contact update beside C++."""
    header = ("", "contacts", "scalar", "fast", "C++", "scalar / C++", "fast / C++")
    return table(
        header,
        (
            [
                f"{r['dimension']}D",
                r["contacts"],
                *(r[f"{name}_ns"] for name in ("scalar", "fast", "reference")),
                *(ratio(r[f"{name}_ratio"]) for name in ("scalar", "fast")),
            ]
            for r in rows
        ),
    )


def threads(rows: list[Result]) -> str:
    """One thread beside two."""
    if not rows:
        return "Not measured: the engine sweeps on one thread."
    header = ("contacts", "kernel", "one thread", "two threads", "ratio")
    names = ("contacts", "kernel", "one_ns", "two_ns")
    return table(header, ([*(r[n] for n in names), ratio(r["ratio"])] for r in rows))


def solvers(rows: list[Result]) -> str:
    """Sweeps and seconds, plain beside accelerated."""
    header = (
        *("state", "start", "disks", "steps", "residual", "sweeps plain", "accelerated", "ratio"),
        *("seconds plain", "accelerated", "ratio", "stopped plain", "accelerated"),
    )
    return table(header, map(_solver_cells, rows))


def _solver_cells(row: Result) -> list[Any]:
    both = (row["plain"], row["accelerated"])
    cells = [row["state"], row["start"], row["grains"], row["steps"], f"{row['tolerance']:.0e}"]
    cells += [f"{part['sweeps_mean']:.0f}" for part in both] + [row["sweeps_ratio"]]
    cells += [part["seconds"] for part in both] + [row["time_ratio"]]
    return cells + [part["stopped"] for part in both]


def growth(rows: list[Result]) -> str:
    """Exponent x of sweeps ∝ N^x, by residual, from the consecutive steps."""
    words = []
    for tolerance in sorted({row["tolerance"] for row in rows}, reverse=True):
        chosen = [row for row in rows if row["tolerance"] == tolerance]
        if len({row["grains"] for row in chosen}) < 2:
            continue
        size = np.log([row["grains"] for row in chosen])
        exponents = [
            np.polyfit(size, np.log([row[kind]["sweeps_mean"] for row in chosen]), 1)[0]
            for kind in ("plain", "accelerated")
        ]
        words.append(f"{tolerance:.0e}: {exponents[0]:.2f} plain, {exponents[1]:.2f} accelerated")
    return "Sweeps grow as Nˣ, x at residual " + "; ".join(words) + "." if words else ""


def copies(rows: list[Result]) -> str:
    """Sweeps on one sample, and on copies of a part of it."""
    header = ("disks", "sheared as", "steps", "residual", "sweeps plain", "accelerated", "ratio")
    return table(
        header,
        (
            [
                r["grains"],
                "one sample" if r["source"] >= r["grains"] else f"copies of {r['source']}",
                r["steps"],
                f"{r['tolerance']:.0e}",
                *(f"{r[kind]['sweeps_mean']:.0f}" for kind in ("plain", "accelerated")),
                r["sweeps_ratio"],
            ]
            for r in rows
        ),
    )


def step(rows: list[Result]) -> str:
    """Where a step's time goes."""
    stages = list(rows[0]["ms_by_stage"])
    header = ("disks", "residual", "sweeps", *(f"{name} [ms]" for name in stages), "whole [ms]")
    return table(
        (*header, "ns per update", "outside the sweeps"),
        (
            [
                r["grains"],
                f"{r['tolerance']:.0e}",
                f"{r['sweeps_mean']:.0f}",
                *r["ms_by_stage"].values(),
                r["ms_per_step"],
                r["ns_per_update"],
                f"{100 * r['outside_sweeps_fraction']:.0f} %",
            ]
            for r in rows
        ),
    )


def curve(rows: list[Result]) -> str:
    """Cost of an update against size."""
    names = ("grains", "contacts", "kernel", "ns")
    return table(
        ("", "grains", "contacts", "kernel", "ns per update", "over the first"),
        ([f"{r['dimension']}D", *(r[n] for n in names), ratio(r["relative"])] for r in rows),
    )


def memory(rows: list[Result]) -> str:
    """Memory against size."""
    names = ("grains", "contacts", "peak_megabytes", "bytes_per_grain")
    header = ("disks", "contacts", "peak [MB]", "bytes per grain")
    return table(header, ([r[name] for name in names] for r in rows))


def start(times: Result) -> str:
    """Start-up times."""
    meaning = {
        "help_seconds": "`granufab --help`",
        "import_seconds": "`import granufab.simulate`",
        "first_use_seconds": "50 disks compacted and sheared, empty compile cache",
        "cached_use_seconds": "the same, compiled before",
    }
    return table(("", "seconds"), ([text, times[name]] for name, text in meaning.items()))


def figures(rows: list[Result]) -> str:
    """Wall times of the main command."""
    header = ("command", "seconds", "worst residual", "tolerance", "unconverged steps", "I")
    names = ("seconds", "residual_max", "tolerance", "nonconverged_steps", "inertial_number")
    return table(header, ([f"`{r['command']}`", *(r[name] for name in names)] for r in rows))


def tables(data: Result) -> dict[str, str]:
    """The text between each pair of the page's markers, for the parts that were measured."""
    makers = {
        "kernels": kernels, "threads": threads, "problems": solvers, "consecutive": solvers,
        "copies": copies,
        "step": step, "curve": curve, "memory": memory, "start": start, "figures": figures,
    }  # fmt: skip
    found = {name: make(data[name]) for name, make in makers.items() if name in data}
    if "consecutive" in data:
        found["growth"] = growth(data["consecutive"])
    return {"machine": machine(data), **found}
