"""A state from elsewhere made ready for Contact Dynamics: overlaps of soft grains relaxed.

Grains of a soft-particle code overlap under load. Rigid ones in the same places would be torn
apart, so they start about as stiff as they were, k₀/p = Σf_n/Σ(overlap)/p (without forces
d/mean overlap), and are stiffened step by step to k/p = 1.6·10⁵. The cell keeps its shape and
dilates under the mean stress: an anisotropic state keeps most of its anisotropy. Motion is damped.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from granufab.errors import BrokenState, InvalidPacking, NotConverged
from granufab.fabric.stress import solid_fraction, stress_tensor
from granufab.fabric.tensors import mean_part
from granufab.packing import Packing, require
from granufab.simulate.capture import capture_packing, measure_now
from granufab.simulate.loading import Isotropic
from granufab.simulate.settings import Material, Solver
from granufab.simulate.settling import STIFFNESS, march
from granufab.simulate.step_law import OVERLAP_LIMIT
from granufab.simulate.stepping import Simulation

__all__ = ["HARD", "Relaxed", "overlaps", "pressure_of", "relax"]

Progress = Callable[[str, float], None]
HARD = 1e-4
"""Overlap in mean diameters below which grains count as hard: that of the default stiffness."""
SOFTEST, STIFFER = 10.0, 4.0
DAMPING, RATE_CAP = 0.5, 0.05
STAGE_STEPS, GATHER_STEPS = 600, 6000
GATHERED_ENERGY, ALLOWED_ENERGY, STAGE_ENERGY, LAST_ENERGY = 1e-4, 1e-5, 1e-7, 1e-8
MISSED_PRESSURE = 1e-2
EMPTIEST = 0.01
"""Least solid fraction to start from: emptier cells are wrong, and searching them takes memory."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Relaxed:
    """A state that Contact Dynamics can start from.

    Attributes:
        packing: the relaxed state with its forces, at rest.
        pressure: p under which it rests [N/m^(D−1)].
        overlap: largest overlap before and after [mean diameters].
        stiffness: k/p of every stage (3D: k/(p d)).
        before, after: z, z_backbone, z_mechanical, rattler_fraction, a, phi; before, of the
            listed forces, or of the overlapping pairs where none are listed.
        steps: made.
        kinetic_ratio: kinetic energy / (p V) at the end [-].
        seconds: that it took.
    """

    packing: Packing
    pressure: float
    overlap: tuple[float, float]
    stiffness: tuple[float, ...]
    before: dict[str, float]
    after: dict[str, float]
    steps: int
    kinetic_ratio: float
    seconds: float

    @property
    def text(self) -> str:
        """What was done, in one line."""
        old, new = self.before, self.after
        changes = ", ".join(
            f"{label} {old[name]:.3f} to {new[name]:.3f}"
            for name, label in (("z_backbone", "z_backbone"), ("a", "a"), ("phi", "φ"))
        )
        return (
            f"overlaps relaxed in {self.steps} steps at fixed shape of the cell: up to "
            f"{self.overlap[0]:.1e} d before, {self.overlap[1]:.1e} d now; {changes}"
        )


def overlaps(packing: Packing) -> float:
    """Largest overlap among the listed pairs [mean diameters]; NaN where no gaps are listed."""
    contacts = packing.contacts
    if contacts is None or contacts.gap is None:
        return float("nan")
    deepest = float(-contacts.gap.min(initial=0.0))
    return max(deepest, 0.0) / float(2 * packing.grains.radius.mean())


def pressure_of(packing: Packing) -> float | None:
    """Mean contact stress [N/m^(D−1)] where forces and cell are known and it compresses."""
    contacts = packing.contacts
    if contacts is None or contacts.force is None or packing.cell is None:
        return None
    pressure = float(mean_part(stress_tensor(packing)))
    return pressure if pressure > 0 else None


def relax(
    packing: Packing,
    *,
    friction: float = 0.4,
    wall_friction: float = 0.0,
    pressure: float | None = None,
    progress: Progress | None = None,
) -> Relaxed:
    """Relax the overlaps of a packing and bring it to rest, with the shape of its cell fixed.

    Velocities are dropped; forces, where they are listed, are what the first solve starts from.

    Args:
        packing: grains with masses in a cell.
        friction: µ between grains.
        wall_friction: µ on walls.
        pressure: p of the rest [N/m^(D−1)]; default the mean contact stress, else 1.
        progress: called with a text and the fraction done.
    Raises:
        MissingData: there is no cell, or grains have no masses.
        InvalidPacking: overlaps are beyond half a diameter: these are no contacts; or the cell is
            all but empty.
        NotConverged: the grains do not come to rest under p.
    """
    began = time.perf_counter()
    require(packing.cell, "cell lengths", "give the cell of the state to start from (--cell)")
    filled = solid_fraction(packing)
    if filled < EMPTIEST:
        raise InvalidPacking(
            f"the grains of the state to start from fill {filled:.2g} of their cell, at least "
            f"{EMPTIEST} is needed: give the cell in the units of the positions (--cell)"
        )
    pressure = pressure or pressure_of(packing) or 1.0
    simulation = _simulation(packing, friction, wall_friction, pressure)
    start = simulation.candidates
    deepest = float(np.maximum(-start.gap, 0.0).max(initial=0.0)) / simulation.scales.diameter
    if deepest > OVERLAP_LIMIT:
        i, j = start.pairs[int(np.argmin(start.gap))]
        raise InvalidPacking(
            f"grains {i} and {j} of the state to start from overlap by {deepest:.2g} mean "
            f"diameters, allowed {OVERLAP_LIMIT}"
        )
    before = _values(simulation)
    try:
        steps, stages = _stiffen(simulation, before, progress or (lambda text, fraction: None))
    except BrokenState as error:
        raise NotConverged(f"{_restless(simulation, before)} ({error})") from None
    report = simulation.last_report
    return Relaxed(
        packing=capture_packing(simulation, source=f"relaxed from {packing.source}".strip()),
        pressure=pressure,
        overlap=(deepest, float(report.overlap)),
        stiffness=tuple(stages),
        before=before,
        after=_values(simulation),
        steps=steps,
        kinetic_ratio=simulation.kinetic_ratio(),
        seconds=time.perf_counter() - began,
    )


def _stiffen(
    simulation: Simulation, before: dict[str, float], tell: Progress
) -> tuple[int, list[float]]:
    """To rest at every stiffness in turn; returns the steps made and the stiffnesses."""
    steps = _gather(simulation, tell) if _loose(simulation) else 0
    stages = _stages(_softness(simulation))
    for index, stiffness in enumerate(stages):
        last = index == len(stages) - 1
        energy = LAST_ENERGY if last else STAGE_ENERGY
        simulation.solver = _solver(stiffness, sharp=last)
        simulation.set_loading(simulation.loading)
        steps += march(
            simulation,
            STAGE_STEPS,
            10,
            lambda s, energy=energy: s.kinetic_ratio() < energy and _carries(s),
            lambda f, index=index: tell("relaxing overlaps", (index + f) / len(stages)),
        )
        if simulation.kinetic_ratio() > ALLOWED_ENERGY or not _carries(simulation):
            raise NotConverged(_restless(simulation, before))
    return steps, stages


def _simulation(
    packing: Packing, friction: float, wall_friction: float, pressure: float
) -> Simulation:
    """The resting grains in their cell, free to dilate."""
    still = replace(packing.grains, velocity=None, spin=None)
    cell = replace(require(packing.cell, "the cell"), rate=None)
    simulation = Simulation(
        replace(packing, grains=still, cell=cell),
        Isotropic(pressure=pressure, dimension=packing.dimension),
        material=Material(friction=friction, wall_friction=wall_friction),
        solver=_solver(STIFFNESS, sharp=False),
    )
    simulation.damping = DAMPING
    return simulation


def _loose(simulation: Simulation) -> bool:
    """Whether there are fewer contacts than any packing at rest has: z of all grains below D."""
    touching = int((simulation.candidates.gap <= 0).sum())
    return 2 * touching < simulation.dimension * simulation.grain_count


def _gather(simulation: Simulation, tell: Progress) -> int:
    """Compact grains that hardly touch until they carry p, as hard ones; returns the steps made."""
    simulation.solver = Solver(tolerance=1e-3, stiffness=np.inf, time_step=0.1, max_sweeps=3000)
    simulation.damping, simulation.rate_cap = 0.0, RATE_CAP / simulation.scales.time
    simulation.set_loading(simulation.loading)
    steps = march(
        simulation,
        GATHER_STEPS,
        50,
        lambda s: s.kinetic_ratio() < GATHERED_ENERGY and _carries(s),
        lambda f: tell("compacting", f),
    )
    simulation.damping, simulation.rate_cap = DAMPING, None
    return steps


def _restless(simulation: Simulation, before: dict[str, float]) -> str:
    phi = simulation.solid_volume / simulation.volume
    return (
        f"the state to start from does not come to rest under p (kinetic energy / pV is "
        f"{simulation.kinetic_ratio():.1e}, allowed {ALLOWED_ENERGY:.0e}; φ {before['phi']:.3f} "
        f"became {phi:.3f}): its grains must fill its cell (--cell)"
    )


def _solver(stiffness: float, *, sharp: bool) -> Solver:
    return Solver(
        tolerance=1e-5 if sharp else 1e-4, stiffness=stiffness, time_step=0.2, max_sweeps=3000
    )


def _softness(simulation: Simulation) -> float:
    """k/p of the contacts as they are: what their overlaps stand for."""
    candidates, scales = simulation.candidates, simulation.scales
    overlap = np.maximum(-candidates.gap, 0.0)
    depth = float(overlap.sum())
    if depth == 0.0:
        return STIFFNESS
    load = float(candidates.impulse_n[overlap > 0].sum()) / simulation.step_size
    unit = scales.pressure * scales.diameter ** (simulation.dimension - 2)
    if load > 0:
        return load / depth / unit
    return scales.diameter * int((overlap > 0).sum()) / depth


def _stages(softness: float) -> list[float]:
    """Stiffnesses from the one at the start to the last, each four times the one before."""
    stages = [min(max(softness, SOFTEST), STIFFNESS)]
    while stages[-1] < STIFFNESS:
        stages.append(min(STIFFER * stages[-1], STIFFNESS))
    return stages


def _carries(simulation: Simulation) -> bool:
    return simulation.stress_error() < MISSED_PRESSURE


def _values(simulation: Simulation) -> dict[str, float]:
    """Fabric of the forces now; of the overlapping pairs where there are none."""
    candidates = simulation.candidates
    forces = candidates.impulse_n.copy()
    if not forces.any():
        candidates.impulse_n[:] = np.maximum(-candidates.gap, 0.0)
    values = measure_now(simulation, direction=np.eye(simulation.dimension)[-1])
    candidates.impulse_n[:] = forces
    return {**values, "phi": simulation.solid_volume / simulation.volume}
