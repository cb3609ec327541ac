"""Two tables: grains, and contacts by the numbers of their grains."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granufab.io.foreign_writer import ForeignWriter
from granufab.io.writers.columns import gaps, numbers, only_state, rows
from granufab.packing import Contacts, Packing

__all__ = ["CSV", "write_csv"]


def _files(path: Path) -> tuple[Path, ...]:
    return tuple(path.with_name(f"{path.stem}_{part}{path.suffix}") for part in _PARTS)


_PARTS = ("grains", "contacts")


def _fill(states: Iterable[Packing], files: Sequence[Path]) -> None:
    packing = only_state(states)
    _table(files[0], _grains(packing))
    _table(files[1], _contacts(packing))


def _table(path: Path, columns: dict[str, NDArray]) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(",".join(columns) + "\n")
        stream.writelines(rows(list(columns.values()), ","))


def _grains(packing: Packing) -> dict[str, NDArray]:
    grains = packing.grains
    columns: dict[str, NDArray] = {"id": numbers(packing)}
    columns |= _named("", grains.position)
    columns["radius"] = grains.radius
    if grains.mass is not None:
        columns["mass"] = grains.mass
    if grains.velocity is not None:
        columns |= _named("v", grains.velocity)
    if grains.spin is not None:
        turning = grains.spin
        columns |= _named("w", turning) if turning.shape[1] == 3 else {"wz": turning[:, 0]}
    return columns


def _contacts(packing: Packing) -> dict[str, NDArray]:
    contacts = packing.contacts
    if contacts is None:
        contacts = Contacts(
            pair=np.zeros((0, 2), np.int64), normal=np.zeros((0, packing.dimension))
        )
    number = numbers(packing)[contacts.pair]
    columns: dict[str, NDArray] = {"id1": number[:, 0], "id2": number[:, 1]}
    columns |= _named("n", contacts.normal)
    if contacts.force is not None:
        columns |= _named("f", contacts.force)
    columns["gap"] = gaps(packing, contacts)
    return columns


def _named(prefix: str, vectors: NDArray) -> dict[str, NDArray]:
    return {f"{prefix}{'xyz'[k]}": vectors[:, k] for k in range(vectors.shape[1])}


CSV = ForeignWriter(
    key="csv",
    name="CSV tables",
    suffixes=(".csv",),
    fill=_fill,
    files=_files,
    left_out="cell and time",
)
"""``name_grains.csv`` and ``name_contacts.csv``."""


def write_csv(packing: Packing, path: Path | str, *, force: bool = False) -> tuple[Path, ...]:
    """Tables of grains and contacts; forces act on the second grain, compression positive.

    See :meth:`ForeignWriter.save`; ``name.csv`` gives ``name_grains.csv``, ``name_contacts.csv``.
    """
    return CSV.save([packing], path, force=force)
