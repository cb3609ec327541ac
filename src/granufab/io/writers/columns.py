"""Columns that several formats share: flat data in three coordinates, forces in their parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from granufab.fabric.neighbours import branch_vectors
from granufab.packing import Array, Contacts, IntArray, Packing

__all__ = ["force_parts", "gaps", "in_space", "numbers", "only_state", "rows", "spins", "starts"]


def only_state(states: Iterable[Packing]) -> Packing:
    """The one state of a format that holds one."""
    (state,) = states
    return state


def in_space(vectors: Array) -> Array:
    """Vectors with three components, the third 0 in 2D, shape (count, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def spins(spin: Array) -> Array:
    """Spins as vectors, about z in 2D, shape (count, 3)."""
    return np.pad(spin, ((0, 0), (3 - spin.shape[1], 0)))


def numbers(packing: Packing) -> IntArray:
    """Identities of the grains, shape (grain_count,)."""
    number = packing.grains.number
    return np.arange(packing.grains.count) if number is None else number


def gaps(packing: Packing, contacts: Contacts) -> Array:
    """Surface distances: listed, else from the branches [m], shape (contact_count,)."""
    if contacts.gap is not None:
        return contacts.gap
    length = np.linalg.norm(branch_vectors(packing), axis=1)
    return length - packing.grains.radius[contacts.pair].sum(axis=1)


def starts(packing: Packing, contacts: Contacts) -> tuple[Array, Array]:
    """Centre of grain i and of the image of j that it touches, shape (contact_count, D) each."""
    first = packing.grains.position[contacts.pair[:, 0]]
    return first, first + branch_vectors(packing)


def force_parts(contacts: Contacts) -> tuple[Array, Array] | None:
    """f·n and what is left of f, on grain j [N], or None where forces are unknown."""
    if contacts.force is None:
        return None
    along = np.einsum("ci,ci->c", contacts.force, contacts.normal)
    return along, contacts.force - along[:, None] * contacts.normal


def rows(columns: Sequence[NDArray], separator: str = " ") -> Iterator[str]:
    """Lines of text, one a row; every number gives itself back when it is read."""
    parts = [column[:, None] if column.ndim == 1 else column for column in columns]
    values = [part[:, k].tolist() for part in parts for k in range(part.shape[1])]
    for row in zip(*values, strict=True):
        yield separator.join(map(repr, row)) + "\n"
