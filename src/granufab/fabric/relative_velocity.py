"""Relative motion of pairs of grains, and its sums over a section, shells and the far field."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from granufab.errors import InvalidSettings
from granufab.fabric.displacements import deviatoric
from granufab.fabric.neighbours import cell_fractions, neighbours_within, wrap
from granufab.packing import Array, Cell, IntArray, Packing, require

__all__ = [
    "FEWEST_CLUSTERS",
    "SHELL",
    "PairMotion",
    "PairSums",
    "Section",
    "Tally",
    "block_count",
    "cluster_error",
    "pair_motion",
    "reach_limit",
    "spatial_blocks",
]

FEWEST_CLUSTERS = 4
"""A standard error needs pairs in so many clusters."""

_SIDE = {2: 5, 3: 3}

SHELL = 0.1
"""Width of the shells of distance [<ℓ>]."""


def block_count(dimension: int) -> int:
    """Number of spatial blocks."""
    return _SIDE[dimension] ** dimension


def spatial_blocks(fraction: Array) -> IntArray:
    """Block of each grain: 5 × 5 boxes of the cell in 2D, 3 × 3 × 3 in 3D.

    Args:
        fraction: coordinates along the lattice vectors [-], 0..1, shape (grain_count, D).
    """
    dimension = fraction.shape[1]
    side = _SIDE[dimension]
    box = np.clip((fraction * side).astype(np.int64), 0, side - 1)
    return box @ (side ** np.arange(dimension))


def cluster_error(total: Array, count: Array) -> Array:
    r"""Standard error of the ratio Σ total/Σ count, clusters taken as independent.

    :math:`s^2 = \frac{B}{B-1}\sum_b (S_b - n_b m)^2/(\sum_b n_b)^2` with m = ΣS_b/Σn_b, over
    the B clusters that hold something; NaN where these are fewer than 4.

    Args:
        total: S_b, shape (cluster_count, …).
        count: n_b > 0 where something is, same shape.
    """
    whole = count.sum(axis=0)
    held = (count > 0).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        residual = total - count * (total.sum(axis=0) / whole)
        error = np.sqrt(held / (held - 1.0) * (residual**2).sum(axis=0)) / np.abs(whole)
    return np.where(held >= FEWEST_CLUSTERS, error, np.nan)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairMotion:
    """Pairs of one state, each once; lengths in <ℓ>, velocities in ε̇_q <ℓ>.

    Attributes:
        branch: r_j − r_i [-], shape (pair_count, D).
        affine: L·(r_j − r_i) [-], as ``branch``.
        difference: c_j − c_i, the relative velocity less its affine part [-], as ``branch``.
        block: spatial block of grain i, shape (pair_count,).
        rate: L/ε̇_q [-], shape (D, D).
    """

    branch: Array
    affine: Array
    difference: Array
    block: IntArray
    rate: Array


def pair_motion(packing: Packing, length: float, reach: float) -> PairMotion:
    """Relative motion of all pairs closer than √2·``reach``·<ℓ>, the corners of a map.

    Args:
        packing: needs velocities and a cell with a rate.
        length: <ℓ> [m].
        reach: [<ℓ>].
    Raises:
        MissingData: there are no velocities or no cell.
        InvalidSettings: the cell does not shear, or the reach is beyond half of it.
    """
    cell = require(packing.cell, "cell lengths", "give the cell of the packing")
    velocity = require(packing.grains.velocity, "velocities", "use window= to form them")
    rate = np.asarray(cell.rate)
    speed = deviatoric(rate)
    if not speed > 0:
        raise InvalidSettings("the cell does not shear (ε̇_q = 0), so there is nothing to scale by")
    _check_reach(cell, length, reach)
    radius = packing.grains.radius
    found = neighbours_within(packing, 2**0.5 * reach * length - 2.0 * float(radius.min()))
    branch = require(found.branch, "branches") / length
    i, j = found.pair.T
    # A grain's own image moves affinely whatever the flow is: no information.
    keep = (_dot(branch, branch) < 2.0 * reach**2) & (i != j)
    branch, i, j = branch[keep], i[keep], j[keep]
    place = cell_fractions(wrap(packing.grains.position, cell)[0], cell)
    return PairMotion(
        branch=branch,
        affine=branch @ (rate / speed).T,
        difference=(velocity[j] - velocity[i]) / (speed * length),
        block=spatial_blocks(place)[i],
        rate=rate / speed,
    )


def reach_limit(cell: Cell, length: float) -> float:
    """Half of the smallest distance of opposite faces of the cell [<ℓ>]."""
    return 0.5 / float(np.linalg.norm(np.linalg.inv(cell.matrix), axis=1).max()) / length


def _check_reach(cell: Cell, length: float, reach: float) -> None:
    limit = reach_limit(cell, length)
    if reach > limit * (1 + 1e-9):
        raise InvalidSettings(
            f"reach {reach:.4g} <ℓ> is beyond half of the cell, where a grain meets its own "
            f"images; allowed: up to {limit:.4g}"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """The plane onto which relative velocities are mapped.

    Attributes:
        kind: ``plane`` (2D), ``axisymmetric`` (distance from an axis, and along it) or ``slab``.
        basis: unit vectors as rows: the plane's two axes (2D, slab), or the axis alone.
        thickness: of a slab [<ℓ>].
    """

    kind: Literal["plane", "axisymmetric", "slab"]
    basis: Array
    thickness: float = 1.0

    @property
    def inversion(self) -> Array:
        """Sign of each component under the exchange of i and j."""
        return np.array([1.0, -1.0]) if self.kind == "axisymmetric" else np.array([-1.0, -1.0])

    def project(self, motion: PairMotion) -> tuple[Array, Array, Array, IntArray]:
        """Place, affine and non-affine velocity in the section, each (pairs kept, 2), and block."""
        fields = (motion.branch, motion.affine, motion.difference)
        if self.kind == "axisymmetric":
            axis = self.basis[0]
            along = [vector @ axis for vector in fields]
            radial = motion.branch - along[0][:, None] * axis
            distance = np.linalg.norm(radial, axis=1)
            outward = radial / np.maximum(distance, 1e-300)[:, None]
            parts = [
                np.column_stack([_dot(vector, outward), height])
                for vector, height in zip(fields, along, strict=True)
            ]
            return parts[0], parts[1], parts[2], motion.block
        flat = [vector @ self.basis.T for vector in fields]
        if self.kind == "plane":
            return flat[0], flat[1], flat[2], motion.block
        normal = np.cross(self.basis[0], self.basis[1])
        keep = np.abs(motion.branch @ normal) < 0.5 * self.thickness
        return flat[0][keep], flat[1][keep], flat[2][keep], motion.block[keep]


@dataclass(slots=True, eq=False)
class Tally:
    """A sum over states, kept by spatial block and by group of consecutive states.

    Groups are what standard errors take as independent, at most 16 of them: then neighbours are
    merged. With fewer than 8 states the blocks are taken; as these share the strain that the
    cell imposes, errors from blocks are too large, most of all in the far field.

    Attributes:
        by_block: the sum over all states, shape (block_count, …).
        groups: sums over blocks and the states of a group, each of shape (…).
        states: how many states were added.
        group_size: states in a group, but for the last.
    """

    by_block: Array
    groups: list[Array] = field(default_factory=list)
    states: int = 0
    group_size: int = 1

    def add(self, values: Array) -> None:
        """Add the sums of one state, shape (block_count, …)."""
        self.by_block += values
        whole = values.sum(axis=0)
        if self.states % self.group_size == 0 and len(self.groups) == _MOST_GROUPS:
            self.groups = [a + b for a, b in zip(*[iter(self.groups)] * 2, strict=True)]
            self.group_size *= 2
        if self.states % self.group_size == 0:
            self.groups.append(whole)
        else:
            self.groups[-1] = self.groups[-1] + whole
        self.states += 1

    @property
    def by_states(self) -> bool:
        """True where there are states enough to take errors from."""
        return self.states >= _FEWEST_STATES

    @property
    def clusters(self) -> Array:
        """The sums that are taken as independent, shape (cluster_count, …)."""
        return np.array(self.groups) if self.by_states else self.by_block


_MOST_GROUPS = 16
_FEWEST_STATES = 8


@dataclass(slots=True, kw_only=True, eq=False)
class PairSums:
    """Running sums over states; add states with :meth:`add`.

    Attributes:
        section: the map's plane.
        reach: half side of the map [<ℓ>].
        cells: boxes of the map along its second axis.
        far: the far field begins here [<ℓ>].
        dimension: 2 or 3.
        rate: sum of L/ε̇_q.
        maps: sums over the map's boxes of 1, place, affine and difference,
            shape (…, 7, row, column).
        shells: sums over the shells of 1, w_n a_n, a_n², w_t·a_t, a_t², where w is the relative
            velocity, a its affine part, n and t its parts along and across the branch,
            shape (…, 5, shell).
        far_moment: Σ b⊗b and Σ (w − a)⊗b over the far field, shape (…, 2, D, D).
    """

    section: Section
    reach: float
    cells: int
    far: float
    dimension: int
    rate: Array = field(init=False)
    maps: Tally = field(init=False)
    shells: Tally = field(init=False)
    far_moment: Tally = field(init=False)

    def __post_init__(self) -> None:
        columns = self.cells // 2 if self.section.kind == "axisymmetric" else self.cells
        blocks, shells = block_count(self.dimension), int(np.ceil(self.reach / SHELL - 1e-9))
        self.rate = np.zeros((self.dimension, self.dimension))
        self.maps = Tally(np.zeros((blocks, 7, self.cells, columns)))
        self.shells = Tally(np.zeros((blocks, 5, shells)))
        self.far_moment = Tally(np.zeros((blocks, 2, self.dimension, self.dimension)))

    def add(self, motion: PairMotion) -> None:
        """Add the pairs of one state."""
        self.rate += motion.rate
        self._add_map(motion)
        self._add_distances(motion)

    def _add_map(self, motion: PairMotion) -> None:
        place, affine, difference, block = self.section.project(motion)
        rows, columns = self.maps.by_block.shape[2:]
        scale = self.cells / (2.0 * self.reach)
        low = 0.0 if self.section.kind == "axisymmetric" else self.reach
        column = np.floor((place[:, 0] + low) * scale).astype(np.int64)
        row = np.floor((place[:, 1] + self.reach) * scale).astype(np.int64)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        index = (row * columns + column)[inside]
        weights = [None, *place[inside].T, *affine[inside].T, *difference[inside].T]
        self.maps.add(_sums(index, block[inside], weights, self.maps.by_block.shape))

    def _add_distances(self, motion: PairMotion) -> None:
        distance = np.sqrt(_dot(motion.branch, motion.branch))
        near = distance < self.reach
        distance, branch, affine = distance[near], motion.branch[near], motion.affine[near]
        velocity, block = affine + motion.difference[near], motion.block[near]
        along = _dot(affine, branch) / distance
        met = _dot(velocity, branch) / distance
        square = _dot(affine, affine) - along**2
        across = _dot(velocity, affine) - met * along
        shape = self.shells.by_block.shape
        shell = np.minimum((distance / SHELL).astype(np.int64), shape[2] - 1)
        weights = [None, met * along, along**2, across, square]
        self.shells.add(_sums(shell, block, weights, shape))
        far = distance > self.far
        branch, rest = branch[far], motion.difference[near][far]
        weights = [left * right for a in (branch, rest) for left in a.T for right in branch.T]
        one = np.zeros(len(branch), dtype=np.int64)
        moments = _sums(one, block[far], weights, (shape[0], len(weights), 1))
        self.far_moment.add(moments.reshape(self.far_moment.by_block.shape))

    def folded_maps(self) -> Array:
        """The maps' clusters with each pair counted both ways round, i to j and j to i."""
        maps = self.maps.clusters
        other = maps[:, :, ::-1]
        if self.section.kind != "axisymmetric":
            other = other[..., ::-1]
        sign = np.concatenate([[1.0], *[self.section.inversion] * 3])
        return maps + sign[:, None, None] * other


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=1)


def _sums(
    index: IntArray, block: IntArray, weights: list[Array | None], shape: tuple[int, ...]
) -> Array:
    """Sums of each weight (None: 1) by block and index; ``shape`` is (block, weight, index…)."""
    boxes = int(np.prod(shape[2:]))
    key = block * boxes + index
    columns = [np.bincount(key, w, shape[0] * boxes).reshape(shape[0], boxes) for w in weights]
    return np.stack(columns, axis=1).astype(np.float64).reshape(shape)
