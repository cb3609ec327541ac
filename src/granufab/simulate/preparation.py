"""Isotropic samples: compaction under p, relaxation to rest, and a wanted coordination number.

Compaction: free dilation, rigid contacts, the solved rate capped so that grains cannot tunnel.
Then the motion settles and the forces at rest are found so sharply that contact counts mean
something (a spurious impulse of the solver's noise would count as a contact). A wanted z_0 is
reached by changing the friction of the compaction.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings, NotConverged
from granufab.packing import Packing
from granufab.simulate.capture import capture_packing, measure_now
from granufab.simulate.loading import Isotropic
from granufab.simulate.sample import random_sample
from granufab.simulate.settings import Material, Sample, Solver
from granufab.simulate.settling import march, settle
from granufab.simulate.stepping import Simulation

__all__ = ["Prepared", "compress", "prepare", "rest_values"]

Progress = Callable[[str, float], None]
RATE_CAP = 0.05
COMPACT_STEPS = 6000
COMPACTED_ENERGY, ALLOWED_ENERGY = 1e-4, 1e-6
FRICTION_HIGH = 5.0
TRIALS = 12
# z_backbone against compaction friction of samples made by this very protocol (2,000 disks,
# 1,000 spheres): only a first guess, every sample is measured.
GUESS_FRICTION = np.array([0.0, 0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 1.0, 5.0])
GUESS_Z = {
    2: np.array([4.0, 3.95, 3.85, 3.65, 3.47, 3.33, 3.2, 3.1, 3.05]),
    3: np.array([6.0, 5.83, 5.62, 5.2, 4.81, 4.57, 4.3, 4.13, 4.1]),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """An isotropic sample at rest.

    Attributes:
        packing: the sample with its forces.
        friction: compaction friction that made it [-].
        reached: z, z_backbone, z_mechanical, rattler_fraction, phi, a at rest.
        wanted: the coordination number asked for, or None.
        trials: (friction, z) of every compaction tried.
        summary: residual, overlap, kinetic ratio, steps, seconds of the last compaction; ``rest``
            is "programs" where linear programs found it, with their number and ``gaps_closed``.
    """

    packing: Packing
    friction: float
    reached: dict[str, float]
    wanted: float | None = None
    trials: tuple[tuple[float, float], ...] = ()
    summary: dict[str, Any] = field(default_factory=dict)


def rest_values(simulation: Simulation) -> dict[str, float]:
    """z (three ways), rattlers, a, φ of a resting sample, force criterion."""
    values = measure_now(simulation, direction=np.eye(simulation.dimension)[1])
    return {**values, "phi": simulation.solid_volume / simulation.volume}


def compress(
    packing: Packing,
    *,
    friction: float = 0.0,
    pressure: float = 1.0,
    tolerance: float | None = None,
    diagonals: bool = False,
    progress: Progress | None = None,
) -> Packing:
    """Compact a dilute packing isotropically under ``pressure`` and bring it to rest.

    Args:
        packing: grains with masses in a cell, periodic or walled.
        friction: µ_c during compaction; it decides z: 0 gives the isostatic z_backbone = 2D.
        pressure: p [N/m^(D−1)].
        tolerance: residual at rest; default 1e-6 (3e-7 in frictionless samples too large for
            the linear programs of their rest).
        diagonals: let all diagonal components of the cell move (n_free = D), not only the
            dilation (n_free = 1).
        progress: called with a text and the fraction done.
    Returns:
        The sample at rest with its contact forces.
    Raises:
        NotConverged: it did not come to rest.
    """
    simulation, _ = _compact(
        packing,
        friction=friction,
        pressure=pressure,
        tolerance=tolerance,
        diagonals=diagonals,
        progress=progress,
    )
    return capture_packing(simulation, source=f"compress(friction={friction})")


def _compact(
    packing: Packing,
    *,
    friction: float,
    pressure: float,
    tolerance: float | None = None,
    diagonals: bool = False,
    progress: Progress | None = None,
) -> tuple[Simulation, dict[str, Any]]:
    if not (np.isfinite(friction) and friction >= 0):
        raise InvalidSettings(f"compaction friction is {friction}, must be ≥ 0")
    began = time.perf_counter()
    tell = progress or (lambda text, fraction: None)
    fast = Solver(tolerance=1e-3, stiffness=float("inf"), time_step=0.1, max_sweeps=3000)
    simulation = Simulation(
        packing,
        Isotropic(pressure=pressure, dimension=packing.dimension, diagonals=diagonals),
        material=Material(friction=friction, wall_friction=0.0),
        solver=fast,
    )
    simulation.rate_cap = RATE_CAP / simulation.scales.time
    steps = march(simulation, COMPACT_STEPS, 50, _compacted, lambda f: tell("compacting", 0.4 * f))
    simulation.rate_cap = None
    more, how = settle(simulation, friction, tolerance, lambda f: tell("settling", 0.4 + 0.6 * f))
    steps += more
    report = simulation.last_report
    if simulation.kinetic_ratio() > ALLOWED_ENERGY:
        raise NotConverged(
            f"the sample did not come to rest: kinetic energy / pV is "
            f"{simulation.kinetic_ratio():.1e} after {steps} steps, allowed {ALLOWED_ENERGY:.0e}"
        )
    return simulation, {
        "steps": steps,
        "residual": report.residual,
        "overlap": report.overlap,
        "kinetic_ratio": simulation.kinetic_ratio(),
        "contact_updates": simulation.contact_updates,
        "seconds": time.perf_counter() - began,
        **how,
    }


def _compacted(simulation: Simulation) -> bool:
    pressure = float(np.trace(simulation.stress)) / simulation.dimension
    close = abs(pressure / simulation.scales.pressure - 1) < 1e-2
    return close and simulation.kinetic_ratio() < COMPACTED_ENERGY


def prepare(sample: Sample, *, progress: Progress | None = None) -> Prepared:
    """Make the sample that settings describe: sizes, dilute start, compaction, wanted z_0.

    Args:
        sample: grain count, sizes, pressure, and either a compaction friction or a wanted
            coordination number in one of the three definitions.
        progress: called with a text and the fraction done.
    Raises:
        NotConverged: the wanted coordination cannot be reached; names the reachable range.
    """
    if sample.file is not None:
        raise InvalidSettings(
            "sample.file is read by `granufab run`; in Python start from "
            "granufab.read(file).frames[-1].packing"
        )
    start = random_sample(
        sample.grain_count,
        dimension=sample.dimension,
        sizes=sample.sizes,
        diameter=sample.diameter,
        density=sample.density,
        solid_fraction=sample.solid_fraction,
        boundary=sample.boundary,
        seed=sample.seed,
    )
    search = _Search(start, sample, progress)
    if sample.coordination is None:
        search.attempt(sample.friction)
        return search.result(sample.friction)
    return search.result(search.find(sample.coordination))


class _Search:
    """Bisection of the compaction friction; keeps every trial."""

    def __init__(self, start: Packing, sample: Sample, progress: Progress | None) -> None:
        self.start, self.sample, self.progress = start, sample, progress
        self.z: dict[float, float] = {}
        self.guess = GUESS_Z[sample.dimension]
        self.best: tuple[float, Simulation, dict[str, Any]] | None = None

    def attempt(self, friction: float) -> float:
        """Compact at this friction; returns the reached z."""
        if friction in self.z:
            return self.z[friction]
        simulation, summary = _compact(
            self.start,
            friction=friction,
            pressure=self.sample.pressure,
            progress=self._tell,
        )
        z = rest_values(simulation)[self.sample.z_definition]
        self.z[friction] = z
        wanted = self.sample.coordination
        closest = min(self.z, key=lambda f: abs(self.z[f] - wanted)) if wanted else friction
        if closest == friction:
            self.best = (friction, simulation, summary)
        return z

    def _tell(self, text: str, fraction: float) -> None:
        if self.progress is not None:
            wanted = self.sample.coordination
            count = f", trial {len(self.z) + 1} for z_0 = {wanted:g}" if wanted else ""
            self.progress(f"{text}{count}", fraction)

    def find(self, wanted: float) -> float:
        """Friction whose sample is within the tolerance of ``wanted``."""
        tolerance = self.sample.coordination_tolerance
        if wanted > 2 * self.sample.dimension + tolerance:
            self._refuse(wanted)
        low, high = 0.0, FRICTION_HIGH
        z_low, z_high = self.guess[0], self.guess[-1]
        trial = float(np.interp(-wanted, -self.guess, GUESS_FRICTION))
        for _ in range(TRIALS):
            z = self.attempt(trial)
            if abs(z - wanted) <= tolerance:
                return trial
            if z > wanted:
                low, z_low = trial, z
            else:
                high, z_high = trial, z
            trial = self._next(wanted, (low, z_low), (high, z_high))
            if trial in self.z:
                break
        nearest = min(self.z, key=lambda f: abs(self.z[f] - wanted))
        if abs(self.z[nearest] - wanted) <= 0.05:
            return nearest
        return self._refuse(wanted)

    def _next(self, wanted: float, low: tuple[float, float], high: tuple[float, float]) -> float:
        """Next friction between a bracket: the guess curve shifted through both ends."""
        if low[0] == 0.0 and low[0] not in self.z and wanted >= self.guess[0] - 0.02:
            return 0.0
        if high[0] == FRICTION_HIGH and high[0] not in self.z and low[0] >= 1.0:
            return FRICTION_HIGH
        guess = np.interp([low[0], high[0]], GUESS_FRICTION, self.guess)
        span = low[1] - high[1]
        share = (low[1] - wanted) / span if span > 1e-6 else 0.5
        share = min(max(share, 0.1), 0.9)
        target = guess[0] + share * (guess[1] - guess[0])
        trial = float(np.interp(-target, -self.guess, GUESS_FRICTION))
        inside = low[0] < trial < high[0]
        return trial if inside else 0.5 * (low[0] + high[0])

    def _refuse(self, wanted: float) -> float:
        high, low = self.attempt(0.0), self.attempt(FRICTION_HIGH)
        name = self.sample.z_definition
        raise NotConverged(
            f"sample.coordination = {wanted:g} ({name}) cannot be reached with "
            f"{self.sample.grain_count} grains: compaction friction 0 to {FRICTION_HIGH:g} gives "
            f"{name} from {low:.2f} to {high:.2f}"
        )

    def result(self, friction: float) -> Prepared:
        """The sample made at ``friction``."""
        assert self.best is not None
        if self.best[0] != friction:
            del self.z[friction]
            self.attempt(friction)
        made, simulation, summary = self.best
        return Prepared(
            packing=capture_packing(simulation, source=f"prepare(seed={self.sample.seed})"),
            friction=made,
            reached=rest_values(simulation),
            wanted=self.sample.coordination,
            trials=tuple(self.z.items()),
            summary=summary,
        )
