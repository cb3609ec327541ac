"""``granufab plot``: a figure of one or several runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from granufab.cli.choices import Definition
from granufab.cli.foreign import ForeignOptions, foreign_options, open_runs, print_summaries
from granufab.cli.output_files import check_figure
from granufab.cli.plot_figures import FIGURES, Request

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot"]

Name = Literal[
    "path", "zaz", "series", "mohr", "rose", "network", "homogeneity", "velocity", "fluctuations",
    "balance", "branches", "forces", "texture", "sff", "criterion",
]  # fmt: skip


@foreign_options
def plot(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN", help="Run files, or other programs' data.")
    ],
    foreign: ForeignOptions,
    figure: Annotated[Name, typer.Option(help="What is drawn; sff: stress, force and fabric.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="PDF, PNG, SVG…, by its ending.")
    ],
    frame: Annotated[
        int, typer.Option(metavar="K", help="State that is drawn; default the last.")
    ] = -1,
    criterion: Annotated[
        str | None,
        typer.Option(
            metavar="force|gap:δ|listed", help="Contacts of a state; default the run's own."
        ),
    ] = None,
    z_definition: Annotated[Definition, typer.Option(help="Which z.")] = "z_backbone",
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
) -> None:
    """Draw a run.

    path, zaz and series draw whole paths; velocity, fluctuations and balance the later half of
    the stage up to the state; the others that state.
    """
    from granufab.fabric import run_definitions, with_series

    check_figure(output, force)
    opened = open_runs(runs, foreign)
    whole = FIGURES[figure].whole
    request = Request(
        figure=figure,
        runs={one.name: with_series(one.run) if whole else one.run for one in opened},
        index=frame,
        criterion=criterion or run_definitions(opened[0].run)[0].text,
        z_definition=z_definition,
    )
    print_summaries(opened)
    panel = FIGURES[figure](request)
    cast("Figure", panel.figure).savefig(output, dpi=300)
