"""The neighbour list of a run: candidate pairs, their impulses, and when to search again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from granufab.kernels.neighbours import find_pairs, find_wall_pairs
from granufab.kernels.step_arrays import Pairs
from granufab.packing import Array, Contacts, IntArray, WallContacts

__all__ = ["Candidates"]

IMAGE_SPAN = 64


class Candidates:
    """Pairs within the skin, with the impulses carried from step to step.

    A private mutable record of the engine. Pairs are keyed by (i, j, image), so impulses survive
    a new search; a wall w is body grain_count + w with image 0.
    """

    def __init__(self, grain_count: int, dimension: int) -> None:
        self.grain_count = grain_count
        self.dimension = dimension
        self.tangents = 1 if dimension == 2 else 3
        self._clear()

    def _clear(self) -> None:
        self._allocate(np.empty((0, 2), np.int32), np.empty((0, self.dimension), np.int32))

    def _allocate(self, pairs: np.ndarray, images: np.ndarray) -> None:
        count = len(pairs)
        self.pairs = np.ascontiguousarray(pairs)
        self.images = np.ascontiguousarray(images)
        self.normal = np.zeros((count, self.dimension))
        self.length = np.zeros(count)
        self.gap = np.zeros(count)
        self.active = np.zeros(count, dtype=np.bool_)
        self.impulse_n = np.zeros(count)
        self.impulse_t = np.zeros((count, self.tangents))
        self.memory_t = np.zeros((count, self.tangents))
        self.friction = np.zeros(count)
        self.home = np.zeros(count, np.int64)

    @property
    def count(self) -> int:
        """Number of candidate pairs."""
        return len(self.pairs)

    def keys(self) -> IntArray:
        """One integer per (i, j, image)."""
        return self._key(self.pairs, self.images)

    def _key(self, pairs: np.ndarray, images: np.ndarray) -> IntArray:
        bodies = np.int64(self.grain_count + 2 * self.dimension)
        key = pairs[:, 0].astype(np.int64) * bodies + pairs[:, 1]
        for k in range(self.dimension):
            key = key * IMAGE_SPAN + (images[:, k] + IMAGE_SPAN // 2) % IMAGE_SPAN
        return key

    def search(
        self,
        position: Array,
        radius: Array,
        cell: tuple[Array, Array, np.ndarray],
        skin: float,
        friction: tuple[float, float],
        run: Callable[..., Any] | None = None,
    ) -> None:
        """Find all pairs within ``skin`` [m], keep known impulses.

        Args:
            position: centres [m].
            radius: [m].
            cell: (matrix, origin, periodic).
            skin: surface distance [m].
            friction: (µ between grains, µ on walls).
            run: team that searches, see :func:`granufab.kernels.neighbours.find_pairs`.
        """
        matrix, origin, periodic = cell
        old_keys, old_n, old_t = self.keys(), self.impulse_n, self.impulse_t
        known = self.count
        self._clear()  # not two lists at once: they are large
        pairs, images = find_pairs(
            position, radius, cell, skin, room=max(2 * self.dimension * len(radius), known),
            run=run,
        )  # fmt: skip
        if not periodic.all():
            room = 2 * self.dimension * len(radius)
            walls, touching = find_wall_pairs(
                position, radius, matrix, origin, periodic, skin, room
            )
            walls = walls[:touching]
            walls[:, 1] += len(radius)
            pairs = np.concatenate([pairs, walls])
            images = np.concatenate([images, np.zeros((touching, self.dimension), np.int32)])
        self._allocate(pairs, images)
        self.friction[:] = friction[0]
        self.friction[self.pairs[:, 1] >= self.grain_count] = friction[1]
        self._recall(old_keys, old_n, old_t)

    def _recall(self, old_keys: IntArray, old_n: Array, old_t: Array) -> None:
        source, known = _match(old_keys, self.keys())
        self.impulse_n[known] = old_n[source]
        self.impulse_t[known] = old_t[source]

    def divide(self, chunk: IntArray, chunk_count: int) -> None:
        """Note in which chunk of grains each pair lies; ``chunk_count`` for those between."""
        first, second = self.pairs[:, 0], self.pairs[:, 1]
        inner = chunk[first] == chunk[np.where(second < self.grain_count, second, first)]
        self.home[:] = np.where(inner, chunk[first], chunk_count)

    def arrays(self) -> Pairs:
        """The candidates, for kernels; valid until the next search."""
        return Pairs(
            self.pairs, self.images, self.normal, self.length, self.gap, self.active,
            self.impulse_n, self.impulse_t, self.memory_t, self.friction, self.home,
        )  # fmt: skip

    def impulses(self) -> Array:
        """P of every candidate in global axes [N s], shape (count, D)."""
        along = self.impulse_n[:, None] * self.normal
        if self.dimension == 3:
            return along + self.impulse_t
        return along + self.impulse_t * np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)

    def virial(self) -> Array:
        """Σ P⊗ℓ over all candidates [N m s], shape (D, D)."""
        return self.impulses().T @ (self.normal * self.length[:, None])

    def shear_images(self, flow: int, axis: int, turns: int) -> None:
        """Rewrite images after lattice vector ``axis`` lost ``turns`` of vector ``flow``."""
        self.images[:, flow] += turns * self.images[:, axis]

    def seed_impulses(
        self,
        contacts: Contacts | None,
        walls: WallContacts | None,
        step: float,
        remap: IntArray,
    ) -> None:
        """Start from the forces of a packing: impulse = force · h.

        ``remap`` T (shape (D, D)) is the change of lattice basis since the packing was made,
        C_now = C T; its images follow as T⁻¹·image.
        """
        force = np.zeros((self.count, self.dimension))
        if contacts is not None and contacts.force is not None:
            image = contacts.image
            if image is not None:
                image = np.rint(image @ np.linalg.inv(remap).T).astype(np.int64)
            self._seed_grains(force, contacts.pair, contacts.force, image)
        if walls is not None:
            pairs = np.stack([walls.grain, walls.wall + self.grain_count], axis=1)
            self._seed(force, pairs, walls.force, np.zeros_like(walls.normal, dtype=np.int64))
        n = self.normal
        along = np.einsum("ck,ck->c", force, n)
        self.impulse_n[:] = np.maximum(along, 0.0) * step
        if self.dimension == 2:
            self.impulse_t[:, 0] = (n[:, 0] * force[:, 1] - n[:, 1] * force[:, 0]) * step
        else:
            self.impulse_t[:] = (force - along[:, None] * n) * step

    def _seed_grains(
        self, force: Array, pair: IntArray, given: Array, image: IntArray | None
    ) -> None:
        """Forces of listed pairs, turned to i < j; without images by the pair alone."""
        turned = pair[:, 0] > pair[:, 1]
        sign = np.where(turned, -1, 1)[:, None]
        pairs = np.where(turned[:, None], pair[:, ::-1], pair)
        images = None if image is None else image * sign
        self._seed(force, pairs, given * sign, images)

    def _seed(self, force: Array, pairs: IntArray, given: Array, images: IntArray | None) -> None:
        here = self.images if images is not None else np.zeros_like(self.images)
        there = images if images is not None else np.zeros((len(pairs), self.dimension), int)
        source, known = _match(self._key(pairs, there), self._key(self.pairs, here))
        force[known] = given[source]


def _match(old: IntArray, new: IntArray) -> tuple[IntArray, IntArray]:
    """Indices (into ``old``, into ``new``) of the keys that both hold."""
    if not len(old) or not len(new):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    order = np.argsort(old, kind="stable")
    place = np.minimum(np.searchsorted(old[order], new), len(order) - 1)
    source = order[place]
    known = np.flatnonzero(old[source] == new)
    return source[known], known
