"""The run file's schema as one table: writer, reader and ``docs/run-file.md`` follow it.

The first word of an entry's shape says how it grows: ``frames`` and ``rows`` by one per record,
``contacts`` and ``wall_contacts`` by the pairs of a frame (frame k holds the rows
``start[k]:start[k + 1]``), ``grains`` not at all. D is the dimension, S the number of spin
components (1 in 2D, 3 in 3D).
"""

from __future__ import annotations

from typing import Any

from granufab.history import SERIES_UNITS, Frame
from granufab.io.schema_entry import Entry, attribute, cell, grain, pair, scalar, start
from granufab.packing import Array, IntArray

__all__ = [
    "FORMAT_NAME",
    "FRAME_CHECKSUM",
    "NAME_BYTES",
    "ROW_CHECKSUM",
    "SCHEMA",
    "SCHEMA_VERSION",
    "Entry",
    "derived_branch",
    "entries",
    "markdown_table",
    "named",
    "source_value",
]

FORMAT_NAME = "granufab-run"
SCHEMA_VERSION = 2
NAME_BYTES = 64
FRAME_CHECKSUM = "frames/checksum"
ROW_CHECKSUM = "series/checksum"


_IN_VERSION_1 = "absent in version 1"

_ATTRIBUTES = (
    attribute("format", "text", f"always {FORMAT_NAME}"),
    attribute("schema_version", "int64", f"version of this table, {SCHEMA_VERSION}"),
    attribute("created", "text", "when the file was begun, ISO 8601, UTC"),
    attribute("settings", "text", "resolved settings with the seed, JSON (Infinity allowed)"),
    attribute("provenance", "text", "versions, platform, CPU and what the caller adds, JSON"),
    attribute("dimension", "int64", "2 or 3", "0 before the first frame"),
    attribute("grain_count", "int64", "number of grains", "0 before the first frame"),
    Entry(
        name="@checksum",
        dtype="uint64",
        meaning="of schema_version, created, settings and provenance",
        default=_IN_VERSION_1,
        since=2,
    ),
)

_COUNTERS = (
    Entry(
        name="complete_frames",
        dtype="int64",
        meaning="frames that are written in full; whatever lies behind them is to be ignored",
        default="0",
    ),
    Entry(
        name="complete_rows",
        dtype="int64",
        meaning="rows of the series that are written in full",
        default="0",
    ),
    Entry(
        name="file_bytes",
        dtype="int64",
        units="byte",
        meaning="size of the file when the last counter was raised; a shorter file is truncated",
        default="0",
    ),
    Entry(
        name="finished",
        dtype="int64",
        meaning="1 if the run ended by itself and its summary is here",
        default="0",
    ),
    Entry(
        name="summary_checksum",
        dtype="uint64",
        meaning="of the counts of frames and rows and the summary; 0 until the run has ended",
        default=_IN_VERSION_1,
        since=2,
    ),
    Entry(
        name="summary",
        dtype="uint8",
        shape=("bytes",),
        meaning="solver figures and reached values, JSON as UTF-8 bytes",
        default="empty",
    ),
)

_GRAINS = (
    Entry(
        name="grains/radius",
        dtype="float64",
        shape=("grains",),
        units="m",
        meaning="radius, the same in all frames",
        source="packing.grains.radius",
    ),
    Entry(
        name="grains/mass",
        dtype="float64",
        shape=("grains",),
        units="kg",
        meaning="mass, the same in all frames",
        default="None",
        source="packing.grains.mass",
    ),
    Entry(
        name="grains/number",
        dtype="int64",
        shape=("grains",),
        meaning="identity of each grain, the same in all frames",
        source="packing.grains.number",
    ),
    grain("position", "D", "m", "centres, not wrapped into the cell"),
    grain("velocity", "D", "m/s", "velocity; in a deforming cell the fluctuation v − L·r", 0),
    grain("spin", "S", "rad/s", "angular velocity", 1),
)

_CELL = (
    cell("matrix", ("D", "D"), "float64", "m", "lattice vectors as columns"),
    cell("origin", ("D",), "float64", "m", "lower corner"),
    cell("rate", ("D", "D"), "float64", "1/s", "velocity gradient L, > 0 expands"),
    cell("periodic", ("D",), "uint8", "-", "1 where an axis is periodic, 0 where walls bound it"),
)

_SCALARS = (
    Entry(
        name="frames/present",
        dtype="int64",
        shape=("frames",),
        meaning="sum of 2^bit over the optional entries that the frame holds",
    ),
    Entry(
        name=FRAME_CHECKSUM,
        dtype="uint64",
        shape=("frames",),
        meaning="of all that the file holds of the frame; 0 where it is not complete",
        default=_IN_VERSION_1,
        since=2,
    ),
    scalar("time", "float64", "s", "time", "NaN"),
    scalar("eps_q", "float64", "-", "running deviatoric strain"),
    scalar("eps_q_total", "float64", "-", "accumulated deviatoric strain ∫|dε_q|"),
    scalar("stage", "int64", "-", "index of the stage on the path"),
    scalar("inertial_number", "float64", "-", "inertial number I"),
    Entry(
        name="frames/strain",
        dtype="float64",
        shape=("frames", "D", "D"),
        meaning="logarithmic strain, compression positive",
        source="strain",
    ),
    Entry(
        name="frames/stress",
        dtype="float64",
        shape=("frames", "D", "D"),
        units="N/m^(D−1)",
        meaning="contact stress, compression positive",
        source="stress",
    ),
    Entry(
        name="frames/direction",
        dtype="float64",
        shape=("frames", "D"),
        meaning="contraction axis of the first stage, unit vector",
        source="direction",
    ),
    Entry(
        name="frames/remap",
        dtype="float64",
        shape=("frames", "D", "D"),
        meaning="accumulated lattice change of a sheared cell",
        default="None",
        source="remap",
        bit=3,
    ),
    Entry(
        name="frames/extension",
        dtype="float64",
        shape=("frames", "D"),
        meaning="extension axis, where the axes across the contraction are not driven alike",
        default="None",
        source="extension",
        bit=10,
    ),
    scalar("statistics.steps", "int64", "-", "steps since the previous record"),
    scalar("statistics.nonconverged", "int64", "-", "of these, ended above the tolerance"),
    scalar("statistics.sweeps", "float64", "-", "mean sweeps per step"),
    scalar("statistics.residual", "float64", "-", "largest residual"),
    scalar("statistics.residual_contact", "float64", "-", "largest single contact's share of it"),
    scalar("statistics.violation", "float64", "mean diameter", "worst max(0, −ũ_n)·h"),
    scalar("statistics.overlap", "float64", "mean diameter", "worst overlap"),
    scalar("statistics.kinetic_ratio", "float64", "-", "kinetic energy / (p V)"),
    scalar("statistics.pressure_error", "float64", "-", "worst relative error of driven stresses"),
    scalar("statistics.contact_updates", "int64", "-", "local contact solves"),
    scalar("statistics.seconds", "float64", "s", "wall time"),
)


_CONTACTS = (
    start("contacts"),
    pair("contacts", "pair", "int32", ("2",), "-", "grains i, j by index, from 0", 4),
    pair("contacts", "normal", "float64", ("D",), "-", "unit vector n from i to j", 4),
    pair("contacts", "gap", "float64", (), "m", "surface distance, < 0 in overlap", 5),
    pair(
        "contacts",
        "branch",
        "float64",
        ("D",),
        "m",
        "r_j − r_i; NaN (unwritten) where it is n·(R_i + R_j + gap)",
        6,
    ),
    pair("contacts", "force", "float64", ("D",), "N", "on grain j (2D: per length)", 7),
    pair("contacts", "image", "int32", ("D",), "-", "lattice shift of j's image", 8),
)

_WALL_CONTACTS = (
    start("wall_contacts"),
    pair("wall_contacts", "grain", "int32", (), "-", "grain by index, from 0", 9),
    pair("wall_contacts", "wall", "int32", (), "-", "2·axis + side, side 0 is the lower face", 9),
    pair("wall_contacts", "normal", "float64", ("D",), "-", "unit vector from grain to wall", 9),
    pair("wall_contacts", "gap", "float64", (), "m", "surface distance, < 0 in overlap", 9),
    pair("wall_contacts", "force", "float64", ("D",), "N", "on the wall (2D: per length)", 9),
)

_SERIES = (
    Entry(
        name=ROW_CHECKSUM,
        dtype="uint64",
        shape=("rows",),
        meaning="of all that the file holds of the row; 0 where it is not complete",
        default=_IN_VERSION_1,
        since=2,
    ),
    Entry(
        name="series/path",
        dtype=f"S{NAME_BYTES}",
        shape=("rows",),
        meaning=f"name of the path, UTF-8, at most {NAME_BYTES} bytes",
        default="empty",
    ),
    *(
        Entry(
            name=f"series/{name}",
            dtype="float64",
            shape=("rows",),
            units=units,
            meaning=meaning,
            default="NaN",
        )
        for name, (units, meaning) in SERIES_UNITS.items()
    ),
)

SCHEMA: tuple[Entry, ...] = (
    *_ATTRIBUTES,
    *_COUNTERS,
    *_GRAINS,
    *_CELL,
    *_SCALARS,
    *_CONTACTS,
    *_WALL_CONTACTS,
    *_SERIES,
)

_BY_NAME = {entry.name: entry for entry in SCHEMA}


def entries(*growths: str) -> tuple[Entry, ...]:
    """Entries of the schema whose first axis is one of ``growths``, in order."""
    return tuple(entry for entry in SCHEMA if entry.growth in growths)


def named(name: str) -> Entry:
    """The entry of that HDF5 path."""
    return _BY_NAME[name]


def source_value(frame: Frame, source: str) -> Any:
    """The field of a frame at a dotted path; None where the frame lacks it."""
    value: Any = frame
    for name in source.split("."):
        if value is None:
            return None
        value = getattr(value, name)
    return value


def derived_branch(radius: Array, pair: IntArray, normal: Array, gap: Array) -> Array:
    """Branch vectors of disks or spheres, :math:`n (R_i + R_j + g)` [m].

    Args:
        radius: R of all grains [m], shape (grain_count,).
        pair: grain indices i, j, shape (contact_count, 2).
        normal: n from i to j [-], shape (contact_count, D).
        gap: surface distance g [m], shape (contact_count,).
    Returns:
        Shape (contact_count, D).
    """
    return normal * (radius[pair[:, 0]] + radius[pair[:, 1]] + gap)[:, None]


def markdown_table() -> str:
    """The table of ``docs/run-file.md``."""
    lines = [
        "| entry | type | shape | units | meaning | where missing | bit |",
        "|---|---|---|---|---|---|---|",
    ]
    for entry in SCHEMA:
        shape = f"({', '.join(entry.shape)})" if entry.shape else "scalar"
        bit = "" if entry.bit is None else str(entry.bit)
        cells = (f"`{entry.name}`", entry.dtype, shape, entry.units, entry.meaning)
        cells = (*cells, entry.default, bit)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
