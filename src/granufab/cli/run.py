"""``granufab run``: simulate one case into a folder."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granufab.cli.foreign import ForeignOptions, foreign_options
from granufab.errors import GranufabError, InvalidSettings

if TYPE_CHECKING:
    from granufab.history import Run
    from granufab.simulate.available import Room
    from granufab.simulate.settings import Case

__all__ = ["run", "solver_pairs"]


READING = ("format", "dimension", "cell", "periodic", "columns", "radius", "walls")
"""Options of foreign data that tell how a starting state is read."""


@partial(foreign_options, only=READING)
def run(
    foreign: ForeignOptions,
    case: Annotated[
        Path | None, typer.Argument(metavar="CASE.toml", help="The case, see granufab new.")
    ] = None,
    start: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Start from the last state of this run file or of other programs' data "
            "(repeat for files that complete each other); soft grains are relaxed first.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder; default CASE.toml or FILE without its ending."),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Random seed, instead of the file's.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a setting; repeatable."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the results of an earlier run.")
    ] = False,
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Go on from the last checkpoint, or start where none is."),
    ] = False,
    elsewhere: Annotated[
        bool,
        typer.Option("--elsewhere", help="Resume also where another processor or version ran."),
    ] = False,
    max_walltime: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="End with a checkpoint after s, m:s, h:mm:s, d-h:mm:s."),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Only tell what the run needs, and whether it fits."),
    ] = False,
) -> None:
    """Simulate a case; writes run.h5, settings.toml, series.csv and summary.json."""
    from granufab.cli.output import print_pairs
    from granufab.cli.progress import show_progress
    from granufab.reproduce.case_folder import run_into_folder

    overrides = (*(set_ or ()), *(() if seed is None else (f"sample.seed={seed}",)))
    settings = _settings(case, start or [], foreign, overrides)
    folder = out or _default_folder(case, start or [])
    if dry_run:
        print_pairs(settings.name, _needs(settings, folder))
        return
    with show_progress(gentle=True) as progress:
        result = run_into_folder(
            settings,
            folder,
            force=force,
            resume=resume,
            elsewhere=elsewhere,
            max_walltime=_seconds(max_walltime),
            progress=progress,
        )
    for line in result.summary.get("start", {}).get("notes", ()):
        print(f"granufab: start: {line}", file=sys.stderr)
    pairs = [*_fabric_pairs(settings, result), *solver_pairs(result.summary)]
    if result.summary.get("resumed"):
        pairs.append(("resumed from a checkpoint", f"{result.summary['resumed']} times"))
    print_pairs(result.name, [*pairs, ("files in", folder)])
    for warning in result.summary.get("warnings", ()):
        print(f"warning: {warning}")
    if result.summary.get("interrupted"):
        if "stopped_by" in result.summary:
            print("granufab: --max-walltime is over; go on with --resume", file=sys.stderr)
        raise KeyboardInterrupt


def _needs(case: Case, folder: Path) -> list[tuple[str, Any]]:
    """What a run would need, as far as its settings tell, and what there is."""
    from granufab.reproduce.preflight import check_fits, disk_available, in_words
    from granufab.reproduce.start_state import with_start_size
    from granufab.simulate.available import memory_available

    case = with_start_size(case)
    needs = check_fits(case, folder)
    memory, disk = memory_available(), disk_available(folder)
    return [
        ("grains", case.sample.grain_count),
        ("steps", needs.steps),
        ("frames", needs.frames),
        ("rows of the series", needs.rows),
        ("memory", f"about {in_words(needs.memory)}{_there(memory)}"),
        ("disk", f"about {in_words(needs.disk)}{_there(disk)}"),
        ("time", f"about {_time(needs.seconds)} on one processor, a guess"),
        ("files in", folder),
    ]


def _there(room: Room | None) -> str:
    from granufab.reproduce.preflight import in_words

    return "" if room is None else f", there are {in_words(room.size)} ({room.source})"


def _time(seconds: float) -> str:
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def _seconds(text: str | None) -> float:
    """Seconds of a time as job schedulers write it: s, m:s, h:m:s, d-h:m:s."""
    if text is None:
        return math.inf
    days, dash, rest = text.rpartition("-")
    try:
        parts = [float(part) for part in rest.split(":")]
        seconds = sum(part * 60.0**k for k, part in enumerate(reversed(parts)))
        seconds += 86400.0 * float(days) if dash else 0.0
    except ValueError:
        seconds, parts = math.nan, []
    if not (0 < seconds < math.inf) or len(parts) > 3:
        raise InvalidSettings(f"--max-walltime {text!r}: give s, m:s, h:m:s or d-h:m:s, above 0")
    return seconds


def _settings(
    file: Path | None, start: list[Path], foreign: ForeignOptions, overrides: tuple[str, ...]
) -> Case:
    """The case of a file and the options; without a file the default path from a given state."""
    from granufab.simulate.settings import load_case

    if file is None and not start:
        raise InvalidSettings(
            "give CASE.toml (granufab new shear > CASE.toml), or --start FILE; granufab run --help"
        )
    given: dict[str, Any] = {}
    if file is None:
        given["name"] = start[0].stem
    reading = foreign.plain()
    if start:
        given["sample"] = {"file": [str(path) for path in start], "read": reading}
    elif reading:
        raise InvalidSettings(f"--{next(iter(reading))} tells how --start FILE is read; give both")
    return load_case(file, overrides, given)


def _default_folder(case: Path | None, start: list[Path]) -> Path:
    folder = (case or start[0]).with_suffix("")
    if (folder.exists() and not folder.is_dir()) or (case is None and folder == start[0]):
        folder = folder.with_name(folder.name + "-run")
    return folder


def _fabric_pairs(case: Case, result: Run) -> list[tuple[str, Any]]:
    from granufab.reproduce.series_fit import fit_series
    from granufab.reproduce.symmetry import described_series

    pairs: list[tuple[str, Any]] = [
        ("contact criterion", result.series.attrs.get("criterion", "force")),
        ("z is", case.record.z_definition),
        ("z_0", result.summary.get("z_0")),
    ]
    try:
        fit, _ = fit_series([described_series(result)], "critical", case.record.z_definition)
    except GranufabError as error:
        return [*pairs, ("z*, a*", f"not fitted: {error}")]
    estimates = (("z*", fit.z_star), ("a*", fit.a_star))
    return pairs + [(name, f"{e.value:.4g} ({e.low:.4g} to {e.high:.4g})") for name, e in estimates]


def solver_pairs(summary: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """How well the steps were solved, for a table."""
    steps, loose = summary.get("steps"), summary.get("nonconverged_steps")
    return [
        ("inertial number", summary.get("inertial_number_max", summary.get("inertial_number"))),
        ("largest residual", summary.get("residual_max")),
        ("tolerance", summary.get("tolerance")),
        ("steps not converged", f"{loose} of {steps}"),
        ("worst overlap / d", summary.get("overlap_max")),
        ("seconds", summary.get("seconds")),
    ]
