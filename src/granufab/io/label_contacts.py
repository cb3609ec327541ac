"""Grains and contacts of an image in which every voxel (pixel) holds the number of its grain.

The image is read slab by slab. Two grains touch where voxels of both share a face; the normal is
that of the plane fitted to the centres of these faces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granufab.packing import Array, IntArray

__all__ = ["FEWEST_FACES", "LabelledContacts", "LabelledGrains", "label_contacts", "label_grains"]

FEWEST_FACES = 10
"""Contacts of fewer shared faces get the direction between the centroids as normal."""
_SLAB_VOXELS = 2_000_000
_FLAT = 0.05
"""Share of the in-plane spread below which shared faces lie on a line."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledGrains:
    """Grains of a label image.

    Attributes:
        number: labels, sorted, shape (grain_count,).
        position: centroids in voxels, the centre of the first voxel at 0, shape (grain_count, D).
        size: voxels of each grain, shape (grain_count,).
    """

    number: IntArray
    position: Array
    size: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelledContacts:
    """Touching labels.

    Attributes:
        first, second: labels, the smaller first, shape (contact_count,).
        normal: unit vectors of either sense, shape (contact_count, D).
        point: mean of the shared faces in voxels, shape (contact_count, D).
        faces: number of them, shape (contact_count,).
        fitted: whether the normal is that of a plane, shape (contact_count,).
    """

    first: IntArray
    second: IntArray
    normal: Array
    point: Array
    faces: IntArray
    fitted: NDArray[np.bool_]


def label_grains(image: NDArray) -> LabelledGrains:
    """Centroids and sizes of the labels above 0.

    Args:
        image: whole numbers, shape (n_1, …, n_D); may be mapped from a file.
    """
    numbers = [np.unique(slab[slab > 0]) for _, slab in _slabs(image, 0)]
    number = np.unique(np.concatenate([np.zeros(0, np.int64), *numbers])).astype(np.int64)
    size = np.zeros(len(number))
    total = np.zeros((len(number), image.ndim))
    for start, slab in _slabs(image, 0):
        where = np.nonzero(slab > 0)
        row = np.searchsorted(number, slab[where])
        size += np.bincount(row, minlength=len(number))
        for axis, place in enumerate(where):
            weight = place + (start if axis == 0 else 0)
            total[:, axis] += np.bincount(row, weights=weight, minlength=len(number))
    return LabelledGrains(number=number, position=total / size[:, None], size=size)


def label_contacts(image: NDArray, grains: LabelledGrains) -> LabelledContacts:
    r"""Pairs of labels that share faces, with normals from the faces.

    The normal is the direction in which the faces' centres spread least, the last eigenvector of
    :math:`\sum (x - \bar x)(x - \bar x)^T`.

    Args:
        image: as for :func:`label_grains`.
        grains: of the image.
    """
    pair, place = _shared_faces(image)
    order = np.lexsort((pair[:, 1], pair[:, 0]))
    pair, place = pair[order], place[order]
    starts = np.flatnonzero(np.r_[True, (np.diff(pair, axis=0) != 0).any(axis=1)][: len(pair)])
    unique = pair[starts]
    faces = np.diff(np.r_[starts, len(pair)])
    mean = _sums(place, starts) / faces[:, None]
    deviation = place - np.repeat(mean, faces, axis=0)
    spread = _sums(deviation[:, :, None] * deviation[:, None, :], starts)
    values, vectors = np.linalg.eigh(spread)
    branch = _between(grains, unique)
    fitted = (faces >= FEWEST_FACES) & (values[:, 1] > _FLAT * values[:, -1])
    normal = np.where(fitted[:, None], vectors[:, :, 0], branch)
    return LabelledContacts(
        first=unique[:, 0],
        second=unique[:, 1],
        normal=normal,
        point=mean,
        faces=faces,
        fitted=fitted,
    )


def _sums(values: Array, starts: IntArray) -> Array:
    """Sums of the groups of rows that begin at ``starts``."""
    return np.add.reduceat(values, starts, axis=0) if len(starts) else values[:0]


def _between(grains: LabelledGrains, pair: IntArray) -> Array:
    ends = grains.position[np.searchsorted(grains.number, pair)]
    branch = ends[:, 1] - ends[:, 0]
    return branch / np.maximum(np.linalg.norm(branch, axis=1), 1e-300)[:, None]


def _slabs(image: NDArray, overlap: int) -> Iterator[tuple[int, NDArray]]:
    """Some layers at a time, each with ``overlap`` layers of the next."""
    step = max(int(_SLAB_VOXELS // max(np.prod(image.shape[1:], dtype=np.int64), 1)), 1)
    for start in range(0, len(image), step):
        yield start, np.asarray(image[start : start + step + overlap])


def _shared_faces(image: NDArray) -> tuple[IntArray, Array]:
    """Labels on both sides of every face between two grains, and the centre of the face."""
    pairs = [np.zeros((0, 2), np.int64)]
    places = [np.zeros((0, image.ndim))]
    for start, slab in _slabs(image, 1):
        for axis in range(image.ndim):
            layers = slab if axis == 0 else slab[: len(slab) - (start + len(slab) < len(image))]
            low, high = _sides(layers, axis)
            touch = np.nonzero((low != high) & (low > 0) & (high > 0))
            pairs.append(np.stack([low[touch], high[touch]], axis=1).astype(np.int64))
            place = np.stack(touch, axis=1).astype(float)
            place[:, 0] += start
            place[:, axis] += 0.5
            places.append(place)
    return np.sort(np.concatenate(pairs), axis=1), np.concatenate(places)


def _sides(layers: NDArray, axis: int) -> tuple[NDArray, NDArray]:
    turned = np.moveaxis(layers, axis, 0)
    return np.moveaxis(turned[:-1], 0, axis), np.moveaxis(turned[1:], 0, axis)
