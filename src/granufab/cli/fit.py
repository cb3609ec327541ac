"""``granufab fit``: the accessible domain of recorded paths."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from granufab.cli.choices import Definition, Form
from granufab.cli.evolution_fit import fit_law, print_law, write_law
from granufab.cli.foreign import ForeignOptions, foreign_options, open_runs, print_summaries
from granufab.cli.output_files import check_new
from granufab.errors import GranufabError, MissingData, UnknownFormat

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["fit", "read_paths"]

Method = Literal["critical", "envelope", "lines"]
Mode = Literal["compression", "extension"]


@foreign_options
def fit(
    series: Annotated[
        list[Path],
        typer.Argument(
            metavar="SERIES",
            help="series.csv, run.h5, a CSV with z and a, or other programs' data.",
        ),
    ],
    foreign: ForeignOptions,
    method: Annotated[Method, typer.Option(help="How z_min and z_max are found.")] = "critical",
    z_definition: Annotated[
        Definition | None, typer.Option(help="Which z; default z_backbone, or z if alone.")
    ] = None,
    dimension: Annotated[
        int | None, typer.Option(min=2, max=3, help="2 or 3; default as recorded, else 2.")
    ] = None,
    mode: Annotated[
        Mode | None, typer.Option(help="3D axisymmetric; default by the sign of the late a'.")
    ] = None,
    b: Annotated[
        float | None, typer.Option(min=0, max=1, help="3D: b of the loading; default as recorded.")
    ] = None,
    evolution: Annotated[
        Path | None,
        typer.Option(metavar="FIT.json", help="Also fit an evolution law, for granufab predict."),
    ] = None,
    form: Annotated[Form, typer.Option(help="Which evolution law.")] = "memory",
    force: Annotated[bool, typer.Option("--force", help="Replace FIT.json if it exists.")] = False,
    json: Annotated[bool, typer.Option("--json", help="JSON on standard output.")] = False,
) -> None:
    """Fit z_min, z_max and the critical state, with 95 % intervals.

    Each path counts up to its first reversal. Dimension and b of a series.csv are those of the
    settings.toml or run.h5 beside it.
    """
    from granufab.cli.output import print_json, print_rows
    from granufab.reproduce.report import fit_entry
    from granufab.reproduce.series_fit import fit_series

    check_new(evolution, force)
    paths = read_paths(series, foreign)
    given = {"dimension": dimension, "mode": mode, "b": b}
    found, definition = fit_series(paths, method, z_definition, **given)
    entry = fit_entry(found) | {
        "outside_significant": found.outside_significant,
        "z_definition": definition,
        "series": [str(file) for file in series],
    }
    if foreign.skip_damaged:
        entry["skipped_frames"] = [
            one for path in paths for one in path.attrs.get("skipped_frames", ())
        ]
    law = None
    if evolution is not None:
        law = fit_law(paths, found, definition, form)
        entry["evolution"] = write_law(law, evolution, entry)
    if json:
        print_json(entry)
        return
    names = ("z_min", "z_max", "z_star", "a_star")
    rows = [[name, *(entry[name][part] for part in ("value", "low", "high"))] for name in names]
    print_rows(f"fit: {method}; z: {definition}", ("", "value", "low", "high"), rows)
    print(
        f"outside the fitted domain: {found.outside_fraction:.1%} of the states, "
        f"{found.outside_significant:.1%} by more than their scatter"
    )
    if law is not None:
        print_law(law)


def read_paths(files: Sequence[Path], foreign: ForeignOptions) -> list[xr.Dataset]:
    """The series of run files and of each path in a CSV; frames of other data are measured.

    Rows (frames) count as strain where it is unknown. Attributes tell dimension and b where these
    are known.
    """
    paths: list[xr.Dataset] = []
    for is_series, group in groupby(files, lambda file: _is_series(file, foreign)):
        part = list(group)
        tables = _written_series(part) if is_series else _measured_series(part, foreign)
        paths += [path for table in tables for path in _single_paths(table)]
    return paths


def _written_series(files: Sequence[Path]) -> list[xr.Dataset]:
    from granufab.io import read_series

    return [_beside(read_series(file), file) for file in files]


def _measured_series(files: Sequence[Path], foreign: ForeignOptions) -> list[xr.Dataset]:
    from granufab.fabric import with_series
    from granufab.reproduce.symmetry import described_series

    opened = open_runs(files, foreign, own=("dimension",))
    tables = [described_series(with_series(one.run)).assign_attrs(one.skipped()) for one in opened]
    print_summaries(opened)
    for one, table in zip(opened, tables, strict=True):
        if one.summary is not None and bool(table["eps_q"].isnull().all()):
            print(
                f"granufab: {one.name}: the strain is unknown, each frame counts as 1; give "
                "--strain (per frame)",
                file=sys.stderr,
            )
    return tables


def _single_paths(table: xr.Dataset) -> list[xr.Dataset]:
    from granufab.reproduce.series_fit import counted_strain

    table = counted_strain(table)
    if "path" not in table.coords:
        return [table]
    names = dict.fromkeys(table.coords["path"].values.tolist())
    return [table.isel(record=table.coords["path"].values == name) for name in names]


def _beside(series: xr.Dataset, file: Path) -> xr.Dataset:
    """The series with the dimension and b of the run whose folder it lies in, if any."""
    from granufab.io import read
    from granufab.reproduce.symmetry import run_symmetry, symmetry_attributes
    from granufab.simulate.settings import load_case

    settings = None
    with suppress(GranufabError):  # a file of another kind that happens to have this name
        if (path := file.with_name("settings.toml")).exists():
            settings = load_case(path).model_dump(mode="json")
        elif (path := file.with_name("run.h5")).exists():
            settings = read(path).settings
    return series.assign_attrs(symmetry_attributes(run_symmetry(settings or {})))


def _is_series(file: Path, foreign: ForeignOptions) -> bool:
    """Whether it is a text of z and a, or no text that another program's format recognises."""
    from granufab.io import detect

    if foreign.format is not None or file.is_dir():
        return False
    try:
        with file.open("rb") as stream:
            head = stream.read(512)
    except OSError as error:
        raise MissingData(f"{file}: cannot be read ({error.strerror})") from None
    if b"\0" in head:
        return False
    names = {name.strip().strip('"') for name in head.decode(errors="replace").split(",")}
    if foreign.columns is not None or "a" in names:
        return foreign.columns is None
    try:
        detect(file)
    except UnknownFormat:
        return True
    return False
