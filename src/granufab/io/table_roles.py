"""What the columns of a table hold: from a user's map, or from names that say it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from granufab.errors import InvalidSettings

__all__ = ["CONTACT_NAMES", "GRAIN_NAMES", "column_roles", "obvious_roles"]


def _axes(role: str, *stems: str) -> dict[str, tuple[str, ...]]:
    """Names of the three components: ``px``, ``p_x``, ``p0``, … of each stem ``p``."""
    return {
        role.replace("?", axis): tuple(
            stem.replace("?", form) for stem in stems for form in (axis, str(place))
        )
        for place, axis in enumerate("xyz")
    }


GRAIN_NAMES: dict[str, tuple[str, ...]] = {
    "id": ("id", "number", "particle", "particleid", "grainid", "label", "tag", "body", "bodyid"),
    **_axes("?", "?", "pos?", "position?", "?pos", "points?", "coordinates?", "centroid?", "c?"),
    "radius": ("r", "radius", "rad", "radii"),
    "diameter": ("diameter", "diam", "d", "equivalentdiameter", "equivalentdiameterarea"),
    "volume": ("volume", "area"),
    "mass": ("mass", "m"),
    **_axes("v?", "v?", "vel?", "velocity?"),
    **_axes("w?", "w?", "omega?", "spin?", "angularvelocity?"),
    "wall": ("wall", "iswall"),
    "frame": ("frame", "step", "timestep", "iteration"),
    "time": ("time", "t"),
}
"""Roles in a table of grains, with the names (letters and digits only) that mean them."""

_BODY = ("id", "particle", "p", "body", "grain", "label", "atom")

CONTACT_NAMES: dict[str, tuple[str, ...]] = {
    "i": ("i", "first", *(f"{stem}{mark}" for stem in _BODY for mark in "1ia")),
    "j": ("j", "second", *(f"{stem}{mark}" for stem in _BODY for mark in "2jb")),
    **_axes("n?", "n?", "normal?"),
    **_axes("p?", "p?", "point?", "contactpoint?", "c?", "?", "pos?", "position?"),
    **_axes("f?", "f?", "force?"),
    "fn": ("fn", "normalforce", "forcen", "forcenormal", "normal"),
    "ft": ("ft", "tangentialforce", "forcet", "tangential", "shearforce"),
    "gap": ("gap", "distance", "dn"),
    "overlap": ("overlap", "delta", "penetration", "un"),
    "wall": ("wall", "iswall"),
    "frame": GRAIN_NAMES["frame"],
    "time": GRAIN_NAMES["time"],
}
"""Roles in a table of contacts."""


def obvious_roles(names: Sequence[str], known: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """Columns (0-based) of the roles that some names tell, units in brackets apart."""
    plain = [re.sub(r"[^a-z0-9]", "", re.sub(r"[\[(].*", "", name.lower())) for name in names]
    found: dict[str, int] = {}
    for role, words in known.items():
        column = next((plain.index(word) for word in words if word in plain), None)
        if column is not None and column not in found.values():
            found[role] = column
    return found


def column_roles(
    path: Path,
    names: Sequence[str],
    width: int,
    known: Mapping[str, tuple[str, ...]],
    given: Mapping[str, str | int],
    section: str,
) -> dict[str, int]:
    """Columns of all roles, the user's words before what the header tells.

    Args:
        path: of the table, for messages.
        names: its header, may be empty.
        width: its columns.
        known: roles and their names.
        given: names or 1-based numbers of columns by role.
        section: where ``given`` stands in the user's file, for messages.
    Raises:
        InvalidSettings: an unknown role, or a column that the table does not have.
    """
    roles = obvious_roles(names, known)
    chosen: dict[str, int] = {}
    for role, column in given.items():
        if role not in known:
            near = difflib.get_close_matches(role, known, 1, 0.0)[0]
            raise InvalidSettings(
                f"columns: [{section}] {role} is unknown; did you mean {near}? "
                f"(allowed: {', '.join(known)})"
            )
        chosen[role] = _place(path, column, names, width, f"[{section}] {role}")
    kept = {r: c for r, c in roles.items() if r not in chosen and c not in chosen.values()}
    return kept | chosen


def _place(path: Path, column: str | int, names: Sequence[str], width: int, where: str) -> int:
    if isinstance(column, int) and not isinstance(column, bool):
        if not 1 <= column <= width:
            raise InvalidSettings(f"columns: {where} = {column}, but {path} has columns 1..{width}")
        return column - 1
    if column in names:
        return list(names).index(str(column))
    held = ", ".join(names) if names else "it has no header, give numbers"
    raise InvalidSettings(f"columns: {where} = {column!r} is not in {path} ({held})")
