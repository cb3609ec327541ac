"""``granufab view``: a page in the browser, served from this machine or saved with its data."""

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
from granufab.cli.output_files import check_new
from granufab.cli.progress import show_progress
from granufab.errors import InvalidSettings

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
    export: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Write the page with its data inside instead."),
    ] = None,
    most: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help="Largest FILE, thinning frames; default 20MB."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
) -> None:
    """Look at runs in the browser; follows files that are still being written.

    Prints the address of the page, token included, and serves it until Ctrl-C or SIGTERM, which
    is the usual end: exit code 0. With --export it writes one file that opens from disk.
    """
    if export is not None:
        _export(files, foreign, export, most, force)
        return
    if most is not None or force:
        raise InvalidSettings(f"--{'force' if most is None else 'most'} is for --export FILE")
    from granufab.viewer.server import serve

    opened = open_runs(files, foreign)
    print_summaries(opened)

    def started(address: str) -> None:
        print(address, flush=True)
        if browser:
            webbrowser.open(address)

    with suppress(KeyboardInterrupt):
        serve([_viewed(one, foreign) for one in opened], port=port, started=started)


def _export(
    files: list[Path], foreign: ForeignOptions, export: Path, most: str | None, force: bool
) -> None:
    from granufab.io import ReadOptions
    from granufab.viewer.export import MOST, save_page, saved_page

    check_new(export, force)
    if export.suffix.lower() not in (".html", ".htm"):
        raise InvalidSettings(f"--export {export}: the name must end in .html")
    opened = open_runs(files, foreign, own=("frames",))
    print_summaries(opened)
    chosen = ReadOptions(frames=foreign.frames).frame_slice()
    parts = [slice(None) if one.foreign else chosen for one in opened]
    with show_progress() as progress:
        viewed = [_viewed(one, foreign) for one in opened]
        page = saved_page(viewed, frames=parts, most=most or MOST, progress=progress)
    save_page(page, export, force=force)
    print(f"wrote {export}, {len(page.content) / 1e6:.1f} MB")
    for line in page.lines:
        print(f"  {line}")


def _viewed(one: Opened, foreign: ForeignOptions) -> ViewedRun:
    from granufab.io import read
    from granufab.viewer.viewed_run import ViewedRun

    keywords = foreign.keywords() if one.foreign else {}
    return ViewedRun(one.name, one.files, lambda: read(*one.files, **keywords), run=one.run)
