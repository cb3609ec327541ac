"""Which column holds what: the names that LAMMPS gives, and those that the user gives.

The columns of a ``dump local`` are named after computes (``c_1[3]``) and say nothing; the user's
``columns = {"contacts": {...}}`` does, or the file's own names do (``dump_modify colname``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from granufab.errors import InvalidSettings

__all__ = ["CONTACT_WORDS", "GRAIN_WORDS", "Columns", "find_columns"]

GRAIN_WORDS: dict[str, tuple[str, ...]] = {
    "id": (), "type": (), "mol": (), "radius": (), "diameter": (), "mass": (), "density": (),
    "x": (), "y": (), "z": (), "xu": (), "yu": (), "zu": (), "xs": (), "ys": (), "zs": (),
    "xsu": (), "ysu": (), "zsu": (), "ix": (), "iy": (), "iz": (), "vx": (), "vy": (), "vz": (),
    "omegax": (), "omegay": (), "omegaz": (), "fx": (), "fy": (), "fz": (),
    "tqx": (), "tqy": (), "tqz": (), "angmomx": (), "angmomy": (), "angmomz": (), "q": (),
    "element": (), "proc": (),
}  # fmt: skip
"""What a column of atoms can hold, by LAMMPS' word, and other words for it."""

CONTACT_WORDS: dict[str, tuple[str, ...]] = {
    "i": ("id1", "patom1", "atom1"), "j": ("id2", "patom2", "atom2"),
    "fx": (), "fy": (), "fz": (), "ftx": (), "fty": (), "ftz": (),
    "nx": (), "ny": (), "nz": (), "fn": (), "cx": (), "cy": (), "cz": (), "overlap": (),
    "index": (), "dist": (), "dx": (), "dy": (), "dz": (), "force": (), "ft": (), "periodic": (),
    "unused": (),
}  # fmt: skip
"""What a column of contacts can hold: bodies i and j, force (fx, fy, fz), a tangential part that it
lacks (ftx, fty, ftz), normal n, its size fn (compression positive) with n, point c, overlap; the
rest is known and not needed."""

_LIGGGHTS: dict[str, tuple[str, ...]] = {
    "pos": ("unused",) * 6,
    "vel": ("unused",) * 6,
    "id": ("i", "j", "periodic"),
    "force": ("fx", "fy", "fz"),
    "force_normal": ("unused",) * 3,
    "force_tangential": ("unused",) * 3,
    "torque": ("unused",) * 3,
    "torque_normal": ("unused",) * 3,
    "torque_tangential": ("unused",) * 3,
    "contactArea": ("unused",),
    "delta": ("overlap",),
    "heatFlux": ("unused",),
    "contactPoint": ("cx", "cy", "cz"),
}
"""Columns that each word of LIGGGHTS' ``compute pair/gran/local`` gives; ``history`` fills up."""


@dataclass(frozen=True, slots=True)
class Columns:
    """Where the columns of one frame are: 0-based place by what it holds, and the rest's names."""

    place: Mapping[str, int]
    unknown: tuple[str, ...]

    def has(self, *words: str) -> bool:
        """Whether all these are there."""
        return all(word in self.place for word in words)


def find_columns(
    names: Sequence[str],
    words: Mapping[str, tuple[str, ...]],
    given: Mapping[str, str | int],
    section: str,
) -> Columns:
    """Match the columns of a file with what is known, the user's words first.

    Args:
        names: of the file's columns.
        words: what a column can hold, and other words for it.
        given: the user's map, with names or 1-based numbers of columns; ``order`` names all
            columns at once, in LIGGGHTS' words or in ours.
        section: of the user's map, for messages.
    Raises:
        InvalidSettings: the map names something unknown, or a column that is not there.
    """
    place: dict[str, int] = {}
    for column, name in enumerate(names):
        for word, others in words.items():
            if name == word or name in others:
                place.setdefault(word, column)
    if "order" in given:
        place = _ordered(str(given["order"]).split(), names, words, section)
    for word, column in given.items():
        if word != "order":
            place[_known(word, words, section)] = _column(column, names, f"{section}.{word}")
    used = set(place.values())
    return Columns(place, tuple(name for k, name in enumerate(names) if k not in used))


def _known(word: str, words: Mapping[str, tuple[str, ...]], section: str) -> str:
    for known, others in words.items():
        if word == known or word in others:
            return known
    raise InvalidSettings(f"columns: {section}.{word} is unknown, allowed: {', '.join(words)}")


def _column(given: str | int, names: Sequence[str], what: str) -> int:
    if isinstance(given, int) or str(given).isdigit():
        number = int(given)
        if not 1 <= number <= len(names):
            raise InvalidSettings(f"columns: {what} is column {number}, allowed: 1..{len(names)}")
        return number - 1
    if given not in names:
        raise InvalidSettings(
            f"columns: {what} is {given!r}, which is not among {', '.join(names)}"
        )
    return list(names).index(given)


def _ordered(
    order: Sequence[str],
    names: Sequence[str],
    words: Mapping[str, tuple[str, ...]],
    section: str,
) -> dict[str, int]:
    """Columns by a list of all their words."""
    flat: list[str] = []
    liggghts = section == "contacts" and ("id" in order or "pos" in order)
    for word in order:
        if liggghts and word in _LIGGGHTS:
            flat += _LIGGGHTS[word]
        elif liggghts and word == "history":
            flat.append("history")
        else:
            flat.append(_known(word, words, section))
    if "history" in flat:
        at = flat.index("history")
        flat[at : at + 1] = ["unused"] * (len(names) - len(flat) + 1)
    if len(flat) != len(names):
        raise InvalidSettings(
            f"columns: {section}.order gives {len(flat)} columns, but the file has {len(names)}: "
            f"{', '.join(names)}"
        )
    return {word: k for k, word in enumerate(flat) if word != "unused"}
