"""Pairs of grains within a distance, in a periodic, sheared or walled cell; and their order.

Grains are sorted into bins of fractional coordinates, so a tilted cell needs nothing special.
Positions are not wrapped: each pair carries the integer lattice shift (image) with which
r_j + C·image − r_i is the branch.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granufab.kernels.memory import empty, zeros
from granufab.kernels.options import kernel, part, steady
from granufab.kernels.step_arrays import PIECES, piece_of
from granufab.kernels.tracing import floor, larger, root, smaller, whole

__all__ = ["bin_counts", "find_pairs", "find_wall_pairs", "morton_order"]


@part
def bin_counts(inverse, reach, periodic):
    """Bins per axis so that a bin is at least ``reach`` wide; 1 where fewer than 3 would fit."""
    dimension = len(inverse)
    counts = empty((dimension,), np.int64)
    for k in range(dimension):
        square = 0.0
        for l in range(dimension):
            square += inverse[k, l] ** 2
        number = whole(1.0 / (root(square) * reach))
        counts[k] = number if number >= (3 if periodic[k] else 1) else 1
    return counts


@kernel
def _sort_into_bins(position, radius, origin, inverse, periodic, skin):
    count, dimension = position.shape
    largest = 0.0
    for i in range(count):
        largest = larger(largest, radius[i])
    counts = bin_counts(inverse, 2.0 * largest + skin, periodic)
    total = 1
    for k in range(dimension):
        total *= counts[k]
    where = empty((count, dimension), np.int64)
    shift = zeros((count, dimension), np.int64)
    start = zeros((total + 1,), np.int64)
    flat = empty((count,), np.int64)
    for i in range(count):
        index = 0
        for k in range(dimension):
            s = 0.0
            for l in range(dimension):
                s += inverse[k, l] * (position[i, l] - origin[l])
            if periodic[k]:
                turns = floor(s)
                shift[i, k] = whole(turns)
                s -= turns
            place = smaller(larger(whole(s * counts[k]), 0), counts[k] - 1)
            where[i, k] = place
            index = index * counts[k] + place
        flat[i] = index
        start[index + 1] += 1
    for b in range(total):
        start[b + 1] += start[b]
    items = empty((count,), np.int64)
    fill = empty((total,), np.int64)
    for b in range(total):
        fill[b] = start[b]
    for i in range(count):
        items[fill[flat[i]]] = i
        fill[flat[i]] += 1
    return counts, where, shift, start, items


def find_pairs(
    position: np.ndarray,
    radius: np.ndarray,
    cell: tuple[np.ndarray, np.ndarray, np.ndarray],
    skin: float,
    *,
    room: int = 0,
    run: Callable[[Callable[..., Any], tuple[Any, ...]], Any] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """All pairs i < j with surface distance below ``skin``, in the order of i.

    Args:
        position, radius: of the grains [m], shapes (N, D), (N,).
        cell: (matrix, origin, periodic).
        skin: surface distance [m].
        room: pairs expected, so that memory suffices at once.
        run: called with a kernel and arguments: calls it for every member of a team, with the
            member's number and their count added; default: one member.
    Returns:
        pairs (pair_count, 2), images (pair_count, D).
    """
    matrix, origin, periodic = cell
    inverse = np.linalg.inv(matrix)
    bins = _sort_into_bins(position, radius, origin, inverse, periodic, skin)
    found = np.zeros(PIECES, np.int64)
    wraps = np.zeros((PIECES, len(matrix)), np.int64)
    most = max(16, 2 * room // PIECES)
    while True:
        pairs = np.empty((PIECES, most, 2), np.int32)
        images = np.empty((PIECES, most, position.shape[1]), np.int32)
        arguments = (position, radius, matrix, periodic, skin, *bins, wraps, pairs, images, found)
        if run is None:
            _search_pieces(*arguments, 0, 1)
        else:
            run(_search_pieces, arguments)
        if found.max() <= most:
            break
        most = int(found.max())
    heads = [slice(int(count)) for count in found]
    return (
        np.concatenate([part[head] for part, head in zip(pairs, heads, strict=True)]),
        np.concatenate([part[head] for part, head in zip(images, heads, strict=True)]),
    )


@steady
def _search_pieces(
    position, radius, matrix, periodic, skin, counts, where, shift, start, items,
    wraps, pairs, images, found, member, members,
):  # fmt: skip
    """Find the pairs of this member's pieces of the grains; ``found`` tells how many there are."""
    for piece in range(member, PIECES, members):
        first, end = piece_of(len(position), piece)
        count, image = 0, wraps[piece]
        for i in range(first, end):
            for code in range(3 ** len(matrix)):
                index = _neighbour_bin(where, counts, periodic, i, code, image)
                if index < 0:
                    continue
                for at in range(start[index], start[index + 1]):
                    j = items[at]
                    if j <= i or not _is_near(
                        position, radius, matrix, shift, image, skin, i, j
                    ):  # fmt: skip
                        continue
                    if count < pairs.shape[1]:
                        pairs[piece, count, 0] = i
                        pairs[piece, count, 1] = j
                        for k in range(len(matrix)):
                            images[piece, count, k] = image[k] + shift[i, k] - shift[j, k]
                    count += 1
        found[piece] = count


@part
def _neighbour_bin(where, counts, periodic, i, code, image):
    """A bin around grain i, and in ``image`` how it was wrapped; −1 outside of walls."""
    index, rest = 0, code
    for k in range(len(counts)):
        place = where[i, k] + rest % 3 - 1
        rest //= 3
        wraps = 0
        if place < 0 or place >= counts[k]:
            if not periodic[k]:
                return -1
            wraps = -1 if place < 0 else 1
            place -= wraps * counts[k]
        image[k] = wraps
        index = index * counts[k] + place
    return index


@part
def _is_near(position, radius, matrix, shift, image, skin, i, j):
    square = 0.0
    for k in range(len(matrix)):
        x = position[j, k] - position[i, k]
        for l in range(len(matrix)):
            x += matrix[k, l] * (image[l] + shift[i, l] - shift[j, l])
        square += x * x
    reach = radius[i] + radius[j] + skin
    return square < reach * reach


@kernel
def find_wall_pairs(position, radius, matrix, origin, periodic, skin, capacity):
    """Pairs of a grain and a flat wall 2·axis + side within ``skin``; as (pairs, count)."""
    count, dimension = position.shape
    pairs = empty((capacity, 2), np.int32)
    found = 0
    for i in range(count):
        for k in range(dimension):
            if periodic[k]:
                continue
            low = position[i, k] - origin[k] - radius[i]
            high = origin[k] + matrix[k, k] - position[i, k] - radius[i]
            for side in range(2):
                if (low if side == 0 else high) < skin:
                    if found < capacity:
                        pairs[found, 0] = i
                        pairs[found, 1] = 2 * k + side
                    found += 1
    return pairs, found


def morton_order(position: np.ndarray, origin: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Order of grains along a Z-curve through the cell: neighbours lie near in memory."""
    return np.argsort(_morton_keys(position, origin, inverse), kind="stable")


def _morton_keys(position, origin, inverse):
    """Place of every grain along the curve: the bits of its D fractional coordinates in turn."""
    dimension = position.shape[1]
    fraction = (position - origin) @ inverse.T
    fraction -= np.floor(fraction)
    place = (fraction * 2.0 ** (20 if dimension == 3 else 30)).astype(np.int64)
    for shift, mask in _SPREAD[dimension]:
        place = (place | (place << shift)) & mask
    return (place << np.arange(dimension)).sum(axis=1)


_SPREAD = {
    2: (
        (16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333), (1, 0x5555555555555555),
    ),
    3: (
        (32, 0x001F00000000FFFF), (16, 0x001F0000FF0000FF), (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
    ),
}  # fmt: skip
"""By dimension: shifts and masks that move the bits of a number D places apart."""
