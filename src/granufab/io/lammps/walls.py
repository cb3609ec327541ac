"""Local dumps of contacts with walls, beside those of grains: they are told apart and counted.

``compute wall/gran/local`` of LIGGGHTS gives mesh, triangle and grain where ``pair/gran/local``
gives two grains and whether the pair is periodic, so in the same columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from granufab.errors import InvalidSettings
from granufab.io.found import FoundContacts
from granufab.io.lammps.columns import CONTACT_WORDS, find_columns
from granufab.io.lammps.contacts import contact_columns
from granufab.io.lammps.dump_index import DumpFrame
from granufab.io.lammps.grains import frame_columns
from granufab.io.read_options import ReadOptions

__all__ = ["apart", "with_walls"]

Files = list[list[DumpFrame]]


def apart(files: Files, options: ReadOptions) -> tuple[Files, Files]:
    """Files of contacts between grains, and of those with walls; files with other columns differ.

    Raises:
        InvalidSettings: the user's columns do not fit.
        CorruptFile: rows are not what the header says.
    """
    families: dict[tuple[str, ...], Files] = {}
    for frames in files:
        families.setdefault(frames[0].columns, []).append(frames)
    grains: Files = []
    walls: Files = []
    for family in families.values():
        (walls if _of_walls(family, options) else grains).extend(family)
    return grains, walls


def _of_walls(family: Files, options: ReadOptions) -> bool:
    """Whether the fullest frame joins meshes, which count from 0, and grains in third place."""
    fullest = max((frame for frames in family for frame in frames), key=lambda one: one.count)
    given = options.columns.get("walls", {})
    try:
        columns = contact_columns(fullest, options)
    except InvalidSettings:
        if not given:
            raise
        find_columns(fullest.columns, CONTACT_WORDS, given, "contacts")
        return True
    if not columns.has("i", "periodic") or fullest.count == 0:
        return False
    table = frame_columns(fullest, [columns.place["i"], columns.place["periodic"]])
    return bool((table[:, 0] == 0).any() or (~np.isin(table[:, 1], (0, 1))).any())


def with_walls(contacts: FoundContacts, frames: Sequence[DumpFrame]) -> FoundContacts:
    """A list of contacts with the rows of walls behind it, of which only the number matters."""
    count = sum(frame.count for frame in frames)
    if count == 0:
        return contacts
    longer = {}
    for field in fields(contacts):
        value = getattr(contacts, field.name)
        if isinstance(value, np.ndarray) and field.name != "wall":
            rows = np.zeros((count, *value.shape[1:]), value.dtype)
            longer[field.name] = np.concatenate([value, rows])
    none = np.zeros(len(contacts.first), bool)
    wall = none if contacts.wall is None else contacts.wall
    return replace(contacts, **longer, wall=np.concatenate([wall, np.ones(count, bool)]))
