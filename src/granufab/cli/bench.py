"""``granufab bench``: how fast the engine is on this machine, as ratios."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from granufab.cli.output_files import check_new

__all__ = ["bench"]

STANDARD_OUTPUT = Path("-")


def bench(
    quick: Annotated[bool, typer.Option("--quick", help="Within a minute.")] = False,
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write all numbers; - prints them."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
    tiny: Annotated[bool, typer.Option("--tiny", hidden=True)] = False,
) -> None:
    """Time the kernels beside plain C++, the solver beside plain Gauss–Seidel, threads, a step."""
    printed = json == STANDARD_OUTPUT
    if not printed:
        check_new(json, force)
    from granufab.bench.suite import QUICK, TINY, USUAL, run_suite
    from granufab.cli.output import print_json
    from granufab.cli.progress import show_progress
    from granufab.io import write_json

    extent = TINY if tiny else (QUICK if quick else USUAL)
    with show_progress() as progress:
        report = run_suite(extent, progress=progress)
    if printed:
        print_json(report)
        return
    _print(report)
    if json is not None:
        write_json(report, json)


def _print(report: dict[str, Any]) -> None:
    from granufab.bench.suite import HEADLINES
    from granufab.cli.output import print_pairs, print_rows

    machine, versions = report["machine"], report["versions"]
    print_pairs(
        "machine",
        [
            ("  processor", f"{machine['processor']}, {machine['usable_cores']} cores"),
            ("  vector sets", " ".join(machine["vector_sets"])),
            ("  numba, LLVM", f"{versions['numba']}, {versions['llvm']}"),
            ("  C++ compiler", versions["compiler"] or "none found: no C++ reference"),
        ],
    )
    print_rows("kernels, ns per contact update", _KERNELS, map(_kernel_cells, report["kernels"]))
    print_rows("solvers", _SOLVERS, map(_solver_cells, report["solvers"]))
    if report["threads"]:
        print_rows("threads, ns per contact update", _THREADS, map(_cells, report["threads"]))
    step = report["step"]
    print_rows(
        f"a step of {step['grains']} disks at residual {step['tolerance']:g}, ms",
        [*step["ms_by_stage"], "whole"],
        [[*step["ms_by_stage"].values(), step["ms_per_step"]]],
    )
    rows = [(name, report[name], meaning) for name, meaning in HEADLINES.items()]
    print_rows("ratios", ("name", "value", "of"), rows)


_KERNELS = ("dimension", "contacts", "scalar", "fast", "C++", "scalar / C++", "fast / C++")
_SOLVERS = (
    *("disks", "residual", "steps", "sweeps plain", "accelerated", "ratio"),
    *("seconds plain", "accelerated", "ratio", "stopped plain", "accelerated"),
)
_THREADS = ("contacts", "kernel", "one thread", "two threads", "ratio")


def _kernel_cells(row: dict[str, Any]) -> list[Any]:
    numbers = [row[f"{name}_ns"] for name in ("scalar", "fast", "reference")]
    ratios = [_spread(row[f"{name}_ratio"]) for name in ("scalar", "fast")]
    return [row["dimension"], row["contacts"], *numbers, *ratios]


def _solver_cells(row: dict[str, Any]) -> list[Any]:
    both = (row["plain"], row["accelerated"])
    cells = [row["grains"], row["tolerance"], row["steps"]]
    cells += [part["sweeps_mean"] for part in both] + [row["sweeps_ratio"]]
    cells += [part["seconds"] for part in both] + [row["time_ratio"]]
    return cells + [part["stopped"] for part in both]


def _cells(row: dict[str, Any]) -> list[Any]:
    numbers = [row["contacts"], row["kernel"], row["one_ns"], row["two_ns"]]
    return [*numbers, _spread(row["ratio"])]


def _spread(ratio: Any) -> str | None:
    """The median with its quartiles."""
    if ratio is None:
        return None
    return f"{ratio.median:.3f} ({ratio.low:.3f} to {ratio.high:.3f})"
