"""The contacts of a solve, packed in the order of the sweep for one stream through memory.

Eight contacts that share no body form a batch: field f of lane k of batch b is
slots[(b·fields + f)·8 + k]. A batch that could not be filled ends with empty lanes on a spare
body, the last row of ``bodies``. Batches come in chunks: grains that lie together, whose inner
contacts touch no other chunk, and last the contacts between chunks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.options import part
from granufab.kernels.tracing import traced

__all__ = ["Slots", "fields", "places"]


class Slots(NamedTuple):
    """Packed contacts.

    Attributes:
        values: numbers of all batches, shape (batch_count·fields·8,).
        first, second: bodies i, j, shape (batch_count·8,), unsigned.
        starts: first batch of every chunk, of the contacts between chunks, and the end, shape
            (chunk_count + 2,).
    """

    values: np.ndarray
    first: np.ndarray
    second: np.ndarray
    starts: np.ndarray


class Places(NamedTuple):
    """Where the fields of a contact begin.

    inverse_n, inverse_t hold 1/(W_nn + ε), 1/(W_tt + ε) with the cell's share; where normal and
    tangent couple (2D, stress-driven shape of the cell) they hold W_nn + ε, W_tt + ε themselves
    and cross holds W_nt.
    """

    normal: int
    length: int
    offset_n: int
    offset_t: int
    mu: int
    inverse_n: int
    inverse_t: int
    impulse_n: int
    impulse_t: int
    before_n: int
    before_t: int
    cross: int


@traced
def places(like):
    """Where the fields begin; ``like`` is a tuple of D zeros, numbers or lanes."""
    return (
        Places(0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)
        if len(like) == 2
        else Places(0, 3, 4, 5, 8, 9, 10, 11, 12, 15, 16, 19)
    )


@part
def fields(like, coupled):
    """Numbers that a contact takes."""
    cross = places(like).cross
    return cross + 1 if coupled and len(like) == 2 else cross
