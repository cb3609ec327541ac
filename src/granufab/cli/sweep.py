"""``granufab sweep``: a campaign of many cases, from its settings to one table of results."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from granufab.cli.output_files import check_figure
from granufab.errors import InvalidSettings

__all__ = ["sweep"]

MOST_FAILURES = 10  # that are told one by one


def sweep(
    campaign: Annotated[
        Path,
        typer.Argument(metavar="SWEEP.toml|DIR", help="The campaign (granufab new sweep), or its "
                       "folder with --gather or --plot."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder; default SWEEP.toml without its ending."),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(metavar="local|ADDRESS|slurm|pbs|sge", help="Run on Dask (extra: sweep)."),
    ] = None,
    manifest: Annotated[
        bool, typer.Option("--manifest", help="Write job scripts instead of running.")
    ] = False,
    gather: Annotated[
        bool, typer.Option("--gather", help="Run nothing; collect what is done.")
    ] = False,
    retry: Annotated[bool, typer.Option("--retry", help="Run failed cases again.")] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Cases at a time; default by the cores.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of each case.")] = None,
    plot: Annotated[
        str | None, typer.Option(metavar="PARAMETER", help="Draw the results over it, with -o.")
    ] = None,
    by: Annotated[
        str | None, typer.Option(metavar="PARAMETER", help="One line for each of its values.")
    ] = None,
    quantity: Annotated[
        list[str] | None,
        typer.Option(help="What is drawn; repeatable; default z_star, a_star, z_min, z_max."),
    ] = None,
    where: Annotated[
        list[str] | None,
        typer.Option(metavar="PARAMETER=VALUE", help="Draw only these cases; repeatable."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FIGURE", help="PDF, PNG, SVG….")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FIGURE if it exists.")] = False,
    json: Annotated[bool, typer.Option("--json", help="The summary as JSON.")] = False,
) -> None:  # fmt: skip
    """Run one case over parameters and seeds; the same command continues what was interrupted.

    Leaves cases.csv, results.nc, summary.json and cases/ID/ in DIR.
    """
    if (plot is None) != (output is None):
        raise InvalidSettings("--plot PARAMETER and -o FIGURE belong together; give both")
    check_figure(output, force)
    if plot is not None and output is not None:
        _draw(campaign if out is None else out, plot, output, by, quantity or [], where or [])
        return
    if manifest and (dask or gather):
        raise InvalidSettings("--manifest writes scripts only; leave out --dask and --gather")
    if campaign.is_dir():
        if not gather:
            raise InvalidSettings(f"{campaign}: is a folder; give SWEEP.toml, --gather or --plot")
        _collect(campaign)
        return
    folder = out or campaign.with_suffix("")
    options = {"workers": workers, "threads": threads, "retry": retry}
    summary = _run(campaign, folder, manifest, options, {"dask": dask, "gather_only": gather})
    _report(summary, folder, json)


def _run(
    campaign: Path,
    folder: Path,
    manifest: bool,
    options: dict[str, Any],
    how: dict[str, Any],
) -> dict[str, Any]:
    from granufab.campaign import prepare_manifest, run_campaign
    from granufab.cli.sweep_progress import show_campaign

    if manifest:
        summary = prepare_manifest(campaign, folder, **options)
        print(
            f"granufab: {folder}: manifest.csv with the settings of {summary['cases']} cases; "
            "cd there, then: sbatch job-array.sh, or: sh run-all.sh; granufab sweep "
            f"{campaign} --out {folder} --gather collects",
            file=sys.stderr,
        )
        return summary
    with show_campaign() as progress:
        return run_campaign(campaign, folder, progress=progress, **options, **how)


def _report(summary: dict[str, Any], folder: Path, json: bool) -> None:
    """Print the summary; end with its exit code."""
    from granufab.cli.output import print_json, print_pairs

    for text in _words(summary):
        print(f"granufab: {text}", file=sys.stderr)
    if json:
        print_json(summary)
    else:
        states = ("done", "failed", "interrupted", "waiting")
        counts = [(state, summary[state]) for state in states if summary[state] or state == "done"]
        spent = [("seconds", summary["seconds"]), ("seconds of cases", summary["seconds_of_cases"])]
        files = [("results", folder / summary["results"])] if summary["results"] else []
        print_pairs(
            f"{summary['name']}: {summary['cases']} cases",
            [*counts, *spent, *files, ("table", folder / "cases.csv")],
        )
    if summary["stopped"]:
        raise KeyboardInterrupt
    if summary["failed"]:
        raise typer.Exit(1)


def _words(summary: dict[str, Any]) -> list[str]:
    failures = summary["failures"]
    texts = [f"{name}: failed: {failures[name]}" for name in list(failures)[:MOST_FAILURES]]
    if failures:
        texts.append(
            f"{len(failures)} of {summary['cases']} cases failed, see cases.csv; "
            "--retry runs them again"
        )
    kept = summary["unwanted"]
    if kept:
        texts.append(
            f"{len(kept)} cases are no longer in SWEEP.toml: kept in their folders, left out of "
            f"the results ({kept[0]}{', …' if len(kept) > 1 else ''})"
        )
    return texts


def _collect(folder: Path) -> None:
    from granufab.campaign import gather
    from granufab.cli.output import print_pairs
    from granufab.io import write_dataset

    found = gather(folder)
    write_dataset(found, folder / "results.nc")
    pairs = [("done", found.sizes["case"]), ("results", folder / "results.nc")]
    print_pairs(str(found.attrs["name"]), pairs)


def _draw(
    folder: Path, plot: str, output: Path, by: str | None, quantity: list[str], where: list[str]
) -> None:
    from matplotlib.figure import Figure

    from granufab.campaign import gather
    from granufab.plots import parameter_curves
    from granufab.plots.parameters import QUANTITIES

    if not folder.is_dir():
        raise InvalidSettings(f"{folder}: is no folder; --plot draws the results of DIR")
    chosen: dict[str, str] = {}
    for text in where:
        name, equals, value = text.partition("=")
        if not equals:
            raise InvalidSettings(f"--where {text}: expected PARAMETER=VALUE")
        chosen[name.strip()] = value.strip()
    drawn = quantity or QUANTITIES
    panels = parameter_curves(gather(folder), plot, by=by, where=chosen, quantities=drawn)
    figure = panels[0].figure
    assert isinstance(figure, Figure)
    figure.savefig(output, dpi=300)
