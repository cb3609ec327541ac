"""The linear program of jamming: the least volume that small displacements of grains allow.

    minimise Σ_a c_a e_a  so that  g + n·(u_j − u_i) + ℓ n·E n ≥ 0 for every near pair, |u| ≤ δ

with c_a e_a the work of the external stress on the free strain E = Σ_a e_a M_a of the cell
[Torquato & Jiao 2010]. The multipliers of the constraints are the contact forces: at the optimum
they balance on every grain and carry the external stress. It is solved by a primal-dual interior
point method [Mehrotra 1992]; each step needs one Cholesky factor of a stiffness matrix, whose
springs are force over gap. Lengths are in mean diameters d, forces in p d^(D−1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array

from granufab.packing import Array, IntArray
from granufab.simulate.elimination import Cholesky, Dissection

__all__ = ["NonOverlap", "Optimum", "least_volume"]

COMPLEMENTARITY, FINEST = 1e-5, 1e-13
IMBALANCE, ROUND_OFF = 1e-8, 1e-5
ITERATIONS = 80
BOUNDARY = 0.95
CENTRING, CENTRED = 0.1, 1e-9
SHIFT = 1e-14


class NonOverlap:
    """Gaps of near pairs, linear in the displacements u of the grains and in the strain e.

    True gaps are never smaller than the linear ones (a branch is at least as long as its
    component along n), so whatever satisfies these constraints has no overlaps.

    Args:
        pairs: grains i, j of each pair; j ≥ grain_count is a wall, which moves with the cell.
        grain_count: number of grains.
        normal: from i to j [-], shape (pair_count, D).
        length: |branch| [d].
        gap: [d].
        modes: M_a, free strains of the cell, shape (mode_count, D, D).
        place: positions in units of the lattice vectors, shape (grain_count, D).
    """

    def __init__(
        self,
        pairs: IntArray,
        grain_count: int,
        normal: Array,
        length: Array,
        gap: Array,
        modes: Array,
        place: Array,
    ) -> None:
        self.pairs, self.grain_count = pairs, grain_count
        self.count, self.dimension = normal.shape
        self.gap, self._place = gap, place
        self.on_strain = length[:, None] * np.einsum("ci,aij,cj->ca", normal, modes, normal)
        first, second = pairs[:, 0], np.minimum(pairs[:, 1], grain_count)
        unknown = self.dimension * np.stack([first, second], axis=1)[:, :, None]
        columns = unknown + np.arange(self.dimension)
        entries = np.stack([-normal, normal], axis=1)
        starts = 2 * self.dimension * np.arange(self.count + 1)
        room = (self.count, self.dimension * (grain_count + 1))
        rows = csr_array((entries.ravel(), columns.ravel(), starts), shape=room)
        self.on_grains = csr_array(rows[:, : self.dimension * grain_count])
        self.transposed = csr_array(self.on_grains.T)

    @cached_property
    def dissection(self) -> Dissection:
        """Elimination order of the grains that the pairs couple."""
        return Dissection(self._place, self.pairs[self.pairs[:, 1] < self.grain_count])

    def change(self, move: Array, strain: Array) -> Array:
        """Change of every gap [d]."""
        return self.on_grains @ move + self.on_strain @ strain

    def load(self, force: Array) -> tuple[Array, Array]:
        """What forces on the pairs exert on the grains and on the strain."""
        return np.asarray(self.transposed @ force), self.on_strain.T @ force


class Stiffness:
    """Solves AᵀWA + S for grains and strain together: W springs of the pairs, S of the grains.

    A tiny share of the diagonal is added where round-off would spoil the factor.
    """

    def __init__(self, pairs: NonOverlap, spring: Array, support: Array) -> None:
        matrix = csc_array(pairs.transposed @ diags_array(spring) @ pairs.on_grains)
        matrix = matrix + diags_array(support)
        weighted = spring[:, None] * pairs.on_strain
        self._cross = pairs.transposed @ weighted
        self._factor = _factorise(pairs, csc_array(matrix))
        self._reduced = self._factor.solve(self._cross)
        self._corner = pairs.on_strain.T @ weighted - self._cross.T @ self._reduced

    def solve(self, on_grains: Array, on_strain: Array) -> tuple[Array, Array]:
        """Displacements and strain under these loads."""
        move = self._factor.solve(on_grains)
        strain = np.linalg.solve(self._corner, on_strain - self._cross.T @ move)
        return move - self._reduced @ strain, strain


def _factorise(pairs: NonOverlap, matrix: csc_array) -> Cholesky:
    diagonal, shift = matrix.diagonal(), SHIFT
    while True:
        try:
            shifted = csc_array(matrix + diags_array(shift * diagonal))
            return Cholesky(pairs.dissection, shifted, pairs.dimension)
        except np.linalg.LinAlgError:
            if shift > 1e-6:
                raise
            shift *= 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Solution of the linear program.

    Attributes:
        move: u of every grain [d], shape (grain_count, D).
        strain: e of every free mode of the cell [-].
        force: of every pair [p d^(D−1)].
        gap: linear gap of every pair after the move [d].
        factors: Cholesky factors that it took.
    """

    move: Array
    strain: Array
    force: Array
    gap: Array
    factors: int

    @property
    def bearing(self) -> np.ndarray:
        """Pairs whose force is not zero: complementary, so larger than their gap."""
        return self.force > self.gap


def least_volume(pairs: NonOverlap, cost: Array, *, trust: float, opening: float) -> Optimum | None:
    """Solve the linear program.

    The products force·gap at its end are 10⁻⁵ of ``opening``: the geometry leaves no sense in a
    sharper optimum while the grains still move.

    Args:
        pairs: constraints.
        cost: c_a, work per strain [p d^D]: V/d^D times the trace of M_a under isotropic stress.
        trust: δ, bound on every component of u [d].
        opening: strain by which the packing is expanded for a start; of the order of the gaps
            that the displacements will open or close.
    Returns:
        The optimum; None where the iteration broke down.
    """
    state = _InteriorPoint(pairs, cost, trust, opening)
    for factors in range(ITERATIONS):
        if state.done():
            return state.optimum(factors)
        try:
            state.step()
        except np.linalg.LinAlgError:
            return None
    return None


class _InteriorPoint:
    """Iterate of the program; slacks and multipliers hold pairs, then u ≤ δ, then u ≥ −δ.

    It starts from the packing, expanded until all gaps are open, with forces ~ 1/gap.
    """

    def __init__(self, pairs: NonOverlap, cost: Array, trust: float, opening: float) -> None:
        self.pairs, self.cost = pairs, cost
        self.sharpness = max(COMPLEMENTARITY * opening, FINEST)
        unknowns = pairs.dimension * pairs.grain_count
        self.move, self.strain = np.zeros(unknowns), np.zeros(len(cost))
        length = pairs.on_strain.sum(axis=1)
        self.strain += max(0.0, float((-pairs.gap / length).max())) + opening
        opened = pairs.gap + pairs.change(self.move, self.strain)
        self.slack = np.concatenate([opened, np.full(2 * unknowns, trust)])
        self.force = float(cost.sum() / (length / opened).sum()) / self.slack
        self.scale = float(self.force[: pairs.count].mean())
        self._balance()

    def _balance(self) -> None:
        """Loads that the forces leave unbalanced, and the mean of force times slack."""
        on_grains, on_strain = self._load(self.force)
        self.on_grains, self.on_strain = on_grains, on_strain - self.cost
        self.centre = float(self.force @ self.slack) / len(self.slack)

    def _load(self, force: Array) -> tuple[Array, Array]:
        count, unknowns = self.pairs.count, len(self.move)
        on_grains, on_strain = self.pairs.load(force[:count])
        return on_grains + force[count + unknowns :] - force[count : count + unknowns], on_strain

    def done(self) -> bool:
        """Complementary and balanced, or as balanced as round-off lets it be."""
        left = max(float(np.abs(self.on_grains).max()), float(np.abs(self.on_strain).max()))
        sharp = self.centre / (self.sharpness * self.scale)
        allowed = IMBALANCE if sharp > ROUND_OFF else ROUND_OFF
        return sharp < 1 and left < allowed * self.scale

    def step(self) -> None:
        """Predictor to zero complementarity, corrector to a share of the present one."""
        count, unknowns = self.pairs.count, len(self.move)
        spring = self.force / self.slack
        support = spring[count : count + unknowns] + spring[count + unknowns :]
        stiffness = Stiffness(self.pairs, spring[:count], support)
        _, slack, force = self._direction(stiffness, spring, np.zeros(len(spring)))
        near, far = _longest(self.slack, slack, 1.0), _longest(self.force, force, 1.0)
        reached = float((self.force + far * force) @ (self.slack + near * slack)) / len(spring)
        least = CENTRING if self.centre > CENTRED * self.scale else 0.0
        share = max((reached / self.centre) ** 3, least)
        shortest = min(near, far)
        correction = slack * force * (shortest if shortest < 0.1 else 1.0)
        target = share * self.centre - correction
        (move, strain), slack, force = self._direction(stiffness, spring, target)
        near = _longest(self.slack, slack, BOUNDARY)
        self.move += near * move
        self.strain += near * strain
        self.slack += near * slack
        self.force += _longest(self.force, force, BOUNDARY) * force
        self._balance()

    def _direction(
        self, stiffness: Stiffness, spring: Array, target: Array
    ) -> tuple[tuple[Array, Array], Array, Array]:
        """Newton step towards balance and force·slack = ``target``: (u, e), slack, force."""
        wanted = target / self.slack
        on_grains, on_strain = self._load(wanted - self.force)
        move, strain = stiffness.solve(self.on_grains + on_grains, self.on_strain + on_strain)
        slack = np.concatenate([self.pairs.change(move, strain), -move, move])
        return (move, strain), slack, wanted - self.force - spring * slack

    def optimum(self, factors: int) -> Optimum:
        """The present iterate as a solution."""
        count = self.pairs.count
        return Optimum(
            move=self.move.reshape(-1, self.pairs.dimension),
            strain=self.strain,
            force=self.force[:count],
            gap=self.slack[:count],
            factors=factors,
        )


def _longest(value: Array, change: Array, share: float) -> float:
    """Step ≤ 1 that keeps every value above (1 − share) of itself."""
    falling = change < 0
    if not falling.any():
        return 1.0
    return min(1.0, share * float((-value[falling] / change[falling]).min()))
