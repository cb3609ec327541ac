"""``granufab run``: simulate one case into a folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granufab.errors import GranufabError

if TYPE_CHECKING:
    from granufab.history import Run
    from granufab.simulate.settings import Case

__all__ = ["run", "solver_pairs"]


def run(
    case: Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case, see granufab new.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder; default CASE.toml without its ending."),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Random seed, instead of the file's.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Override a setting; repeatable."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the results of an earlier run.")
    ] = False,
) -> None:
    """Simulate a case; writes run.h5, settings.toml, series.csv and summary.json."""
    from granufab.cli.output import print_pairs
    from granufab.cli.progress import show_progress
    from granufab.reproduce.case_folder import run_into_folder
    from granufab.simulate.settings import load_case

    overrides = (*(set_ or ()), *(() if seed is None else (f"sample.seed={seed}",)))
    settings = load_case(case, overrides)
    folder = case.with_suffix("") if out is None else out
    with show_progress(gentle=True) as progress:
        result = run_into_folder(settings, folder, force=force, progress=progress)
    pairs = [*_fabric_pairs(settings, result), *solver_pairs(result.summary)]
    print_pairs(result.name, [*pairs, ("files in", folder)])
    for warning in result.summary.get("warnings", ()):
        print(f"warning: {warning}")
    if result.summary.get("interrupted"):
        raise KeyboardInterrupt


def _fabric_pairs(case: Case, result: Run) -> list[tuple[str, Any]]:
    from granufab.cli.fit import fit_series
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
