"""Contacts of one frame of a local dump."""

from __future__ import annotations

import numpy as np

from granufab.errors import MissingData
from granufab.io.found import FoundContacts
from granufab.io.lammps.columns import CONTACT_WORDS, Columns
from granufab.io.lammps.dump_index import DumpFrame
from granufab.io.lammps.grains import frame_columns, known_columns, whole_numbers
from granufab.io.read_options import ReadOptions
from granufab.packing import Array

__all__ = ["contact_columns", "parse_contacts", "unnamed"]

_FORCE, _SHEAR = ("fx", "fy", "fz"), ("ftx", "fty", "ftz")
_NORMAL, _POINT = ("nx", "ny", "nz"), ("cx", "cy", "cz")


def contact_columns(frame: DumpFrame, options: ReadOptions) -> Columns:
    """Where a local dump's columns are, as far as names tell and the user says."""
    return known_columns(frame, CONTACT_WORDS, options, "contacts")


def unnamed(frame: DumpFrame) -> MissingData:
    """The error of columns that do not say which are the grains."""
    names = frame.columns
    one = names[1] if len(names) > 2 else "c_1[1]"
    two = names[2] if len(names) > 2 else "c_1[2]"
    return MissingData(
        f"{frame.path}: line {frame.line - 1}: the columns {' '.join(names)} do not say which hold "
        f'the grains and the force; name them with --columns: [contacts] i = "{one}", j = "{two}", '
        'fx = "…", fy = "…", fz = "…" (and ftx, fty, ftz where fx, fy, fz are the normal part '
        'only), or all in order: order = "index i j dist force fx fy fz ftx fty ftz ft"'
    )


def parse_contacts(frame: DumpFrame, columns: Columns) -> FoundContacts:
    """Read a frame's contacts; forces of two columns are flat.

    Raises:
        CorruptFile: the rows are not what the header says; names the line.
        MissingData: the columns of the grains are not known.
    """
    if frame.count == 0 and not columns.has("i", "j"):
        none = np.zeros(0, np.int64)
        return FoundContacts(first=none, second=none, place=frame.place)
    if not columns.has("i", "j"):
        raise unnamed(frame)
    words = ["i", "j"]
    for group in (_FORCE, _SHEAR, _NORMAL, _POINT):
        if columns.has(*group[:2]):
            words += [word for word in group if columns.has(word)]
    words += [word for word in ("fn", "overlap") if columns.has(word)]
    table = frame_columns(frame, [columns.place[word] for word in words])
    at = {word: k for k, word in enumerate(words)}
    return FoundContacts(
        place=frame.place,
        first=whole_numbers(table[:, 0], frame, "the first body"),
        second=whole_numbers(table[:, 1], frame, "the second body"),
        force=_force(table, at),
        force_on=None,
        normal=_vector(table, at, _NORMAL),
        normal_to=None,
        normal_force=table[:, at["fn"]] if "fn" in at else None,
        point=_vector(table, at, _POINT),
        gap=-table[:, at["overlap"]] if "overlap" in at else None,
    )


def _vector(table: Array, at: dict[str, int], words: tuple[str, str, str]) -> Array | None:
    if words[0] not in at:
        return None
    vector = np.zeros((len(table), 3))
    for k, word in enumerate(words):
        if word in at:
            vector[:, k] = table[:, at[word]]
    return vector


def _force(table: Array, at: dict[str, int]) -> Array | None:
    force = _vector(table, at, _FORCE)
    shear = _vector(table, at, _SHEAR)
    if force is None or shear is None:
        return force
    return np.add(force, shear, out=force)
