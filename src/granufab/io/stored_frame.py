"""What the run file stores of a frame: arrays in the types of the schema."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from granufab.history import Frame
from granufab.io.schema import SCHEMA, derived_branch, source_value
from granufab.packing import Packing

__all__ = ["stored_frame"]

_BRANCH_TOLERANCE = 1e-12


def stored_frame(frame: Frame) -> dict[str, NDArray]:
    """The values to store by entry name, without those that the frame lacks.

    The branch is NaN where it follows from the radii and the gap.
    """
    packing = frame.packing
    dimension, count = packing.dimension, packing.grains.count
    values: dict[str, NDArray] = {}
    held = set()
    for entry in SCHEMA:
        value = source_value(frame, entry.source) if entry.source else None
        if entry.name == "frames/time" and value is None:
            value = np.nan
        if value is None:
            continue
        values[entry.name] = array = np.asarray(value, entry.dtype)
        held.add(entry.bit)
        if "contacts" not in entry.growth:
            values[entry.name] = array.reshape(entry.row_shape(dimension, count))
    present = sum(1 << bit for bit in held if bit is not None)
    values["frames/present"] = np.array(present, np.int64)
    if _branch_is_derived(packing):
        values["contacts/branch"] = np.full_like(values["contacts/branch"], np.nan)
    return values


def _branch_is_derived(packing: Packing) -> bool:
    contacts = packing.contacts
    if contacts is None or contacts.branch is None or contacts.gap is None:
        return False
    radius = packing.grains.radius
    derived = derived_branch(radius, contacts.pair, contacts.normal, contacts.gap)
    allowed = _BRANCH_TOLERANCE * (radius[contacts.pair[:, 0]] + radius[contacts.pair[:, 1]])
    return bool((np.abs(contacts.branch - derived) <= allowed[:, None]).all())
