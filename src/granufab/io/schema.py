"""The run file's schema as one table: writer, reader and ``docs/run-file.md`` follow it.

The first word of an entry's shape says how it grows: ``frames`` and ``rows`` by one per record,
``contacts`` and ``wall_contacts`` by the pairs of a frame (frame k holds the rows
``start[k]:start[k + 1]``), ``grains`` not at all. D is the dimension, S the number of spin
components (1 in 2D, 3 in 3D).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from granufab.history import SERIES_UNITS, Frame
from granufab.packing import Array, IntArray

__all__ = [
    "FORMAT_NAME",
    "NAME_BYTES",
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
SCHEMA_VERSION = 1
NAME_BYTES = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One attribute or dataset of the run file.

    Attributes:
        name: HDF5 path; attributes of the root group start with ``@``.
        dtype: numpy dtype; attributes may also be ``text`` (UTF-8).
        shape: names of the axes; empty for scalars.
        units: of the stored numbers; free units unless the case says SI.
        meaning: in one line.
        default: what stands where the source lacks it; ``required`` if it must be there.
        source: the field of :class:`granufab.history.Frame` it is taken from.
        bit: of ``frames/present`` that is set in the frames that hold it; None if always held.
    """

    name: str
    dtype: str
    shape: tuple[str, ...] = ()
    units: str = "-"
    meaning: str
    default: str = "required"
    source: str = ""
    bit: int | None = None

    @property
    def growth(self) -> str:
        """First axis in words; ``attribute`` or ``scalar`` where there is none."""
        if self.name.startswith("@"):
            return "attribute"
        return self.shape[0] if self.shape else "scalar"

    def row_shape(self, dimension: int, grain_count: int) -> tuple[int, ...]:
        """Shape behind the growing axis (of the whole array where nothing grows)."""
        sizes = {"D": dimension, "S": 1 if dimension == 2 else 3, "grains": grain_count, "2": 2}
        axes = self.shape if self.growth == "grains" else self.shape[1:]
        return tuple(sizes[axis] for axis in axes)


def _attribute(name: str, dtype: str, meaning: str, default: str = "required") -> Entry:
    return Entry(name=f"@{name}", dtype=dtype, meaning=meaning, default=default)


def _grain(name: str, axes: str, units: str, meaning: str, bit: int | None = None) -> Entry:
    return Entry(
        name=f"grains/{name}",
        dtype="float64",
        shape=("frames", "grains", axes),
        units=units,
        meaning=meaning,
        default="required" if bit is None else "None",
        source=f"packing.grains.{name}",
        bit=bit,
    )


def _cell(name: str, axes: tuple[str, ...], dtype: str, units: str, meaning: str) -> Entry:
    return Entry(
        name=f"cell/{name}",
        dtype=dtype,
        shape=("frames", *axes),
        units=units,
        meaning=meaning,
        default="None",
        source=f"packing.cell.{name}",
        bit=2,
    )


def _pair(
    group: str, name: str, dtype: str, axes: tuple[str, ...], units: str, meaning: str, bit: int
) -> Entry:
    return Entry(
        name=f"{group}/{name}",
        dtype=dtype,
        shape=(group, *axes),
        units=units,
        meaning=meaning,
        default="None",
        source=f"packing.{group}.{name}",
        bit=bit,
    )


def _scalar(name: str, dtype: str, units: str, meaning: str, default: str = "required") -> Entry:
    source = "packing.time" if name == "time" else name
    return Entry(
        name=f"frames/{name.removeprefix('statistics.')}",
        dtype=dtype,
        shape=("frames",),
        units=units,
        meaning=meaning,
        default=default,
        source=source,
    )


_ATTRIBUTES = (
    _attribute("format", "text", f"always {FORMAT_NAME}"),
    _attribute("schema_version", "int64", f"version of this table, {SCHEMA_VERSION}"),
    _attribute("created", "text", "when the file was begun, ISO 8601, UTC"),
    _attribute("settings", "text", "resolved settings with the seed, JSON (Infinity allowed)"),
    _attribute("provenance", "text", "versions, platform, CPU and what the caller adds, JSON"),
    _attribute("dimension", "int64", "2 or 3", "0 before the first frame"),
    _attribute("grain_count", "int64", "number of grains", "0 before the first frame"),
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
    _grain("position", "D", "m", "centres, not wrapped into the cell"),
    _grain("velocity", "D", "m/s", "velocity; in a deforming cell the fluctuation v − L·r", 0),
    _grain("spin", "S", "rad/s", "angular velocity", 1),
)

_CELL = (
    _cell("matrix", ("D", "D"), "float64", "m", "lattice vectors as columns"),
    _cell("origin", ("D",), "float64", "m", "lower corner"),
    _cell("rate", ("D", "D"), "float64", "1/s", "velocity gradient L, > 0 expands"),
    _cell("periodic", ("D",), "uint8", "-", "1 where an axis is periodic, 0 where walls bound it"),
)

_SCALARS = (
    Entry(
        name="frames/present",
        dtype="int64",
        shape=("frames",),
        meaning="sum of 2^bit over the optional entries that the frame holds",
    ),
    _scalar("time", "float64", "s", "time", "NaN"),
    _scalar("eps_q", "float64", "-", "running deviatoric strain"),
    _scalar("eps_q_total", "float64", "-", "accumulated deviatoric strain ∫|dε_q|"),
    _scalar("stage", "int64", "-", "index of the stage on the path"),
    _scalar("inertial_number", "float64", "-", "inertial number I"),
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
    _scalar("statistics.steps", "int64", "-", "steps since the previous record"),
    _scalar("statistics.nonconverged", "int64", "-", "of these, ended above the tolerance"),
    _scalar("statistics.sweeps", "float64", "-", "mean sweeps per step"),
    _scalar("statistics.residual", "float64", "-", "largest residual"),
    _scalar("statistics.residual_contact", "float64", "-", "largest single contact's share of it"),
    _scalar("statistics.violation", "float64", "mean diameter", "worst max(0, −ũ_n)·h"),
    _scalar("statistics.overlap", "float64", "mean diameter", "worst overlap"),
    _scalar("statistics.kinetic_ratio", "float64", "-", "kinetic energy / (p V)"),
    _scalar("statistics.pressure_error", "float64", "-", "worst relative error of driven stresses"),
    _scalar("statistics.contact_updates", "int64", "-", "local contact solves"),
    _scalar("statistics.seconds", "float64", "s", "wall time"),
)


def _start(group: str) -> Entry:
    return Entry(
        name=f"{group}/start",
        dtype="int64",
        shape=("frames + 1",),
        meaning="frame k holds the rows start[k] to start[k + 1] − 1",
        default="0",
    )


_CONTACTS = (
    _start("contacts"),
    _pair("contacts", "pair", "int32", ("2",), "-", "grains i, j by index, from 0", 4),
    _pair("contacts", "normal", "float64", ("D",), "-", "unit vector n from i to j", 4),
    _pair("contacts", "gap", "float64", (), "m", "surface distance, < 0 in overlap", 5),
    _pair(
        "contacts",
        "branch",
        "float64",
        ("D",),
        "m",
        "r_j − r_i; NaN (unwritten) where it is n·(R_i + R_j + gap)",
        6,
    ),
    _pair("contacts", "force", "float64", ("D",), "N", "on grain j (2D: per length)", 7),
    _pair("contacts", "image", "int32", ("D",), "-", "lattice shift of j's image", 8),
)

_WALL_CONTACTS = (
    _start("wall_contacts"),
    _pair("wall_contacts", "grain", "int32", (), "-", "grain by index, from 0", 9),
    _pair("wall_contacts", "wall", "int32", (), "-", "2·axis + side, side 0 is the lower face", 9),
    _pair("wall_contacts", "normal", "float64", ("D",), "-", "unit vector from grain to wall", 9),
    _pair("wall_contacts", "gap", "float64", (), "m", "surface distance, < 0 in overlap", 9),
    _pair("wall_contacts", "force", "float64", ("D",), "N", "on the wall (2D: per length)", 9),
)

_SERIES = (
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
