"""The exact rest of a frictionless packing: linear programs instead of sweeps.

Without friction the last stretch to rest is a search for the one network whose forces balance
and push everywhere: as many contacts as equations. The solver's noise hides it in large samples,
linear programs find it: each is solved on the present geometry, its multipliers are the forces,
its optimum the next geometry. It ends where the contact law holds at the present positions; then
the gaps of the network are closed by Newton steps, where that leaves every force a push.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from granufab.packing import Array, IntArray
from granufab.simulate.program import NonOverlap, Stiffness, least_volume
from granufab.simulate.stepping import Simulation

__all__ = ["Jammed", "jam"]

LARGEST = {2: 50_000, 3: 8_000}
"""Grains beyond which a program takes too long, by dimension."""

REACH, TRUST = 0.05, 0.01
FIRST_OPENING, LAST_OPENING = 1e-4, 1e-9
PROGRAMS, MORE = 60, 4
CLOSINGS, REFINEMENTS = 4, 3
CLOSED = 1e-11


@dataclass(frozen=True, slots=True, kw_only=True)
class Jammed:
    """How the rest was found.

    Attributes:
        programs: linear programs solved.
        factors: Cholesky factors that they took.
        residual: of the contact law at the final positions [-].
        closed: whether the gaps of the force-bearing contacts are zero to round-off.
    """

    programs: int
    factors: int
    residual: float
    closed: bool


def jam(
    simulation: Simulation,
    *,
    tolerance: float,
    tell: Callable[[float], None] = lambda fraction: None,
) -> Jammed | None:
    """Bring a frictionless packing close to rest to its exact rest.

    The grains stop, the cell stops, and the candidates hold the balanced impulses.

    Args:
        simulation: rigid, without friction, under isotropic stress with a free dilation or all
            diagonals of the cell free, overlaps at most some 10⁻³ d.
        tolerance: residual of the contact law to reach [-].
        tell: called with the fraction done.
    Returns:
        How it went; None where the sample is too large or the programs did not come to an end.
    """
    if simulation.grain_count > LARGEST[simulation.dimension]:
        return None
    search = _Search(simulation, tolerance)
    for number in range(1, PROGRAMS + 1):
        if not search.advance():
            break
        tell(1 - 0.9**number)
        if search.closed or search.since >= MORE:
            break
    return search.finish()


class _Search:
    """Sequence of programs; keeps the best rest seen."""

    def __init__(self, simulation: Simulation, tolerance: float) -> None:
        self.simulation, self.tolerance = simulation, tolerance
        self.programs = self.factors = self.since = 0
        self.closed, self.best, self.opening = False, float("inf"), FIRST_OPENING
        self._kept: tuple[_Shape, IntArray, Array] | None = None

    def advance(self) -> bool:
        """One program: test its forces at the present positions, then move to its optimum."""
        simulation, cost = self.simulation, _cost(self.simulation)
        simulation.search()
        simulation.measure_gaps()
        near = np.flatnonzero(simulation.candidates.gap < REACH * simulation.scales.diameter)
        if not len(near):
            return False
        optimum = least_volume(
            _constraints(simulation, near), cost, trust=TRUST, opening=self.opening
        )
        if optimum is None:
            return False
        self.programs += 1
        self.factors += optimum.factors
        self.since += self._kept is not None
        network, force = near[optimum.bearing], optimum.force[optimum.bearing]
        if not len(network):
            return False
        force = _balanced(_constraints(simulation, network), cost, force)
        shape = _Shape(simulation)
        residual = _hold(simulation, network, force)
        if residual <= self.tolerance:
            if residual < self.best:
                self.best, self._kept = residual, (shape, network, force)
            self.closed = self._close(network, force)
        if not self.closed:
            shape.restore(simulation)
            _displace(simulation, optimum.move, optimum.strain)
            self._expect(network, optimum.move)
        return True

    def _expect(self, network: IntArray, move: Array) -> None:
        """Open the next program by what this one's moves promise."""
        held = np.unique(self.simulation.candidates.pairs[network])
        held = held[held < self.simulation.grain_count]
        large = float(np.quantile(np.abs(move[held]).max(axis=1), 0.998))
        self.opening = min(max(0.3 * large**1.5, LAST_OPENING), FIRST_OPENING)

    def _close(self, network: IntArray, force: Array) -> bool:
        """Newton steps to zero gaps of the network; whether every force remains a push."""
        simulation = self.simulation
        for _ in range(CLOSINGS):
            pairs = _constraints(simulation, network)
            move, strain = _unit_springs(pairs).solve(*pairs.load(-pairs.gap))
            _displace(simulation, move.reshape(-1, pairs.dimension), strain)
            simulation.measure_gaps()
        pairs = _constraints(simulation, network)
        force = _balanced(pairs, _cost(simulation), force)
        overlap = -float(simulation.candidates.gap.min()) / simulation.scales.diameter
        if force.min() <= 0 or max(float(np.abs(pairs.gap).max()), overlap) > CLOSED:
            return False
        self.best = _hold(simulation, network, force)
        return self.best <= self.tolerance

    def finish(self) -> Jammed | None:
        """Return to the best rest where the last one is not it."""
        if not self.closed:
            if self._kept is None:
                return None
            shape, network, force = self._kept
            shape.restore(self.simulation)
            self.simulation.search()
            self.simulation.measure_gaps()
            _hold(self.simulation, network, force)
        return Jammed(
            programs=self.programs, factors=self.factors, residual=self.best, closed=self.closed
        )


class _Shape:
    """Positions and cell, to come back to."""

    def __init__(self, simulation: Simulation) -> None:
        self.position = simulation.position.copy()
        self.matrix, self.origin = simulation.matrix.copy(), simulation.origin.copy()

    def restore(self, simulation: Simulation) -> None:
        """Put them back."""
        simulation.position[:] = self.position
        simulation.matrix, simulation.origin = self.matrix.copy(), self.origin.copy()


def _modes(simulation: Simulation) -> Array:
    """Free strains of the cell, shape (mode_count, D, D)."""
    identity = np.eye(simulation.dimension)
    if simulation.loading.dilation:
        return identity[None]
    return np.stack([np.outer(axis, axis) for axis in identity])


def _cost(simulation: Simulation) -> Array:
    """Work of the external stress per free strain [p d^D]."""
    stress = simulation.loading.stress / simulation.scales.pressure
    volume = simulation.volume / simulation.scales.diameter**simulation.dimension
    return volume * np.einsum("ij,aij->a", stress, _modes(simulation))


def _constraints(simulation: Simulation, chosen: IntArray) -> NonOverlap:
    """Non-overlap of the chosen candidates, linear about the present positions."""
    candidates, diameter = simulation.candidates, simulation.scales.diameter
    place = (simulation.position - simulation.origin) @ np.linalg.inv(simulation.matrix).T
    return NonOverlap(
        pairs=candidates.pairs[chosen].astype(np.int64),
        grain_count=simulation.grain_count,
        normal=candidates.normal[chosen],
        length=candidates.length[chosen] / diameter,
        gap=candidates.gap[chosen] / diameter,
        modes=_modes(simulation),
        place=place - np.floor(place),
    )


def _unit_springs(pairs: NonOverlap) -> Stiffness:
    """Equal springs on every pair; grains without any stay in place."""
    loose = np.ones(pairs.grain_count)
    loose[pairs.pairs[pairs.pairs < pairs.grain_count]] = 0.0
    return Stiffness(pairs, np.ones(pairs.count), np.repeat(loose, pairs.dimension))


def _balanced(pairs: NonOverlap, cost: Array, force: Array) -> Array:
    """The nearest forces that balance on every grain and carry the stress, to round-off."""
    springs = _unit_springs(pairs)
    for _ in range(REFINEMENTS):
        on_grains, on_strain = pairs.load(force)
        force = force + pairs.change(*springs.solve(-on_grains, cost - on_strain))
    return force


def _displace(simulation: Simulation, move: Array, strain: Array) -> None:
    """Strain cell and grains alike, then move the grains; ``move`` in mean diameters."""
    affine = np.tensordot(strain, _modes(simulation), 1)
    simulation.position[:] += simulation.position @ affine.T + move * simulation.scales.diameter
    simulation.matrix = simulation.matrix + affine @ simulation.matrix
    simulation.origin = simulation.origin + affine @ simulation.origin


def _hold(simulation: Simulation, network: IntArray, force: Array) -> float:
    """Residual of one step that starts at rest with these forces and does not sweep."""
    candidates = simulation.candidates
    candidates.impulse_n[:], candidates.impulse_t[:] = 0.0, 0.0
    candidates.impulse_n[network] = force * simulation.scales.force * simulation.step_size
    simulation.stop()
    solver = simulation.solver
    simulation.solver = solver.model_copy(update={"max_sweeps": 0, "strict": False})
    report = simulation.step()
    simulation.solver = solver
    return report.residual
