"""Pairs of grains within a distance, in a periodic, sheared or walled cell; and their order.

Grains are sorted into bins of fractional coordinates, so a tilted cell needs nothing special.
Positions are not wrapped: each pair carries the integer lattice shift (image) with which
r_j + C·image − r_i is the branch.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.memory import empty, zeros
from granufab.kernels.options import kernel, part
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


@part
def _sort_into_bins(position, origin, inverse, periodic, counts):
    count, dimension = position.shape
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
    return where, shift, start, items


@kernel
def find_pairs(position, radius, matrix, inverse, origin, periodic, skin, capacity):
    """All pairs i < j with surface distance below ``skin``.

    Returns:
        pairs (count, 2), images (count, D), and the count; if it exceeds ``capacity`` the arrays
        are cut there and the caller asks again with more room.
    """
    count, dimension = position.shape
    largest = 0.0
    for i in range(count):
        largest = larger(largest, radius[i])
    counts = bin_counts(inverse, 2.0 * largest + skin, periodic)
    where, shift, start, items = _sort_into_bins(position, origin, inverse, periodic, counts)
    pairs = empty((capacity, 2), np.int32)
    images = empty((capacity, dimension), np.int32)
    found = 0
    image = empty((dimension,), np.int64)
    neighbours = 3**dimension
    for i in range(count):
        for code in range(neighbours):
            rest = code
            index = 0
            outside = False
            for k in range(dimension):
                offset = rest % 3 - 1
                rest //= 3
                place = where[i, k] + offset
                wraps = 0
                if place < 0 or place >= counts[k]:
                    if not periodic[k]:
                        outside = True
                    wraps = -1 if place < 0 else 1
                    place -= wraps * counts[k]
                image[k] = wraps
                index = index * counts[k] + place
            if outside:
                continue
            for at in range(start[index], start[index + 1]):
                j = items[at]
                if j <= i:
                    continue
                square = 0.0
                for k in range(dimension):
                    x = position[j, k] - position[i, k]
                    for l in range(dimension):
                        x += matrix[k, l] * (image[l] + shift[i, l] - shift[j, l])
                    square += x * x
                reach = radius[i] + radius[j] + skin
                if square < reach * reach:
                    if found < capacity:
                        pairs[found, 0] = i
                        pairs[found, 1] = j
                        for k in range(dimension):
                            images[found, k] = image[k] + shift[i, k] - shift[j, k]
                    found += 1
    return pairs, images, found


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


@kernel
def _morton_keys(position, origin, inverse):
    """Place of every grain along the curve."""
    count, dimension = position.shape
    bits = 20 if dimension == 3 else 30
    keys = zeros((count,), np.int64)
    for i in range(count):
        for k in range(dimension):
            s = 0.0
            for l in range(dimension):
                s += inverse[k, l] * (position[i, l] - origin[l])
            place = whole((s - floor(s)) * 2.0**bits)
            for bit in range(bits):
                keys[i] |= ((place >> bit) & 1) << (bit * dimension + k)
    return keys
