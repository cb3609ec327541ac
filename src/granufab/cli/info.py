"""``granufab info``: what a file is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["info"]


def info(
    file: Annotated[Path, typer.Argument(help="A run file.")],
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
) -> None:
    """Say what a file holds: format, grains, states, how far the run went, versions."""
    from granufab.cli.output import print_json, print_pairs
    from granufab.io import describe

    found = {"file": str(file), **describe(file)}
    if json:
        print_json(found)
        return
    versions = found.pop("provenance", None) or {}
    pairs = [*found.items(), *((f"  {name}", value) for name, value in versions.items())]
    print_pairs("", [(name.replace("_", " "), value) for name, value in pairs])
