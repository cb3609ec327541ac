"""Bins of contact direction, the edges between them, and the crossing of these edges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from granufab.errors import InvalidSettings
from granufab.packing import Array, IntArray

__all__ = ["DirectionBins"]


@dataclass(frozen=True, slots=True, eq=False)
class DirectionBins:
    """Equal angles of θ ∈ [0, π) in 2D, equal solid angles over the half space in 3D.

    In 2D θ is counted counter-clockwise from ``direction`` and edge 0 is also the last edge. In 3D
    θ ∈ [0, π/2] is the polar angle |n·d| = cos θ, summed over azimuth: the coordinate is
    u = 1 − cos θ, and nothing crosses the first edge (the pole) nor the last (the equator, where
    a normal that goes through is reflected, as n and −n are one direction).

    Attributes:
        direction: unit vector d from which θ is counted, shape (D,).
        count: number of bins.
    """

    direction: Array
    count: int

    def __post_init__(self) -> None:
        if self.count < 2:
            raise InvalidSettings(f"bins must be at least 2, got {self.count}")
        direction = np.asarray(self.direction, dtype=np.float64)
        length = float(np.linalg.norm(direction))
        if direction.shape not in ((2,), (3,)) or not 0.0 < length < math.inf:
            raise InvalidSettings(
                f"direction must be a non-zero vector of 2 or 3 numbers, got {direction.tolist()}"
            )
        object.__setattr__(self, "direction", direction / length)

    @classmethod
    def of(cls, direction: Array, count: int, dimension: int) -> DirectionBins:
        """Bins for states of a dimension.

        Raises:
            InvalidSettings: fewer than 2 bins, or a direction that does not fit.
        """
        bins = cls(direction, count)
        if bins.dimension != dimension:
            raise InvalidSettings(
                f"direction has {bins.dimension} components, the states are {dimension}D"
            )
        return bins

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.direction)

    @property
    def width(self) -> float:
        """Width of a bin in its coordinate: θ [rad] in 2D, u = 1 − cos θ [-] in 3D."""
        return (math.pi if self.dimension == 2 else 1.0) / self.count

    @property
    def measure(self) -> float:
        """Size of a bin [rad in 2D, sr in 3D]; all together the half space of directions."""
        return (math.pi if self.dimension == 2 else 2.0 * math.pi) / self.count

    @property
    def edges(self) -> Array:
        """θ of the edges [rad], shape (count + 1,)."""
        return self._angle(np.linspace(0.0, self.count * self.width, self.count + 1))

    @property
    def centres(self) -> Array:
        """θ of the middles of the bins [rad], shape (count,)."""
        return self._angle(np.linspace(0.5, self.count - 0.5, self.count) * self.width)

    def _angle(self, coordinate: Array) -> Array:
        if self.dimension == 2:
            return coordinate
        return np.arccos(np.clip(1.0 - coordinate, 0.0, 1.0))

    def coordinate(self, normal: Array) -> Array:
        """θ in 2D, u = 1 − |n·d| in 3D, the same for n and −n, shape (contact_count,)."""
        along = normal @ self.direction
        if self.dimension == 3:
            return 1.0 - np.minimum(np.abs(along), 1.0)
        across = normal[:, 1] * self.direction[0] - normal[:, 0] * self.direction[1]
        back = (across < 0) | ((across == 0) & (along < 0))
        sign = np.where(back, -1.0, 1.0)
        return np.arctan2(across * sign + 0.0, along * sign)

    def index(self, normal: Array) -> IntArray:
        """Bin of each normal, shape (contact_count,)."""
        return self._bin(self.coordinate(normal))

    def _bin(self, coordinate: Array) -> IntArray:
        return np.minimum((coordinate / self.width).astype(np.int64), self.count - 1)

    def histogram(self, normal: Array) -> IntArray:
        """Number of normals in each bin, shape (count,)."""
        return np.bincount(self.index(normal), minlength=self.count).astype(np.int64)

    def crossings(self, before: Array, after: Array) -> tuple[IntArray, IntArray]:
        """How many normals cross each edge towards growing θ, and how many back.

        A normal crosses every edge between its two bins; in 2D it goes the shorter way round.

        Args:
            before: normals [-], shape (contact_count, D).
            after: the same contacts later.
        Returns:
            Two arrays of shape (count + 1,).
        """
        first, second = self.coordinate(before), self.coordinate(after)
        start, end = self._bin(first), self._bin(second)
        if self.dimension == 2:
            end = end - self.count * np.rint((second - first) / math.pi).astype(np.int64)
        return self._passed(start, end), self._passed(end, start)

    def _passed(self, start: IntArray, end: IntArray) -> IntArray:
        """Edges start + 1 to end, of the contacts that have start < end."""
        up = end > start
        line = np.zeros(3 * self.count + 1, dtype=np.int64)
        np.add.at(line, start[up] + 1 + self.count, 1)
        np.add.at(line, end[up] + 1 + self.count, -1)
        total = np.cumsum(line)[:-1].reshape(3, self.count).sum(axis=0)
        return np.append(total, total[0])

    def at_edge(self, normal: Array, edge: IntArray) -> Array:
        """Normals turned about the direction's own azimuth until they lie on an edge.

        Args:
            normal: [-], shape (contact_count, D).
            edge: number of the edge of each, shape (contact_count,).
        """
        angle = self.edges[edge][:, None]
        d = self.direction
        if self.dimension == 2:
            return np.cos(angle) * d + np.sin(angle) * np.array([-d[1], d[0]])
        along = normal @ d
        side = normal * np.where(along < 0, -1.0, 1.0)[:, None] - np.abs(along)[:, None] * d
        length = np.linalg.norm(side, axis=1, keepdims=True)
        return np.cos(angle) * d + np.sin(angle) * side / np.maximum(length, 1e-300)

    def speed(self, normal: Array, turning: Array) -> Array:
        """Change of the coordinate (θ in 2D, u in 3D) of normals that turn by ``turning``."""
        d = self.direction
        if self.dimension == 2:
            return normal[:, 0] * turning[:, 1] - normal[:, 1] * turning[:, 0]
        return -np.where(normal @ d < 0, -1.0, 1.0) * (turning @ d)
