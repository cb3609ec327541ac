"""The verbs, gathered into one application."""

from __future__ import annotations

from typing import Annotated

import typer

from granufab.cli import (
    balance,
    bench,
    check,
    criterion,
    doctor,
    export,
    fit,
    import_data,
    info,
    measure,
    new,
    plot,
    predict,
    repair,
    reproduce,
    run,
    sweep,
    view,
)

__all__ = ["app"]

app = typer.Typer(
    name="granufab",
    help="Granular fabric: simulate, measure and explain the contact network of granular matter.",
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("new")(new.new)
app.command("run")(run.run)
app.command("sweep")(sweep.sweep)
app.command("reproduce")(reproduce.reproduce)
app.command("import")(import_data.import_data)
app.command("export")(export.export)
app.command("measure")(measure.measure)
app.command("balance")(balance.balance)
app.command("criterion")(criterion.criterion)
app.command("fit")(fit.fit)
app.command("predict")(predict.predict)
app.command("plot")(plot.plot)
app.command("view")(view.view)
app.command("info")(info.info)
app.command("check")(check.check)
app.command("repair")(repair.repair)
app.command("doctor")(doctor.doctor)
app.command("bench")(bench.bench)


def _print_version(wanted: bool) -> None:
    if wanted:
        from granufab import __version__

        print(f"granufab {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _options(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print it."),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(2)
