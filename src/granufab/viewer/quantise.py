"""Real numbers as small whole ones: multiples of a step, which is said beside them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from granufab.packing import Array

__all__ = ["differences", "on_grid", "packed_bits", "smallest", "steps_of"]

_GRID = 2**16 - 1
_SIGNED = 2**15 - 1


def on_grid(values: Array, low: Array, high: Array) -> tuple[NDArray[np.uint16], Array]:
    """Points of a box as multiples of 1/65535 of its edges, counted from its lower corner.

    Args:
        values: shape (count, D), within the box.
        low: lower corner, shape (D,).
        high: upper corner, shape (D,).
    Returns:
        The multiples, and the step along each axis; a value is off by half a step at most.
    """
    step = np.maximum(high - low, np.finfo(np.float64).tiny) / _GRID
    return np.rint((values - low) / step).clip(0, _GRID).astype(np.uint16), step


def steps_of(values: NDArray) -> tuple[NDArray[np.int16], float]:
    """Numbers of either sign as multiples of 1/32767 of the largest.

    Returns:
        The multiples, and the step; a value is off by half a step at most.
    """
    largest = float(np.abs(values).max()) if values.size else 0.0
    step = largest / _SIGNED
    if not step > 0:
        return np.zeros(values.shape, dtype=np.int16), 0.0
    return np.rint(values / step).astype(np.int16), step


def smallest(whole: NDArray, bound: int) -> NDArray:
    """Whole numbers ≥ 0 below a bound in the smaller of two unsigned types."""
    return whole.astype(np.uint16 if bound <= 2**16 else np.uint32)


def differences(whole: NDArray) -> NDArray:
    """Each number less the one before, wrapping around: sums of them give the numbers back."""
    found = whole.copy()
    found[1:] -= whole[:-1]
    return found


def packed_bits(flags: NDArray) -> NDArray[np.uint8]:
    """Flags of each row eight to a byte, the first in the lowest bit."""
    return np.packbits(flags.astype(bool), axis=-1, bitorder="little")
