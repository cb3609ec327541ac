"""Dumps of LAMMPS and LIGGGHTS: atoms, with the local dump of their contacts where there is one.

Atoms: any columns with positions (x, xu, xs or xsu), best with id and radius. Contacts: rows of
``compute property/local`` and ``pair/local`` (LIGGGHTS: ``pair/gran/local``), whose nameless
columns are told by the user or recognised by comparison with the grains.
"""

from __future__ import annotations

from pathlib import Path

from granufab.io.foreign_format import ForeignFormat
from granufab.io.lammps.series import open_dumps

__all__ = ["FORMAT"]

_STARTS = (b"ITEM: TIMESTEP", b"ITEM: UNITS", b"ITEM: TIME\n", b"ITEM: TIME\r")


def _matches(path: Path, head: bytes) -> bool:
    return head.startswith(_STARTS)


FORMAT = ForeignFormat(
    key="lammps_dump", name="LAMMPS or LIGGGHTS dump", matches=_matches, open=open_dumps
)
