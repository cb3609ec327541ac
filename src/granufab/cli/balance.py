"""``granufab balance``: contacts gained, lost and turned between the states of a run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from granufab.cli.choices import Definition
from granufab.cli.foreign import (
    ForeignOptions,
    foreign_options,
    frame_numbers,
    open_run,
    print_summaries,
)
from granufab.cli.frame_sharing import DaskWorkers, Workers, shared_frames
from granufab.cli.output_files import check_figure, check_table
from granufab.errors import MissingData

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["balance"]

SCALARS = (
    *("frame_before", "frame_after", "stage", "eps_q_before", "eps_q"),
    *("eps_q_total_before", "eps_q_total", "gained", "lost", "persistent"),
)
BY_BIN = ("before", "after", "gain", "loss", "current_in", "current_out")
PARTS = tuple(
    f"{quantity}_{part}"
    for quantity in ("z", "az")
    for part in ("before", "after", "gain", "loss", "rotation")
)
HEADER = (
    "frames",
    "ε_q",
    "gained",
    "lost",
    "persistent",
    "I+",
    "I-",
    "Δz",
    "Δ(za')",
    "by rotation",
)


@foreign_options
def balance(
    files: Annotated[
        list[Path], typer.Argument(metavar="RUN", help="Run file, or another program's data.")
    ],
    foreign: ForeignOptions,
    interval: Annotated[
        int, typer.Option(metavar="K", help="Frames between the states compared.")
    ] = 1,
    criterion: Annotated[
        str | None,
        typer.Option(
            metavar="force|gap:δ|listed",
            help="Which pairs count as contacts; default the run's own.",
        ),
    ] = None,
    bins: Annotated[int, typer.Option(metavar="B", help="Bins of direction.")] = 18,
    keep: Annotated[
        float | None,
        typer.Option(metavar="GAP", help="Keep a contact up to this gap [mean diameters]."),
    ] = None,
    z_definition: Annotated[
        Definition, typer.Option(help="Whose contacts count; z is 2 N_c/N in any case.")
    ] = "z",
    window: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="FROM TO", help="∫|dε_q| of means and figure; default late strain."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="A JSON list on standard output.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.csv|.nc", help="Also write all values here.")
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option("-o", "--figure", metavar="FILE", help="Draw the terms by direction."),
    ] = None,
    workers: Workers = 1,
    dask: DaskWorkers = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist.")] = False,
) -> None:
    """Count contacts gained, lost and turned between states, by direction (eq. 16).

    JSON and FILE hold every interval; the figure and the mean rates are over the window.
    """
    import numpy as np

    from granufab.cli.output import print_json, print_rows
    from granufab.fabric import balance_run

    check_table(out, force)
    check_figure(figure, force)
    opened = open_run(files, foreign)
    run = opened.name
    with shared_frames(workers, dask) as each:
        table = balance_run(
            opened.run,
            every=interval,
            criterion=criterion,
            z_definition=z_definition,
            bins=bins,
            keep=keep,
            each=each,
        )
    numbers = np.array(frame_numbers(opened.run))
    for end in ("frame_before", "frame_after"):
        table[end] = table[end].copy(data=numbers[table[end].values])
    print_summaries([opened])
    if out is not None:
        _write(table, out)
    if figure is not None:
        from granufab import plots

        cast("Figure", plots.balance(table, window=window)[0].figure).savefig(figure, dpi=300)
    if json:
        print_json([row | opened.skipped() for row in _intervals(run, table)])
        return
    kept = "" if keep is None else f", kept to a gap of {keep:g} d"
    title = f"{run}; contacts: {table.attrs['criterion']}{kept}; rates per grain and unit strain"
    print_rows(title, HEADER, _rows(table))
    print(_mean_rates(table, window))


def _intervals(run: str, table: xr.Dataset) -> Iterator[dict[str, Any]]:
    """One plain object per interval; the lists run over the bins, or over their edges."""
    columns = {name: table[name].values.tolist() for name in (*SCALARS, *PARTS, *BY_BIN, "current")}
    shared = {
        "source": run,
        "criterion": table.attrs["criterion"],
        "keep": table.attrs["keep"],
        "z_definition": table.attrs["z_definition"],
        "direction": table.attrs["direction"].tolist(),
        "bin_edges": table["theta_edge"].values.tolist(),
        "grain_count": int(table.attrs["grain_count"]),
    }
    for row in range(table.sizes["interval"]):
        yield {name: column[row] for name, column in columns.items()} | shared


def _rows(table: xr.Dataset) -> Iterator[list[Any]]:
    strain, grains = table["strain"].values, table.attrs["grain_count"]
    for row, item in enumerate(_intervals("", table)):
        per = strain[row] * grains
        yield [
            f"{item['frame_before']}–{item['frame_after']}",
            item["eps_q"],
            *(item[name] for name in ("gained", "lost", "persistent")),
            *(item[name] / per if per > 0 else None for name in ("gained", "lost")),
            item["z_after"] - item["z_before"],
            item["az_after"] - item["az_before"],
            item["az_rotation"],
        ]


def _mean_rates(table: xr.Dataset, window: tuple[float, float] | None) -> str:
    from granufab.fabric import average_balance

    try:
        mean = average_balance(table, window=window)
    except MissingData as error:
        return f"no mean rates: {error}"
    low, high = mean.attrs["window"]
    rates = ", ".join(
        f"{text} {float(mean[name]):.4g} ± {float(mean[f'{name}_error']):.2g}"
        for text, name in (("I+", "gain_rate_total"), ("I-", "loss_rate_total"))
    )
    return f"mean over ∫|dε_q| = {low:.3g}..{high:.3g}: {rates}"


def _write(table: xr.Dataset, out: Path) -> None:
    """NetCDF as it is; CSV with a row per interval and bin, the upper edge of which has J."""
    from granufab.io import write_dataset

    if out.suffix == ".csv":
        flat = table.drop_dims("edge").assign(
            current_rate_out=(("interval", "bin"), table["current_rate"].values[:, 1:])
        )
        table = flat.stack(row=("interval", "bin"), create_index=False)
    write_dataset(table, out)
