"""Text files of spam: ``id Sphere x y z r`` and ``idA idB nx ny nz Fn uN cx cy cz``.

The first line of the spheres, ``##PERIODIC:: Lx Ly Lz``, gives a box from the origin. Normals point
from A to B and F_n is negative in compression. The stored cell shifts are not used: they do not
reconcile with the positions, the minimum image does.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundCell, FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.read_options import ReadOptions
from granufab.io.text_rows import first_bytes, integers
from granufab.io.text_table import number_table
from granufab.packing import Array

__all__ = ["FORMAT"]

_PERIODIC = "##PERIODIC::"


def _matches(path: Path, head: bytes) -> bool:
    return _is_spheres(head) or _is_contacts(head)


def _is_spheres(head: bytes) -> bool:
    lines = [line for line in head.splitlines() if line and not line.startswith(b"#")]
    words = lines[0].split() if lines else []
    return len(words) == 6 and words[1] == b"Sphere"


def _is_contacts(head: bytes) -> bool:
    return head.lstrip(b"# \t").startswith(b"idA idB nx ny nz Fn")


def _sample(spheres: Path, contacts: Path | None) -> FoundFrame:
    table = number_table(spheres, (0, 2, 3, 4, 5), columns=6)
    _check_shapes(spheres)
    return FoundFrame(
        place=str(spheres),
        position=table[:, 1:4],
        radius=table[:, 4],
        number=integers(table[:, 0], str(spheres), "id"),
        dimension=3,
        cell=_box(spheres),
        contacts=None if contacts is None else _contacts(contacts),
    )


def _check_shapes(spheres: Path) -> None:
    """Refuse other shapes than spheres: their fifth number is no radius."""
    with spheres.open(errors="replace") as stream:
        for number, line in enumerate(stream, 1):
            words = line.split()
            if words and not words[0].startswith("#") and words[1] != "Sphere":
                raise CorruptFile(f"{spheres}: line {number}: shape {words[1]!r}, expected Sphere")


def _box(spheres: Path) -> FoundCell | None:
    with spheres.open(errors="replace") as stream:
        first = stream.readline()
    if not first.startswith(_PERIODIC):
        return None
    try:
        edges: Array = np.array([float(word) for word in first[len(_PERIODIC) :].split()])
    except ValueError:
        edges = np.zeros(0)
    if len(edges) != 3 or not (edges > 0).all():
        raise CorruptFile(f"{spheres}: line 1: the periodic box {first.strip()!r} has no 3 edges")
    return FoundCell(matrix=np.diag(edges), origin=np.zeros(3), periodic=(True, True, True))


def _contacts(path: Path) -> FoundContacts:
    table = number_table(path, range(6), columns=10)
    return FoundContacts(
        place=str(path),
        first=integers(table[:, 0], str(path), "idA"),
        second=integers(table[:, 1], str(path), "idB"),
        normal=table[:, 2:5],
        normal_force=table[:, 5],
        compression=-1,
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    heads = {path: first_bytes(path) for path in paths}
    spheres = [path for path, head in heads.items() if _is_spheres(head)]
    contacts = [path for path, head in heads.items() if _is_contacts(head)]
    for path in paths:
        if path not in (*spheres, *contacts):
            raise CorruptFile(
                f"{path}: line 1 begins neither rows 'id Sphere x y z r' nor contacts with the "
                "header 'idA idB nx ny nz Fn …'"
            )
    if len(spheres) != 1 or len(contacts) > 1:
        raise MissingData(
            f"{paths[0]}: give one file of spheres and at most one of contacts, got "
            f"{len(spheres)} and {len(contacts)}"
        )
    listed = contacts[0] if contacts else None
    return LazyFrames(count=1, parse=lambda _: _sample(spheres[0], listed))


FORMAT = ForeignFormat(
    key="spam", name="spam text (spheres, contacts)", matches=_matches, open=_open
)
