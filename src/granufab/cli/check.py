"""``granufab check``: whether run files and checkpoints are sound."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from granufab.io.checked_file import FileReport

__all__ = ["check", "counted"]


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="Run files and checkpoints, or folders that hold some."
        ),
    ],
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
) -> None:
    """Compare every frame, row and checkpoint with its checksum; exit code 1 if one is damaged."""
    from granufab.cli.output import print_json, print_rows
    from granufab.io.checked_file import check_file, files_to_check

    reports = [check_file(one) for path in files for one in files_to_check(path)]
    if json:
        print_json([_plain(report) for report in reports])
    else:
        header = ("file", "kind", "frames", "rows", "finished", "state")
        print_rows("", header, [_cells(report) for report in reports])
        for report in reports:
            for note in report.notes:
                print(f"{report.path}: note: {note}")
            for fault in report.faults:
                print(f"{report.path}: {fault}")
    if any(report.faults for report in reports):
        raise typer.Exit(1)


def counted(sound: int | None, promised: int | None) -> str | None:
    """Sound ones of those there should be, in words; None where they are not known."""
    if promised is None:
        return None
    return str(promised) if sound == promised else f"{sound} of {promised}"


def _cells(report: FileReport) -> tuple[Any, ...]:
    faults = len(report.faults)
    state = "sound" if faults == 0 else f"damaged: {faults} fault{'s' if faults > 1 else ''}"
    frames = counted(report.sound_frames, report.frames)
    rows = counted(report.sound_rows, report.rows)
    return str(report.path), report.kind, frames, rows, report.finished, state


def _plain(report: FileReport) -> dict[str, Any]:
    from granufab.io.summary import plain

    return {**plain(report), "sound": not report.faults}
