"""``granufab reproduce``: a figure of the paper, from samples to fit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

__all__ = ["reproduce"]

Figure = Literal["fig5", "fig6", "fig7", "fig8"]


def reproduce(
    figure: Annotated[Figure, typer.Argument(help="Figure of Radjai et al. (2012).")],
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
    """Simulate, measure, fit and draw a figure; writes figN.pdf .png .json .csv and run files."""
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
    from granufab.cli.run import solver_pairs

    paths = [
        (
            *(path[key] for key in ("name", "z_0_wanted", "z_0")),
            *(_interval(path[key]) for key in ("z_star", "a_star")),
        )
        for path in result["paths"]
    ]
    print_rows(figure, ("path", "z_0 wanted", "z_0 reached", "z*", "a*"), paths)
    fits = [
        (name, *(_interval(fit.get(key)) for key in ("z_min", "z_max")))
        for name, fit in result["fit"].items()
    ]
    print()
    print_rows("accessible domain", ("fit", "z_min", "z_max"), fits)
    print()
    definitions = [("contact criterion", result["criterion"]), ("z is", result["z_definition"])]
    pairs = [*definitions, *solver_pairs(result["solver"])]
    print_pairs("solver", [*pairs, ("wall seconds", result["wall_seconds"]), ("files in", folder)])
    for path in result["paths"]:
        for warning in path.get("warnings", ()):
            print(f"warning: {path['name']}: {warning}")


def _interval(estimate: dict[str, float] | None) -> str | None:
    if estimate is None:
        return None
    return f"{estimate['value']:.3f} ({estimate['low']:.3f} to {estimate['high']:.3f})"
