"""Tables of text that a user made: grains, and contacts beside them.

Columns are recognised by their names (x, y, z, radius, id, i, j, nx, fn, …) or told by a map; a
column ``frame`` or ``time`` makes a series. Numbers in lists of contacts are those of the column
``id``, else rows, counted from 0 or 1, whichever fits. Forces act on the second grain and normals
point to it unless the map's section [conventions] says otherwise; the sense of a normal force is
that in which most contacts are squeezed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.table_frames import FramedTable, Rows
from granufab.io.table_layout import TableLayout, sniff_layout, table_layout
from granufab.io.table_roles import CONTACT_NAMES, GRAIN_NAMES, column_roles, obvious_roles
from granufab.packing import Array

__all__ = ["FORMAT"]

_SECTIONS = ("grains", "contacts", "conventions")
_CONVENTIONS: dict[str, tuple[str | int, ...]] = {
    "compression": (1, -1),
    "force_on": ("first", "second"),
    "normal_to": ("first", "second"),
}
_HEAD = 4096
_NEAR = 0.1  # misfit of a distance and two radii, as a share, of pairs that touch


def _matches(path: Path, head: bytes) -> bool:
    layout = sniff_layout(head, whole=len(head) < _HEAD)
    return layout is not None and (_lists_contacts(layout.names) or _lists_grains(layout.names))


def _lists_contacts(names: Sequence[str]) -> bool:
    return {"i", "j"} <= set(obvious_roles(names, CONTACT_NAMES))


def _lists_grains(names: Sequence[str]) -> bool:
    roles = set(obvious_roles(names, GRAIN_NAMES))
    return {"x", "y"} <= roles and bool(roles & {"radius", "diameter", "volume", "id", "z"})


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    _check_map(options.columns)
    tables = {kind: [] for kind in ("grains", "contacts")}
    for path, kind, layout in _sorted_kinds(paths, options.columns):
        known = GRAIN_NAMES if kind == "grains" else CONTACT_NAMES
        given = options.columns.get(kind, {})
        roles = column_roles(path, layout.names, layout.width, known, given, kind)
        needed = ("x", "y") if kind == "grains" else ("i", "j")
        if missing := [role for role in needed if role not in roles]:
            raise MissingData(
                f"{path}: no column is known to hold {' or '.join(missing)} of {kind}; "
                "say which with --columns FILE.toml"
            )
        tables[kind].append(FramedTable(path, layout, roles))
    samples = _paired(tables["grains"], tables["contacts"], paths)
    frames = [(sample, key) for sample in samples for key in sample.keys]
    every = [*tables["grains"], *tables["contacts"]]
    return LazyFrames(
        count=len(frames),
        parse=lambda k: frames[k][0].frame(frames[k][1], options),
        unknown=tuple(dict.fromkeys(name for table in every for name in _unused(table))),
        notes=tuple(note for sample in samples for note in sample.notes()),
    )


def _check_map(columns: Mapping[str, Mapping[str, str | int]]) -> None:
    for section in columns:
        if section not in _SECTIONS:
            raise InvalidSettings(
                f"columns: section [{section}] is unknown, allowed: {', '.join(_SECTIONS)}"
            )
    for name, value in columns.get("conventions", {}).items():
        if isinstance(value, bool) or value not in _CONVENTIONS.get(name, ()):
            words = "; ".join(f"{key} = {a!r} or {b!r}" for key, (a, b) in _CONVENTIONS.items())
            raise InvalidSettings(f"columns: [conventions] {name} = {value!r}, allowed: {words}")


def _sorted_kinds(
    paths: Sequence[Path], columns: Mapping[str, Mapping[str, str | int]]
) -> list[tuple[Path, str, TableLayout]]:
    """Which files list grains and which contacts; where nothing tells, they alternate."""
    found = []
    both = "grains" in columns and "contacts" in columns
    turn = "grains"
    for path in paths:
        layout = table_layout(path)
        fits = [k for k in ("grains", "contacts") if _all_named(layout.names, columns.get(k))]
        if len(fits) == 1:
            kind = fits[0]
        elif _lists_contacts(layout.names):
            kind = "contacts"
        elif _lists_grains(layout.names):
            kind = "grains"
        else:
            kind = turn
        turn = "contacts" if kind == "grains" and both else "grains"
        found.append((path, kind, layout))
    return found


def _all_named(names: Sequence[str], given: Mapping[str, str | int] | None) -> bool:
    words = [value for value in (given or {}).values() if isinstance(value, str)]
    return bool(words) and all(word in names for word in words)


def _unused(table: FramedTable) -> list[str]:
    used = set(table.roles.values())
    return [name for k, name in enumerate(table.layout.names) if k not in used]


@dataclass(frozen=True, slots=True, eq=False)
class _Sample:
    """Grains and, where there are any, the contacts between them."""

    grains: FramedTable
    contacts: FramedTable | None

    @property
    def keys(self) -> list[float]:
        """The frames, up to the last for which contacts are listed."""
        keys = list(self.grains.spans)
        if self.contacts is None or self.contacts.key != self.grains.key or not keys:
            return keys
        listed = [place for place, key in enumerate(keys) if key in self.contacts.spans]
        return keys[: listed[-1] + 1] if listed else keys

    def notes(self) -> list[str]:
        """What of the tables is left out."""
        if self.contacts is None:
            return self.grains.notes
        notes = [*self.grains.notes, *self.contacts.notes]
        late = len(self.grains.spans) - len(self.keys)
        if late:
            notes.append(f"{self.contacts.path}: ends {late} frames before the grains do")
        lone = [key for key in self.contacts.spans if key not in self.grains.spans]
        if lone and self.contacts.key == self.grains.key:
            notes.append(
                f"{self.contacts.path}: contacts of {len(lone)} frames without grains are left "
                f"out, the first of {self.contacts.key} {lone[0]:g}"
            )
        return notes

    def frame(self, key: float, options: ReadOptions) -> FoundFrame:
        rows = self.grains.rows(key)
        dimension = 3 if "z" in rows else 2
        position = rows.vector("?", dimension)
        assert position is not None
        radius = _radius(rows, dimension)
        contacts = self._contacts(key, dimension, options)
        number = rows.whole("id") if "id" in rows else None
        if number is None and contacts is not None:
            number = np.arange(rows.count) + _base(contacts, position, radius)
        return FoundFrame(
            place=rows.place,
            position=position,
            radius=radius,
            number=number,
            wall=rows["wall"] != 0 if "wall" in rows else None,
            mass=rows.get("mass"),
            velocity=rows.vector("v?", dimension),
            spin=_spin(rows, dimension),
            contacts=contacts,
            time=_first(rows, "time"),
            step=None if "frame" not in rows or not rows.count else int(rows["frame"][0]),
        )

    def _contacts(self, key: float, dimension: int, options: ReadOptions) -> FoundContacts | None:
        if self.contacts is None:
            return None
        if self.grains.key != self.contacts.key:  # then either table holds one frame
            key = next(iter(self.contacts.spans), 0.0)
        rows = self.contacts.rows(key)
        says: dict[str, Any] = dict(options.columns.get("conventions", {}))
        return FoundContacts(
            place=rows.place,
            first=rows.whole("i"),
            second=rows.whole("j"),
            wall=rows["wall"] != 0 if "wall" in rows else None,
            normal=rows.vector("n?", dimension),
            point=rows.vector("p?", dimension),
            gap=_gap(rows),
            force=rows.vector("f?", dimension),
            normal_force=rows.get("fn"),
            tangential_size=rows.get("ft"),
            compression=says.get("compression"),
            force_on=says.get("force_on"),
            normal_to=says.get("normal_to", "second"),
        )


def _paired(
    grains: Sequence[FramedTable], contacts: Sequence[FramedTable], paths: Sequence[Path]
) -> list[_Sample]:
    if not grains:
        raise MissingData(f"{paths[0]}: contacts without grains; give the table of grains with it")
    if contacts and len(contacts) != len(grains):
        raise MissingData(
            f"{paths[0]}: {len(grains)} tables of grains and {len(contacts)} of contacts; give as "
            "many of each, in the same order"
        )
    if not contacts:
        return [_Sample(table, None) for table in grains]
    samples = [_Sample(*both) for both in zip(grains, contacts, strict=True)]
    for sample in samples:
        _check_keys(sample)
    return samples


def _check_keys(sample: _Sample) -> None:
    assert sample.contacts is not None
    for table, other in ((sample.grains, sample.contacts), (sample.contacts, sample.grains)):
        if len(table.spans) > 1 and other.key != table.key:
            raise MissingData(
                f"{table.path} holds {len(table.spans)} frames by {table.key}, but {other.path} "
                f"has no column {table.key}; add it, or name it with --columns FILE.toml"
            )


def _radius(rows: Rows, dimension: int) -> Array | None:
    """Radii, from diameters or as those of spheres (disks) of the same volume (area)."""
    if "radius" in rows:
        return rows["radius"]
    if "diameter" in rows:
        return 0.5 * rows["diameter"]
    if "volume" in rows:
        size = np.maximum(rows["volume"], 0.0)
        return np.cbrt(0.75 / np.pi * size) if dimension == 3 else np.sqrt(size / np.pi)
    return None


def _spin(rows: Rows, dimension: int) -> Array | None:
    if dimension == 2:
        return rows["wz"][:, None] if "wz" in rows else None
    return rows.vector("w?", 3) if "wz" in rows else None


def _gap(rows: Rows) -> Array | None:
    if "gap" in rows:
        return rows["gap"]
    return -rows["overlap"] if "overlap" in rows else None


def _first(rows: Rows, role: str) -> float | None:
    return float(rows[role][0]) if role in rows and rows.count else None


def _base(contacts: FoundContacts, position: Array, radius: Array | None) -> int:
    """Whether rows are counted from 0 or 1: by the numbers, else by which pairs touch."""
    pair = np.stack([contacts.first, contacts.second], axis=1)
    count = len(position)
    if pair.size == 0 or pair.min() < 1 or pair.max() > count:
        return 0
    if pair.max() == count:
        return 1
    size = np.ones(count) if radius is None else radius
    touching = []
    for base in (0, 1):
        i, j = (pair - base).T
        length = np.linalg.norm(position[j] - position[i], axis=1)
        touching.append(int(np.sum(np.abs(length / (size[i] + size[j]) - 1.0) < _NEAR)))
    return int(touching[1] > touching[0])


FORMAT = ForeignFormat(
    key="csv",
    name="tables of text (grains, contacts)",
    matches=_matches,
    open=_open,
    byte_order_mark=True,
)
