"""``granufab import``: what other programs' data hold, and a run file of it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from granufab.cli.foreign import ForeignOptions, Opened, foreign_options, open_run
from granufab.cli.output_files import check_new
from granufab.errors import InvalidPacking, InvalidSettings

__all__ = ["import_data"]


@foreign_options
def import_data(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Another program's data, one series.")
    ],
    foreign: ForeignOptions,
    out: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="NEW.h5", help="Write a run file.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace NEW.h5 if it exists.")] = False,
) -> None:
    """Read every state, say what was found, and write it as a run file if wanted."""
    from granufab.cli.output import print_json

    check_new(out, force)
    began = time.perf_counter()
    opened = open_run(files, foreign)
    if opened.summary is None:
        raise InvalidSettings(f"{opened.name}: this is a granufab run file already")
    if out is None:
        for frame in opened.run.frames:
            del frame  # before the next one is read
    else:
        _write(opened, out)
    cost = {"seconds": time.perf_counter() - began, "peak_memory_bytes": _peak_memory()}
    if json:
        print_json(opened.summary.plain() | cost | {"output": out})
        return
    for line in opened.summary.lines():
        print(line)
    print(f"read in {cost['seconds']:.3g} s, peak memory {cost['peak_memory_bytes'] / 1e6:.0f} MB")
    if out is not None:
        print(f"wrote {out}")


def _write(opened: Opened, out: Path) -> None:
    """All frames with a row of the series for each; every state is read once."""
    from dataclasses import replace

    from granufab.fabric import frame_series
    from granufab.io import RunFileWriter
    from granufab.io.schema import NAME_BYTES
    from granufab.io.summary import replacing

    run = opened.run
    source = {"imported_from": [str(file) for file in opened.files]}
    name = run.name.encode()[:NAME_BYTES].decode(errors="ignore")
    settings = {"name": name, **run.settings}
    with (
        replacing(out) as unfinished,
        RunFileWriter(unfinished, settings=settings, provenance=source) as writer,
    ):
        for place, frame in enumerate(run.frames):
            try:
                writer.frame(frame)
            except InvalidPacking as error:
                raise _other_grains(opened, place, error) from None
            row = frame_series(replace(run, frames=[frame]))
            values = {str(name): float(row[name][0]) for name in row.data_vars}
            writer.row({"path": name, **values})  # type: ignore[dict-item]
        writer.close(opened.summary.plain())


def _other_grains(opened: Opened, place: int, error: InvalidPacking) -> InvalidSettings:
    """Which frames a run file can hold, in the words of the command line."""
    from granufab.io import ForeignFrames

    frames = opened.run.frames
    assert isinstance(frames, ForeignFrames)
    first, differs = frames.number(0), frames.number(place)
    why = str(error).removesuffix("; write another file")
    return InvalidSettings(
        f"{opened.name}: {why}; a run file holds the same grains throughout: import "
        f"--frames {first}:{differs} or a later part, or give these files to measure, fit and "
        "plot as they are"
    )


def _peak_memory() -> float:
    """Largest memory of this process so far [byte]."""
    import resource
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak) * (1 if sys.platform == "darwin" else 1024)
