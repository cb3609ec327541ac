"""From the engine's workspace to frozen states: packings, frames, series rows, statistics."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from granufab.fabric import quick_measure
from granufab.fabric.criterion import force_threshold
from granufab.history import Frame, StepStatistics
from granufab.packing import Array, Cell, Contacts, Grains, IntArray, Packing, WallContacts
from granufab.simulate.step_report import StepReports
from granufab.simulate.stepping import Simulation

__all__ = ["StepTally", "capture_frame", "capture_packing", "measure_now", "merge", "series_row"]

_WORST = ("residual", "residual_contact", "violation", "overlap", "pressure_error")


def capture_packing(simulation: Simulation, *, reach: float = 0.05, source: str = "") -> Packing:
    """The present state as a Packing.

    Contacts are all pairs with gap ≤ ``reach`` mean diameters, and every pair that carries an
    impulse; forces are impulses over the time step, frames those of the last solve.

    Args:
        simulation: the running system.
        reach: recorded gap [mean diameters], at most the neighbour list's skin.
        source: provenance text.
    """
    s, c = simulation, simulation.candidates
    walls = c.pairs[:, 1] >= s.grain_count
    near = (c.gap <= reach * s.scales.diameter) | (c.impulse_n > 0)
    kept, on_wall = near & ~walls, near & walls
    force = c.impulses() / s.step_size
    dimension = s.dimension
    spins = 1 if dimension == 2 else 3
    rows = s.motion[: s.grain_count]
    return Packing(
        grains=Grains(
            position=s.position,
            radius=s.radius,
            mass=s.mass,
            velocity=rows[:, :dimension],
            spin=rows[:, dimension : dimension + spins] / s.radius[:, None],
            number=s.number,
        ),
        contacts=Contacts(
            pair=c.pairs[kept],
            normal=c.normal[kept],
            branch=c.normal[kept] * c.length[kept, None],
            gap=c.gap[kept],
            force=force[kept],
            image=c.images[kept],
        ),
        cell=Cell(
            matrix=s.matrix,
            periodic=tuple(bool(p) for p in s.periodic),
            origin=s.origin,
            rate=s.rate,
        ),
        wall_contacts=None
        if s.periodic.all()
        else WallContacts(
            grain=c.pairs[on_wall, 0],
            wall=c.pairs[on_wall, 1] - s.grain_count,
            normal=c.normal[on_wall],
            gap=c.gap[on_wall],
            force=force[on_wall],
        ),
        time=s.time,
        source=source,
    )


def measure_now(
    simulation: Simulation,
    *,
    direction: Array,
    minor: Array | None = None,
    z_definition: str = "z_backbone",
) -> dict[str, float]:
    """z in three ways, rattlers, a, a', θ_c of the force-bearing contacts of the last solve."""
    c, count = simulation.candidates, simulation.grain_count
    pushing = c.impulse_n > 0
    grains = pushing & (c.pairs[:, 1] < count)
    return quick_measure(
        c.pairs[grains].astype(np.int64),
        c.normal[grains],
        c.impulse_n[grains],
        count,
        direction=direction,
        minor=minor,
        z_definition=z_definition,  # type: ignore[arg-type]
        minimum=2 if simulation.material.friction > 0 else simulation.dimension + 1,
        support=_wall_support(simulation, pushing & ~grains),
    )


def _wall_support(simulation: Simulation, on_wall: np.ndarray) -> IntArray | None:
    if simulation.periodic.all():
        return None
    c = simulation.candidates
    bearing = on_wall & (c.impulse_n > force_threshold(c.impulse_n))
    return np.bincount(c.pairs[bearing, 0], minlength=simulation.grain_count).astype(np.int64)


class StepTally:
    """Gathers step reports between two records."""

    def __init__(self) -> None:
        self.begin(StepStatistics())

    def begin(self, earlier: StepStatistics) -> None:
        """Start with what was gathered before, see :meth:`now`."""
        self._began, self._earlier = time.perf_counter(), earlier.seconds
        self._steps, self._nonconverged = earlier.steps, earlier.nonconverged
        self._sweeps, self._updates = int(earlier.sweeps), earlier.contact_updates
        self._worst = {name: float(getattr(earlier, name)) for name in _WORST}

    def add(self, reports: StepReports) -> None:
        """Count steps."""
        self._steps += len(reports)
        self._sweeps += int(reports.sweeps.sum())
        self._nonconverged += int((~reports.converged).sum())
        self._updates += int((reports.sweeps * reports.contacts).sum())
        worst = self._worst
        for name in ("residual", "residual_contact", "violation", "overlap"):
            worst[name] = max(worst[name], float(getattr(reports, name).max()))
        worst["pressure_error"] = max(worst["pressure_error"], float(reports.stress_error.max()))

    def now(self) -> StepStatistics:
        """What is gathered, to begin with later; ``sweeps`` is their sum, not their mean."""
        return StepStatistics(
            steps=self._steps,
            nonconverged=self._nonconverged,
            sweeps=self._sweeps,
            contact_updates=self._updates,
            seconds=self._earlier + time.perf_counter() - self._began,
            **self._worst,
        )

    def take(self, kinetic_ratio: float) -> StepStatistics:
        """The statistics since the last call, which start again."""
        gathered = self.now()
        self.begin(StepStatistics())
        mean = gathered.sweeps / max(gathered.steps, 1)
        return replace(gathered, sweeps=mean, kinetic_ratio=kinetic_ratio)


def merge(parts: list[StepStatistics]) -> StepStatistics:
    """Statistics of several intervals together."""
    steps = sum(part.steps for part in parts)

    def worst(name: str) -> float:
        return max((getattr(part, name) for part in parts), default=0.0)

    return StepStatistics(
        steps=steps,
        nonconverged=sum(part.nonconverged for part in parts),
        sweeps=sum(part.sweeps * part.steps for part in parts) / max(steps, 1),
        residual=worst("residual"),
        residual_contact=worst("residual_contact"),
        violation=worst("violation"),
        overlap=worst("overlap"),
        pressure_error=worst("pressure_error"),
        kinetic_ratio=parts[-1].kinetic_ratio if parts else 0.0,
        contact_updates=sum(part.contact_updates for part in parts),
        seconds=sum(part.seconds for part in parts),
    )


def series_row(
    simulation: Simulation, place: dict[str, Any], statistics: StepStatistics
) -> dict[str, float]:
    """One row of the series (columns as in :data:`granufab.history.SERIES_UNITS`)."""
    s = simulation
    values = measure_now(
        s,
        direction=place["direction"],
        minor=place["minor"],
        z_definition=place["z_definition"],
    )
    principal = np.sort(np.linalg.eigvalsh(0.5 * (s.stress + s.stress.T)))
    mean = float(principal.mean())
    deviator = float(principal[-1] - principal[0]) / s.dimension
    return {
        "path": place["name"],
        "eps_q": place["eps_q"],
        "eps_q_total": place["eps_q_total"],
        **values,
        "q_over_p": deviator / mean if mean > 0 else float("nan"),
        "phi": s.solid_volume / s.volume,
        "p": mean,
        "residual": statistics.residual,
        "sweeps": statistics.sweeps,
        "overlap": statistics.overlap,
        "inertial_number": place["inertial_number"],
    }


def capture_frame(
    simulation: Simulation, place: dict[str, Any], statistics: StepStatistics
) -> Frame:
    """The present state as a Frame of a run."""
    return Frame(
        packing=capture_packing(simulation, reach=place["reach"], source=place["name"]),
        eps_q=place["eps_q"],
        eps_q_total=place["eps_q_total"],
        strain=simulation.strain.copy(),
        stage=place["stage"],
        stress=simulation.stress.copy(),
        inertial_number=place["inertial_number"],
        direction=place["direction"],
        statistics=statistics,
        remap=simulation.remap.astype(float),
        extension=place["minor"],
    )
