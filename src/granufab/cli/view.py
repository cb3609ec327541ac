"""``granufab view``: a page in the browser, served from this machine."""

from __future__ import annotations

import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from granufab.cli.foreign import (
    ForeignOptions,
    Opened,
    foreign_options,
    open_runs,
    print_summaries,
)

if TYPE_CHECKING:
    from granufab.viewer.viewed_run import ViewedRun

__all__ = ["view"]


@foreign_options
def view(
    files: Annotated[
        list[Path], typer.Argument(metavar="RUN", help="Run files, or other programs' data.")
    ],
    foreign: ForeignOptions,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="On 127.0.0.1; 0 for a free one.")
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
) -> None:
    """Look at runs in the browser; follows files that are still being written.

    Prints the address of the page, token included, and serves it until Ctrl-C or SIGTERM, which
    is the usual end: exit code 0.
    """
    from granufab.viewer.server import serve

    opened = open_runs(files, foreign)
    print_summaries(opened)

    def started(address: str) -> None:
        print(address, flush=True)
        if browser:
            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve([_viewed(one, foreign) for one in opened], port=port, started=started)


def _viewed(one: Opened, foreign: ForeignOptions) -> ViewedRun:
    from granufab.io import read
    from granufab.viewer.viewed_run import ViewedRun

    keywords = foreign.keywords() if one.foreign else {}
    return ViewedRun(one.name, one.files, lambda: read(*one.files, **keywords), run=one.run)
