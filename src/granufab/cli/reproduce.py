"""``granufab reproduce``: a figure of the paper, from samples to fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

__all__ = ["reproduce"]

Figure = Literal["fig1", "fig2", "fig3", "fig4", "fig5", "fig6", "fig7", "fig8", "all"]


def reproduce(
    figure: Annotated[Figure, typer.Argument(help="Figure of Radjai et al. (2012), or all.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder; default ./granufab-FIGURE, which is replaced."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="1,000 grains a sample.")] = False,
    grains: Annotated[int | None, typer.Option(help="Grains in each sample.")] = None,
    seed: Annotated[int, typer.Option(help="First random seed.")] = 1,
    seeds: Annotated[int, typer.Option(help="Repeat with so many seeds.")] = 1,
    force: Annotated[
        bool, typer.Option("--force", help="Write into a folder that holds other files too.")
    ] = False,
) -> None:
    """Simulate, measure, fit and draw a figure, or all: figN.pdf .png .json .csv and run files.

    A simulation that several figures show is run once.
    """
    from granufab.cli.progress import show_progress
    from granufab.reproduce import reproduce as reproduce_figure

    with show_progress() as progress:
        result = reproduce_figure(
            figure,
            out=out,
            quick=quick,
            grains=grains,
            seed=seed,
            seeds=seeds,
            force=force,
            progress=progress,
        )
    _print_summary(figure, result, Path(f"granufab-{figure}") if out is None else out)


def _print_summary(figure: str, result: dict[str, Any], folder: Path) -> None:
    from granufab.cli.output import print_pairs, print_rows

    results = result if figure == "all" else {figure: result}
    rows = [(name, *row) for name, one in results.items() for row in _path_rows(one)]
    header = ("figure", "path", "z_0 wanted", "z_0 reached", "z*", "a*")
    print_rows("paths", header, rows)
    fits = [(name, *row) for name, one in results.items() for row in _fit_rows(one)]
    if fits:
        print()
        print_rows("accessible domain", ("figure", "fit", "z_min", "z_max"), fits)
    print()
    print_pairs("solver", [*_solver_pairs(results), ("files in", folder)])
    warnings = {
        f"warning: {path['name']}: {text}": None
        for one in results.values()
        for path in one["paths"]
        for text in path.get("warnings", ())
    }
    for line in warnings:
        print(line)


def _path_rows(result: dict[str, Any]) -> list[tuple]:
    return [
        (
            *(path[key] for key in ("name", "z_0_wanted", "z_0")),
            *(_interval(path[key]) for key in ("z_star", "a_star")),
        )
        for path in result["paths"]
    ]


def _fit_rows(result: dict[str, Any]) -> list[tuple]:
    return [
        (name, *(_interval(fit.get(key)) for key in ("z_min", "z_max")))
        for name, fit in (result["fit"] or {}).items()
    ]


def _solver_pairs(results: dict[str, dict[str, Any]]) -> list[tuple[str, Any]]:
    """Definitions and, of a single figure, how well it was solved."""
    from granufab.cli.run import solver_pairs

    *_, last = results.values()
    pairs = [("contact criterion", last["criterion"]), ("z is", last["z_definition"])]
    if len(results) == 1:
        pairs += solver_pairs(last["solver"])
    return [*pairs, ("wall seconds", last["wall_seconds"])]


def _interval(estimate: dict[str, float] | None) -> str | None:
    if estimate is None:
        return None
    return f"{estimate['value']:.3f} ({estimate['low']:.3f} to {estimate['high']:.3f})"
