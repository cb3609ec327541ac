"""Grains of one frame of an atom dump."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.io.found import FoundCell, FoundContacts, FoundFrame
from granufab.io.lammps.box import bounds_cell
from granufab.io.lammps.columns import GRAIN_WORDS, Columns, find_columns
from granufab.io.lammps.dump_index import DumpFrame
from granufab.io.number_rows import number_rows
from granufab.io.read_options import ReadOptions
from granufab.packing import Array, IntArray

__all__ = ["frame_columns", "grain_columns", "known_columns", "parse_grains", "whole_numbers"]

_POSITIONS = (("xu", "yu", "zu"), ("x", "y", "z"), ("xsu", "ysu", "zsu"), ("xs", "ys", "zs"))
_WANTED = ("id", "radius", "diameter", "mass", "vx", "vy", "vz", "omegax", "omegay", "omegaz")


def grain_columns(frame: DumpFrame, options: ReadOptions) -> Columns:
    """Where an atom dump's columns are.

    Raises:
        MissingData: there are no positions.
    """
    found = known_columns(frame, GRAIN_WORDS, options, "grains")
    if not any(found.has(*axes) for axes in _POSITIONS):
        raise MissingData(
            f"{frame.path}: line {frame.line - 1}: no positions among the columns "
            f"{' '.join(frame.columns)}; dump x y z (or xu, xs, xsu), or name them with --columns: "
            '[grains] x = "…"'
        )
    return found


def known_columns(
    frame: DumpFrame, words: Mapping[str, tuple[str, ...]], options: ReadOptions, section: str
) -> Columns:
    """Where a frame's columns are, by their names and the user's words.

    Raises:
        InvalidSettings: the user's words do not fit the columns; names their line.
    """
    try:
        return find_columns(frame.columns, words, options.columns.get(section, {}), section)
    except InvalidSettings as error:
        raise InvalidSettings(f"{frame.path}: line {frame.line - 1}: {error}") from None


def parse_grains(
    frame: DumpFrame, options: ReadOptions, contacts: FoundContacts | None
) -> FoundFrame:
    """Read a frame's grains.

    Raises:
        CorruptFile: the rows are not what the header says; names the line.
        MissingData: positions, or which axes are periodic, are not told.
    """
    columns = grain_columns(frame, options)
    axes = next(axes for axes in _POSITIONS if columns.has(*axes))
    words = [*axes, *(word for word in _WANTED if columns.has(word))]
    table = frame_columns(frame, [columns.place[word] for word in words])
    value = {word: table[:, k] for k, word in enumerate(words)}
    cell = bounds_cell(frame.bounds, frame.box, frame.place, options.periodic)
    return FoundFrame(
        place=frame.place,
        position=_position(table[:, :3], axes[0], cell),
        radius=_radius(value),
        number=whole_numbers(value["id"], frame, "id") if "id" in value else None,
        mass=value.get("mass"),
        velocity=_vector(value, ("vx", "vy", "vz")),
        spin=_vector(value, ("omegax", "omegay", "omegaz")),
        cell=cell,
        contacts=contacts,
        time=frame.time,
        step=frame.step,
    )


def frame_columns(frame: DumpFrame, use: Sequence[int], rows: int | None = None) -> Array:
    """Columns of a frame's rows, all or the first ones.

    Raises:
        CorruptFile: the rows are not what the header says; names the line.
    """
    if frame.rows_found != frame.count:
        raise CorruptFile(
            f"{frame.place}: {frame.rows_found} rows of {frame.label}, the header says "
            f"{frame.count}"
        )
    return number_rows(
        frame.path, frame.start, frame.stop, rows=min(frame.count, rows or frame.count),
        columns=len(frame.columns), use=use, place=frame.place, first_line=frame.line,
    )  # fmt: skip


def whole_numbers(column: Array, frame: DumpFrame, what: str) -> IntArray:
    """A column of numbers of bodies.

    Raises:
        CorruptFile: one of them is not whole; names the line.
    """
    wrong = ~((np.abs(column) < 2**53) & (column == np.rint(column)))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise CorruptFile(
            f"{frame.place}: line {frame.line + row}: {what} is {column[row]:.6g}, expected a "
            "whole number"
        )
    return column.astype(np.int64)


def _position(coordinates: Array, first: str, cell: FoundCell) -> Array:
    if first in ("xs", "xsu"):
        return coordinates @ cell.matrix.T + cell.origin
    return coordinates


def _radius(value: dict[str, Array]) -> Array | None:
    if "radius" in value:
        return value["radius"]
    return value["diameter"] / 2 if "diameter" in value else None


def _vector(value: dict[str, Array], words: tuple[str, str, str]) -> Array | None:
    if not all(word in value for word in words):
        return None
    return np.stack([value[word] for word in words], axis=1)
