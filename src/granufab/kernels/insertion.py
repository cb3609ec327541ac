"""Random sequential addition of grains into a cell: the dilute random start of a sample."""

from __future__ import annotations

import numpy as np

from granufab.kernels.memory import empty, unlinked, zeros
from granufab.kernels.options import kernel, part
from granufab.kernels.tracing import larger, nearest, smaller, whole

__all__ = ["insert_randomly"]


@kernel
def insert_randomly(radius, size, periodic, tries, seed):
    """Place grains one after another at random positions without overlap.

    Args:
        radius: in order of placing (largest first is quickest) [m].
        size: edge lengths of an orthogonal cell at the origin [m], shape (D,).
        periodic: per axis; a walled axis keeps grains one radius inside.
        tries: attempts per grain.
        seed: of the random stream.
    Returns:
        positions (count, D) and the number placed.
    """
    np.random.seed(seed)  # noqa: NPY002  (numba's own stream)
    count, dimension = len(radius), len(size)
    widest = 0.0
    for i in range(count):
        widest = larger(widest, 2.0 * radius[i])
    bins = empty((dimension,), np.int64)
    total = 1
    for k in range(dimension):
        number = whole(size[k] / widest)
        bins[k] = number if number >= 3 else 1
        total *= bins[k]
    head = unlinked((total,), np.int64)
    following = unlinked((count,), np.int64)
    position = zeros((count, dimension), np.float64)
    trial = empty((dimension,), np.float64)
    where = empty((dimension,), np.int64)
    for i in range(count):
        placed = False
        for _ in range(tries):
            home = 0
            for k in range(dimension):
                low = 0.0 if periodic[k] else radius[i]
                trial[k] = low + (size[k] - 2.0 * low) * np.random.random()  # noqa: NPY002
                where[k] = smaller(whole(trial[k] / size[k] * bins[k]), bins[k] - 1)
                home = home * bins[k] + where[k]
            if not _overlaps(
                trial, radius, i, position, size, periodic, bins, where, head, following
            ):
                for k in range(dimension):
                    position[i, k] = trial[k]
                following[i] = head[home]
                head[home] = i
                placed = True
                break
        if not placed:
            return position, i
    return position, count


@part
def _overlaps(trial, radius, i, position, size, periodic, bins, where, head, following):
    dimension = len(size)
    for code in range(3**dimension):
        rest, index = code, 0
        skip = False
        for k in range(dimension):
            offset = rest % 3 - 1
            rest //= 3
            place = where[k] + offset
            if place < 0 or place >= bins[k]:
                if bins[k] == 1 or not periodic[k]:
                    skip = True
                place = (place + bins[k]) % bins[k]
            index = index * bins[k] + place
        if skip:
            continue
        j = head[index]
        while j >= 0:
            square = 0.0
            for k in range(dimension):
                x = trial[k] - position[j, k]
                if periodic[k]:
                    x -= size[k] * nearest(x / size[k])
                square += x * x
            if square < (radius[i] + radius[j]) ** 2:
                return True
            j = following[j]
    return False
