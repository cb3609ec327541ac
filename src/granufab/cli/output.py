"""What verbs print: tables for people, JSON for programs."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

__all__ = ["listed", "print_json", "print_pairs", "print_rows"]

WIDTH_OFF_A_TERMINAL = 140
LISTED_IN_FULL = 3


def listed(files: Sequence[Path], between: str = ", ") -> str:
    """Names of files; of many the first, the last, and how many there are."""
    names = [str(file) for file in files]
    if len(names) <= LISTED_IN_FULL:
        return between.join(names)
    return f"{names[0]} … {names[-1]} ({len(names)} files)"


def print_json(value: Any) -> None:
    """Print strict JSON on standard output; unknown values are null."""
    from granufab.io import json_text

    sys.stdout.write(json_text(value))


def print_pairs(title: str, pairs: Sequence[tuple[str, Any]]) -> None:
    """Print names and values as a table of two columns."""
    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, value in pairs:
        table.add_row(name, _text(value))
    _console().print(table)


def print_rows(title: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Print a table with a header."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for name in header:
        table.add_column(name, justify="right", overflow="fold")
    for row in rows:
        table.add_row(*(_text(value) for value in row))
    _console().print(table)


def _console() -> Console:
    width = None if sys.stdout.isatty() else WIDTH_OFF_A_TERMINAL
    return Console(highlight=False, markup=False, width=width)


def _text(value: Any) -> str:
    """Four significant digits, a dash where a value is unknown."""
    if hasattr(value, "item"):  # numpy scalar
        value = value.item()
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
