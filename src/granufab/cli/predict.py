"""``granufab predict``: the fabric along a strain path, by a fitted evolution law."""

from __future__ import annotations

import json as json_format
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from granufab.errors import CorruptFile, InvalidSettings, MissingData

if TYPE_CHECKING:
    import xarray as xr

    from granufab.states import EvolutionFit

__all__ = ["predict", "read_evolution"]

HEADER = {
    "eps_q": "ε_q",
    "eps_q_total": "∫|dε_q|",
    "z": "z",
    "z_low": "low",
    "z_high": "high",
    "a_signed": "a'",
    "a_low": "low",
    "a_high": "high",
    "b_g": "b_G",
}
SHOWN = 24


def predict(
    fit: Annotated[
        Path | None, typer.Argument(metavar="FIT", help="Written by granufab fit --evolution.")
    ] = None,
    path: Annotated[
        Path | None, typer.Option(metavar="PATH.toml", help="Start and strain path, or a case.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="A JSON list on standard output.")] = False,
    template: Annotated[
        bool, typer.Option("--template", help="Print a commented PATH.toml and stop.")
    ] = False,
) -> None:
    """Predict z and a' along any strain path: granufab predict FIT.json --path PATH.toml

    The volume is taken to stay constant. The band holds the fit's uncertainty and the scatter of
    single states.
    """
    from granufab.cli.output import print_json, print_rows
    from granufab.cli.strain_path import TEMPLATE, load_strain_path

    if template:
        print(TEMPLATE, end="")
        return
    if fit is None or path is None:
        raise InvalidSettings("give FIT.json and --path PATH.toml, or --template to begin one")
    law = read_evolution(fit)
    history = load_strain_path(path, law.law.dimension)
    if history.skipped:
        print(
            f"granufab: {path}: {history.skipped} stage(s) without shear left out", file=sys.stderr
        )
    try:
        result = law.predict(
            history.fabric, history.stages, surplus=history.surplus, direction=history.direction
        )
    except InvalidSettings as error:
        raise InvalidSettings(f"{path}: {error}") from None
    rows = _rows(result)
    if json:
        print_json(rows)
        return
    names = [name for name in HEADER if name in result]
    step = max(-(-len(rows) // SHOWN), 1)
    shown = [*rows[:-1:step], rows[-1]]
    table = [[row[name] for name in names] for row in shown]
    title = f"{fit}: {law.form} law, {law.law.dimension}D; every {step} of {len(rows)} states"
    print_rows(title, [HEADER[name] for name in names], table)


def _rows(result: xr.Dataset) -> list[dict[str, Any]]:
    """One plain object per state."""
    names = [*(name for name in HEADER if name in result), "a", "stage", "fabric"]
    columns = [result[name].values.tolist() for name in names]
    return [dict(zip(names, cells, strict=True)) for cells in zip(*columns, strict=True)]


def read_evolution(file: Path) -> EvolutionFit:
    """Read the fit that ``granufab fit --evolution`` wrote.

    Raises:
        MissingData: there is no such file.
        CorruptFile: it is not JSON.
        InvalidSettings: it holds something else.
    """
    from granufab.states import EvolutionFit

    try:
        data = json_format.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise MissingData(f"{file}: no such file") from None
    except (UnicodeDecodeError, json_format.JSONDecodeError) as error:
        raise CorruptFile(f"{file}: is not JSON ({error})") from None
    return EvolutionFit.from_dict(data, where=str(file))
