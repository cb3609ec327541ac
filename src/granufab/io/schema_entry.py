"""One entry of the run file's schema, and the kinds of entries that come often."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Entry", "attribute", "cell", "grain", "pair", "scalar", "start"]


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
        since: first schema version with it.
    """

    name: str
    dtype: str
    shape: tuple[str, ...] = ()
    units: str = "-"
    meaning: str
    default: str = "required"
    source: str = ""
    bit: int | None = None
    since: int = 1

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


def attribute(name: str, dtype: str, meaning: str, default: str = "required") -> Entry:
    """An attribute of the root group."""
    return Entry(name=f"@{name}", dtype=dtype, meaning=meaning, default=default)


def grain(name: str, axes: str, units: str, meaning: str, bit: int | None = None) -> Entry:
    """A quantity of the grains, per frame."""
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


def cell(name: str, axes: tuple[str, ...], dtype: str, units: str, meaning: str) -> Entry:
    """A quantity of the cell, per frame."""
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


def pair(
    group: str, name: str, dtype: str, axes: tuple[str, ...], units: str, meaning: str, bit: int
) -> Entry:
    """A quantity of the pairs of a group."""
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


def scalar(name: str, dtype: str, units: str, meaning: str, default: str = "required") -> Entry:
    """A number per frame."""
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


def start(group: str) -> Entry:
    """Where the pairs of each frame begin."""
    return Entry(
        name=f"{group}/start",
        dtype="int64",
        shape=("frames + 1",),
        meaning="frame k holds the rows start[k] to start[k + 1] − 1",
        default="0",
    )
