"""``granufab repair``: a clean copy of what is sound in a run file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["repair"]


def repair(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The damaged run file.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="NEW", help="The new file; must not exist.")
    ],
) -> None:
    """Copy all complete and sound frames and rows into a new run file; FILE is not touched."""
    from granufab.cli.check import counted
    from granufab.cli.output import print_pairs
    from granufab.io.checked_file import repair_run_file

    report = repair_run_file(file, output)
    pairs = [
        ("frames", counted(report.sound_frames, report.frames)),
        ("rows", counted(report.sound_rows, report.rows)),
        ("summary", "kept" if report.finished and not report.faults else "none"),
        ("written to", output),
    ]
    print_pairs("", pairs)
    for fault in report.faults:
        print(f"{file}: {fault}; not in {output}" if _is_record(fault) else f"{file}: {fault}")


def _is_record(fault: str) -> bool:
    """Whether a fault is that of frames or rows, which the copy lacks."""
    return fault.startswith(("frame ", "row ", "rows "))
