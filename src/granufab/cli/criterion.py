"""``granufab criterion``: z, a and az of a run against what counts as a contact."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from granufab.cli.choices import Definition
from granufab.cli.foreign import (
    ForeignOptions,
    foreign_options,
    frame_numbers,
    frame_place,
    open_run,
    print_summaries,
)
from granufab.cli.output_files import check_figure
from granufab.errors import InvalidSettings

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from granufab.history import Run

__all__ = ["criterion"]

QUANTITIES = ("z", "a", "az", "rattler_fraction")
HEADER = ("threshold", "z", "±", "a", "±", "az", "±", "rattlers", "±")
KINDS = {"force": "normal force above [mean normal forces]", "gap": "gap below [mean diameters]"}


@foreign_options
def criterion(
    files: Annotated[
        list[Path], typer.Argument(metavar="RUN", help="Run file, or another program's data.")
    ],
    foreign: ForeignOptions,
    frame: Annotated[
        int, typer.Option(metavar="K", help="State, or the last of the window; default the last.")
    ] = -1,
    window: Annotated[
        float,
        typer.Option(metavar="STRAIN", help="Average the frames of this ∫|dε_q| before it."),
    ] = 0.0,
    z_definition: Annotated[
        Definition | None, typer.Option(help="Which z; default the run's own.")
    ] = None,
    bootstrap: Annotated[
        int, typer.Option(metavar="N", help="Resamples for the errors of one state; 0 for none.")
    ] = 200,
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Also draw the curves.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
) -> None:
    """Curves of z, a and az against a force and a gap threshold, with error bars."""
    from granufab.cli.output import print_json, print_rows
    from granufab.fabric import criterion_curves

    check_figure(output, force)
    if bootstrap < 0:
        raise InvalidSettings(f"--bootstrap {bootstrap}: must be >= 0")
    opened = open_run(files, foreign)
    run, loaded = opened.name, opened.run
    place = frame_place(loaded, run, frame)
    curves = criterion_curves(
        loaded, frame=place, window=window, z_definition=z_definition, bootstrap=bootstrap
    )
    print_summaries([opened])
    entry = _entry(run, loaded, place, window, curves) | opened.skipped()
    if json:
        print_json(entry)
    else:
        for kind in (k for k in KINDS if k in entry):
            title = f"{KINDS[kind]}; {curves.attrs['z_definition']}; {run}"
            names = ["threshold", *(f"{n}{e}" for n in QUANTITIES for e in ("", "_error"))]
            print_rows(title, HEADER, zip(*(entry[kind][name] for name in names), strict=True))
    if curves.attrs["missing"]:
        print(f"granufab: {run}: {curves.attrs['missing']}", file=sys.stderr)
    if output is not None:
        from granufab.plots import criterion_curves as draw

        cast("Figure", draw(curves)[0].figure).savefig(output, dpi=300)


def _entry(source: str, run: Run, place: int, window: float, curves: xr.Dataset) -> dict[str, Any]:
    """The curves as plain lists, one object per kind of threshold."""
    entry: dict[str, Any] = {
        "source": source,
        "frame": frame_numbers(run)[place],
        "eps_q": run.frames[place].eps_q,
        "window": window,
        **{name: curves.attrs[name] for name in ("z_definition", "minimum_contacts")},
        **{name: curves.attrs[name] for name in ("anisotropy", "state_count", "error_bars")},
    }
    for kind in KINDS:
        if f"z_{kind}" not in curves:
            continue
        entry[kind] = {"threshold": curves[f"{kind}_threshold"].values.tolist()}
        for name in QUANTITIES:
            for error in ("", "_error"):
                entry[kind][f"{name}{error}"] = curves[f"{name}_{kind}{error}"].values.tolist()
    return entry
