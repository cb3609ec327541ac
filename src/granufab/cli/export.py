"""``granufab export``: states written in other programs' formats."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from granufab.cli.foreign import (
    ForeignOptions,
    foreign_options,
    frame_place,
    open_run,
    print_summaries,
)

__all__ = ["export"]


@foreign_options
def export(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Run file, or another program's data.")
    ],
    foreign: ForeignOptions,
    out: Annotated[
        Path, typer.Option("-o", "--output", metavar="OUT", help="Its ending tells the format.")
    ],
    format: Annotated[
        str | None, typer.Option(metavar="KEY", help="Format that is written, if not the ending's.")
    ] = None,
    input_format: Annotated[
        str | None, typer.Option(metavar="KEY", help="Format that is read; default by the content.")
    ] = None,
    frame: Annotated[
        int | None, typer.Option(metavar="K", help="One state only; negative from the end.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it exists.")] = False,
) -> None:
    """Write states for ParaView, OVITO, LAMMPS, YADE, ON-DEM tools, or as CSV."""
    from granufab.cli.output import listed
    from granufab.io import write

    opened = open_run(files, replace(foreign, format=input_format))
    what: Any = opened.run
    if frame is not None:
        what = opened.run.frames[frame_place(opened.run, opened.name, frame)].packing
    written = write(what, out, format=format, force=force)
    print_summaries([opened])
    print(f"wrote {listed(written)}")
