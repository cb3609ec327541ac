"""Series of a path as CSV, datasets as CSV or NetCDF."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from granufab.errors import CorruptFile, InvalidSettings, MissingData, UnknownFormat
from granufab.history import SERIES_UNITS
from granufab.io.summary import plain, replacing, write_text

__all__ = ["read_series", "write_dataset", "write_series"]

_FORMAT = ".10g"


def write_series(dataset: xr.Dataset, path: Path | str, name: str | None = None) -> None:
    """Write a series with the columns path, eps_q, … of :data:`granufab.history.SERIES_UNITS`.

    Args:
        dataset: variables over dimension ``record``; columns that it lacks become nan.
        path: the file.
        name: the path's name; by default the dataset's coordinate ``path`` (one name per
            record, as in series joined with :func:`xarray.concat`), else its attribute.
    Raises:
        InvalidSettings: the file cannot be written.
    """
    count = dataset.sizes.get("record", 0)
    if name is not None or "path" not in dataset.coords:
        text = name if name is not None else str(dataset.attrs.get("path", "run"))
        names: Sequence[str] = [text] * count
    else:
        names = [str(item) for item in dataset.coords["path"].values]
    missing = np.full(count, np.nan)
    columns = [dataset[c].values if c in dataset else missing for c in SERIES_UNITS]
    rows = zip(names, *columns, strict=True)
    write_text(_csv_text(["path", *SERIES_UNITS], rows), path)


def read_series(path: Path | str) -> xr.Dataset:
    """Read a series that granufab or the user wrote.

    A header line names the columns, which are separated by commas, semicolons or tabs; lines
    that start with # are skipped. ``z`` and one of ``a``, ``a_signed`` must be there; other
    columns of numbers are kept, other text is left out. Empty cells and nan mean unknown.

    Returns:
        Variables over dimension ``record``, units in their attributes; the coordinate ``path``
        names each record's path (the file's name where the file does not tell).
    Raises:
        MissingData: there is no such file, it has no rows, or a needed column is missing.
        UnknownFormat: it is not text.
        CorruptFile: a line has too few or too many cells, or a cell is not a number.
    """
    path = Path(path)
    header, lines = _table(path)
    needed = {"z"} - set(header)
    if not {"a", "a_signed"} & set(header):
        needed.add("a (or a_signed)")
    if needed:
        raise MissingData(
            f"{path}: no column {' and no column '.join(sorted(needed, reverse=True))} "
            f"(columns found: {', '.join(header)})"
        )
    if not lines:
        raise MissingData(f"{path}: has a header but no rows")
    names = [path.stem] * len(lines)
    data: dict[str, Any] = {}
    for position, name in enumerate(header):
        cells = [(number, row[position]) for number, row in lines]
        if name == "path":
            names = [cell for _, cell in cells]
        elif name in SERIES_UNITS or all(_is_number(cell) for _, cell in cells):
            units, text = SERIES_UNITS.get(name, ("-", name))
            values = np.array([_number(path, number, name, cell) for number, cell in cells])
            data[name] = ("record", values, {"units": units, "long_name": text})
    attributes = {"source": str(path)}
    if len(set(names)) == 1:
        attributes["path"] = names[0]
    return xr.Dataset(data, coords={"path": ("record", names)}, attrs=attributes)


def write_dataset(dataset: xr.Dataset, path: Path | str) -> None:
    """Write a dataset as ``.csv`` (one row per item of its only dimension) or ``.nc`` (NetCDF 3).

    Args:
        dataset: with one dimension for a CSV.
        path: its ending chooses the format.
    Raises:
        InvalidSettings: another suffix, more than one dimension in a CSV, or the file cannot be
            written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        _write_csv(dataset, path)
    elif suffix == ".nc":
        _write_netcdf(dataset, path)
    else:
        raise InvalidSettings(f"{path}: unknown suffix {suffix or '(none)'}, allowed .csv or .nc")


def _write_csv(dataset: xr.Dataset, path: Path) -> None:
    wide = [str(name) for name, item in dataset.variables.items() if item.ndim > 1]
    if wide or len(dataset.sizes) > 1:
        sizes = ", ".join(f"{name}: {size}" for name, size in dataset.sizes.items())
        raise InvalidSettings(
            f"{path}: a CSV has one dimension, the data have {sizes}; write a .nc file"
        )
    count = next(iter(dataset.sizes.values()), 1)
    names = [*dataset.coords, *dataset.data_vars]
    columns = [np.broadcast_to(dataset[name].values, (count,)) for name in names]
    rows = zip(*columns, strict=True)
    write_text(_csv_text([str(name) for name in names], rows), path)


def _write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    clean = dataset.copy()
    clean.attrs = {str(key): _attribute(value) for key, value in dataset.attrs.items()}
    for name in clean.variables:
        item = clean[name]
        item.attrs = {str(key): _attribute(value) for key, value in item.attrs.items()}
    try:
        with replacing(path) as temporary:
            clean.to_netcdf(temporary, engine="scipy")
    except (TypeError, ValueError) as error:
        if isinstance(error, InvalidSettings):
            raise
        raise InvalidSettings(f"{path}: the data do not fit NetCDF 3 ({error})") from None


def _attribute(value: Any) -> Any:
    """What NetCDF 3 holds as an attribute: text, numbers, and JSON for the rest."""
    if isinstance(value, bool | np.bool_):
        return int(value)
    if isinstance(value, str | int | float | np.integer | np.floating):
        return value
    return "" if value is None else json.dumps(plain(value), ensure_ascii=False)


def _csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow([_cell(value) for value in row])
    return buffer.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return format(value, _FORMAT)
    return "" if value is None else str(value)


def _table(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header, and the rows of cells with their line numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise MissingData(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise UnknownFormat(f"{path}: is not a text file, expected CSV") from None
    except OSError as error:
        raise MissingData(f"{path}: cannot be opened ({error.strerror})") from None
    first = next((n for n in text.splitlines() if n.strip() and not n.startswith("#")), "")
    delimiter = next((d for d in ",;\t" if d in first), ",")
    header: list[str] = []
    lines: list[tuple[int, list[str]]] = []
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if not any(cells) or cells[0].startswith("#"):
                continue
            if not header:
                header = cells
            elif len(cells) != len(header):
                raise CorruptFile(
                    f"{path}, line {reader.line_num}: {len(cells)} cells, "
                    f"but the header has {len(header)}"
                )
            else:
                lines.append((reader.line_num, cells))
    except csv.Error as error:
        raise CorruptFile(f"{path}, line {reader.line_num}: {error}") from None
    if not header:
        raise MissingData(f"{path}: is empty; expected a header with columns z and a")
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise CorruptFile(f"{path}: column {twice} is there twice")
    return header, lines


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _number(path: Path, line: int, name: str, cell: str) -> float:
    if not _is_number(cell):
        raise CorruptFile(f"{path}, line {line}, column {name}: {cell!r} is not a number")
    return float(cell or "nan")
