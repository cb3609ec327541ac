"""The moving cell: its tensors in the memory of the steps, and the shorter lattice when sheared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from granufab.packing import Array, IntArray

__all__ = ["Tensor", "shorten_cell"]

TILT_LIMIT = 0.5001


class _HasTensors(Protocol):
    @property
    def tensors(self) -> Array: ...


class Tensor:
    """Attribute that lies in ``tensors[place]`` of its owner; reading gives a frozen copy."""

    def __init__(self, place: int) -> None:
        self.place = place

    def __get__(self, owner: _HasTensors, kind: type | None = None) -> Array:
        value = owner.tensors[self.place].copy()
        value.flags.writeable = False
        return value

    def __set__(self, owner: _HasTensors, value: Array) -> None:
        owner.tensors[self.place] = value


def shorten_cell(
    matrix: Array,
    periodic: np.ndarray,
    remap: IntArray,
    shear_images: Callable[[int, int, int], None],
) -> None:
    """Replace lattice vectors tilted beyond 1/2 by their shorter equivalents, in place.

    The same lattice is described before and after, so no contact changes (Lees–Edwards remap).

    Args:
        matrix: lattice vectors as columns [m], shape (D, D).
        periodic: per axis.
        remap: accumulated integer change of the lattice basis, shape (D, D).
        shear_images: called with (flow, axis, turns) for every change.
    """
    dimension = len(matrix)
    for axis in range(dimension):
        for flow in range(dimension):
            if axis == flow or not (periodic[axis] and periodic[flow]):
                continue
            tilt = matrix[flow, axis] / matrix[flow, flow]
            turns = round(tilt)
            if abs(tilt) > TILT_LIMIT and turns:
                matrix[:, axis] -= turns * matrix[:, flow]
                remap[:, axis] -= turns * remap[:, flow]
                shear_images(flow, axis, turns)
