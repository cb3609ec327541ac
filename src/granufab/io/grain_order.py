"""The grains of a state in the order of another: many programs shuffle them between frames."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from granufab.packing import Grains, IntArray, Packing

__all__ = ["in_order"]


def in_order(packing: Packing, wanted: IntArray) -> Packing:
    """The packing with its grains in the order of some numbers, if they are the same grains.

    Args:
        packing: its grains have unique numbers.
        wanted: numbers, shape (grain_count,); other grains leave the packing as it is.
    """
    grains = packing.grains
    assert grains.number is not None
    if np.array_equal(grains.number, wanted):
        return packing
    order = np.argsort(grains.number, kind="stable")
    if not np.array_equal(grains.number[order], np.sort(wanted)):
        return packing
    rows = np.empty(len(wanted), np.int64)
    rows[np.argsort(wanted, kind="stable")] = order
    place = np.empty(len(rows), np.int64)
    place[rows] = np.arange(len(rows))
    moved: dict[str, Any] = {
        field.name: None if (value := getattr(grains, field.name)) is None else value[rows]
        for field in fields(grains)
    }
    contacts = packing.contacts
    if contacts is not None:
        contacts = replace(contacts, pair=place[contacts.pair])
    return replace(packing, grains=Grains(**moved), contacts=contacts)
