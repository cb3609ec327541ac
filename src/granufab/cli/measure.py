"""``granufab measure``: the fabric of every state in some files."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granufab.cli.choices import Definition
from granufab.cli.foreign import (
    ForeignOptions,
    Opened,
    foreign_options,
    frame_numbers,
    frame_place,
    open_runs,
    print_summaries,
)
from granufab.cli.frame_sharing import DaskWorkers, Workers, shared_frames
from granufab.cli.output_files import check_table
from granufab.errors import MissingData

if TYPE_CHECKING:
    import xarray as xr

    from granufab.fabric.frame_map import FrameMap
    from granufab.history import Run

__all__ = ["measure"]

COUNTS = ("contact_count", "grain_count", "dimension", "stage")
SHOWN = {
    "frame": "frame",
    "eps_q": "ε_q",
    "z": "z",
    "z_backbone": "z_backbone",
    "rattler_fraction": "rattlers",
    "a": "a",
    "a_signed": "a'",
    "b_g": "b_G",
    "q_over_p": "q/p",
    "phi": "φ",
    "a_n": "a_n",
    "a_t": "a_t",
    "a_l": "a_ℓ",
    "q_over_p_full": "q/p full",
    "sliding_fraction": "sliding",
}
"""Columns of the table for people, where a file has them."""


@foreign_options
def measure(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Run files, or other programs' data.")
    ],
    foreign: ForeignOptions,
    criterion: Annotated[
        str | None,
        typer.Option(
            metavar="force|gap:δ|listed",
            help="Which pairs count as contacts; default the run's own.",
        ),
    ] = None,
    z_definition: Annotated[
        Definition, typer.Option(help="Whose contacts and grains the fabric counts.")
    ] = "z_backbone",
    frame: Annotated[
        int | None, typer.Option(metavar="K", help="One state only; negative from the end.")
    ] = None,
    forces: Annotated[
        bool,
        typer.Option("--with-forces", help="Add force anisotropies, sliding, strong contacts."),
    ] = False,
    json: Annotated[bool, typer.Option("--json", help="A JSON list on standard output.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.csv|.nc", help="Also write all values here.")
    ] = None,
    workers: Workers = 1,
    dask: DaskWorkers = None,
    force: Annotated[bool, typer.Option("--force", help="Replace --out if it exists.")] = False,
) -> None:
    """Measure z, fabric tensors, anisotropy and stress of every recorded state."""
    from granufab.cli.output import listed, print_json, print_rows

    check_table(out, force)
    opened = open_runs(files, foreign)
    with shared_frames(workers, dask) as each:
        tables = [_measure_run(one, criterion, z_definition, frame, forces, each) for one in opened]
    print_summaries(opened)
    if out is not None:
        _write(tables, out)
    if json:
        both = zip(opened, tables, strict=True)
        print_json([state | one.skipped() for one, table in both for state in _states(table)])
        return
    for one, table in zip(opened, tables, strict=True):
        names = [name for name in SHOWN if name in table.variables]
        rows = [[state[name] for name in names] for state in _states(table)]
        held, rule = listed(one.files, " + "), table.attrs["criterion"]
        title = f"{held}; contacts: {rule}; fabric of: {z_definition}"
        print_rows(title, [SHOWN[name] for name in names], rows)


def _measure_run(
    one: Opened,
    criterion: str | None,
    z_definition: Any,
    frame: int | None,
    forces: bool,
    each: FrameMap,
) -> xr.Dataset:
    """One row per state, with its source and number."""
    from dataclasses import replace

    from granufab.fabric import measure_run
    from granufab.fabric.frame_map import one_by_one

    file, run, numbers = one.name, one.run, ()
    if frame is not None:
        place = frame_place(run, file, frame)
        numbers = frame_numbers(run)[place : place + 1]
        run, each = replace(run, frames=[run.frames[place]]), one_by_one
    table = measure_run(
        run, criterion=criterion, z_definition=z_definition, forces=forces, each=each
    )
    if frame is None:
        numbers = frame_numbers(run)
    _explain_unknown(file, run, table)
    table = table.assign(source=("frame", [file] * len(numbers)))
    return table.assign_coords(frame=list(numbers))


def _states(table: xr.Dataset) -> Iterator[dict[str, Any]]:
    """One plain object per state."""
    columns = {str(name): table[name].values.tolist() for name in ("source", "frame", *table)}
    for name in set(COUNTS) & set(columns):
        columns[name] = [None if value != value else int(value) for value in columns[name]]
    definitions = {name: table.attrs[name] for name in ("criterion", "z_definition")}
    for row in range(table.sizes["frame"]):
        yield {name: column[row] for name, column in columns.items()} | definitions


def _explain_unknown(file: str, run: Run, table: xr.Dataset) -> None:
    """Say once, on standard error, why some columns are unknown throughout."""
    if not any(bool(table[name].isnull().all()) for name in table.data_vars):
        return
    from granufab.fabric import force_values
    from granufab.fabric import measure as measure_state

    first = run.frames[0]
    state = measure_state(
        first.packing,
        criterion=table.attrs["criterion"],
        z_definition=table.attrs["z_definition"],
        direction=first.direction,
    )
    reasons = [str(state["missing"])] if state["missing"] else []
    if "a_n" in table and bool(table["a_n"].isnull().all()):
        try:
            force_values(first, criterion=table.attrs["criterion"])
        except MissingData as error:
            reasons.append(str(error))
    if reasons:
        why = "; ".join(dict.fromkeys(reasons))
        print(f"granufab: {file}: some values are unknown: {why}", file=sys.stderr)


def _write(tables: list[xr.Dataset], out: Path) -> None:
    import xarray as xr

    from granufab.io import write_dataset

    write_dataset(xr.concat(tables, "frame", data_vars="all"), out)
