"""``granufab info``: what a file is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from granufab.cli.foreign import ForeignOptions, Opened, foreign_options, open_run

__all__ = ["info"]


@foreign_options
def info(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="A run file, or another program's data.")
    ],
    foreign: ForeignOptions,
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
) -> None:
    """Say what a file holds: format, grains, states, how far the run went, versions."""
    from granufab.cli.output import print_json, print_pairs
    from granufab.io import describe

    opened = open_run(files, foreign)
    found: dict[str, Any] = {"file": opened.name}
    found |= describe(files[0]) if opened.summary is None else _describe_foreign(opened)
    if json:
        print_json(found)
        return
    versions = found.pop("provenance", None) or {}
    pairs = [*found.items(), *((f"  {name}", value) for name, value in versions.items())]
    print_pairs("", [(name.replace("_", " "), value) for name, value in pairs])


def _size(path: Path) -> int:
    """Bytes of a file, or of the files in a folder."""
    files = path.iterdir() if path.is_dir() else (path,)
    return sum(file.stat().st_size for file in files if file.is_file())


def _describe_foreign(opened: Opened) -> dict[str, Any]:
    """What is known from the first state."""
    packing = opened.run.frames[0].packing
    cell = packing.cell
    return {
        "format": opened.summary.format,
        "files": [str(file) for file in opened.files],
        "name": opened.run.name,
        "dimension": packing.dimension,
        "grain_count": packing.grains.count,
        "contact_count": None if packing.contacts is None else packing.contacts.count,
        "forces": packing.contacts is not None and packing.contacts.force is not None,
        "cell": None if cell is None else cell.matrix.diagonal().tolist(),
        "periodic": None if cell is None else list(cell.periodic),
        "frames": len(opened.run.frames),
        **opened.skipped(),
        "bytes": sum(_size(file) for file in opened.files),
        "notes": list(opened.summary.notes),
    }
