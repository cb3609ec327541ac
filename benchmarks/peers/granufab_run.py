"""Run granufab on the job through its Python API."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from biaxial_job import Job, Start, job_columns, late_means


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Solver settings that decide what an answer costs.

    Attributes:
        kappa: implicit contact stiffness k/σ; inf is rigid.
        residual: at which a step is solved.
        time_step: [√(<m>/σ)].
        sweeps: most sweeps a step.
    """

    kappa: float
    residual: float
    time_step: float
    sweeps: int = 2000

    @property
    def name(self) -> str:
        """Part of a row's file name."""
        return f"k{self.kappa:g}-r{self.residual:g}-h{self.time_step:g}-c{self.sweeps}"


def packing_of(start: Start) -> Any:
    """The common sample as a packing at rest without forces."""
    from granufab.packing import Cell, Grains, Packing

    count = len(start.radius)
    grains = Grains(
        position=start.position,
        radius=start.radius,
        mass=start.mass,
        velocity=np.zeros((count, 2)),
        spin=np.zeros((count, 1)),
    )
    return Packing(grains=grains, cell=Cell(matrix=np.diag(start.sides)), source="peers")


def simulation_of(job: Job, start: Start, choice: Choice) -> Any:
    """The simulation at ε_1 = 0, its step a whole fraction of the interval between states."""
    import granufab.simulate as g

    rate = start.axial_rate(job)
    interval = job.strain / job.states / rate
    solver = g.Solver(
        tolerance=choice.residual, stiffness=choice.kappa, max_sweeps=choice.sweeps,
        time_step=choice.time_step,
    )  # fmt: skip
    loading = g.Biaxial(axial_rate=rate)
    longest = choice.time_step * math.sqrt(float(start.mass.mean()))
    wanted = min(longest, solver.step_strain / loading.nominal_rate)
    return g.Simulation(
        packing_of(start),
        loading,
        material=g.Material(friction=job.friction),
        solver=solver,
        step=interval / math.ceil(interval / wanted - 1e-9),
    )


def measure(simulation: Any) -> dict[str, float]:
    """The measures of the present state."""
    from granufab.simulate.capture import measure_now

    strain, stress = simulation.strain, simulation.stress
    return {
        "strain": float(strain[1, 1]),
        "eps_q": float(strain[1, 1] - strain[0, 0]),
        "lateral": float(stress[0, 0]),
        "q_over_p": float((stress[1, 1] - stress[0, 0]) / max(np.trace(stress), 1e-300)),
        "phi": float(np.pi * (simulation.radius**2).sum() / simulation.volume),
        **measure_now(simulation, direction=np.array([0.0, 1.0])),
    }


def follow(simulation: Any, job: Job) -> tuple[list[dict[str, float]], dict[str, float]]:
    """Shear to the last strain; the measured states and what they cost."""
    interval = job.strain / job.states / (-simulation.loading.rate[1, 1])
    steps_each = round(interval / simulation.step_size)
    rows, sweeps, unconverged = [], 0, 0
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(job.states):
        for _ in range(steps_each):
            report = simulation.step()
            sweeps += report.sweeps
            unconverged += not report.converged
        rows.append(measure(simulation))
    steps = steps_each * job.states
    return rows, {
        "seconds": time.perf_counter() - wall, "cpu_seconds": time.process_time() - cpu,
        "steps": steps, "sweeps": sweeps / steps, "unconverged": unconverged / steps,
        "contact_updates": simulation.contact_updates,
    }  # fmt: skip


def run_granufab(job: Job, start: Start, choice: Choice, *, role: str = "") -> dict[str, Any]:
    """One row: granufab with the given settings on one core, compiled beforehand."""
    from granufab import __version__

    warm = simulation_of(job, start, choice)
    for _ in range(3):
        warm.step()
    measure(warm)
    simulation = simulation_of(job, start, choice)
    rows, cost = follow(simulation, job)
    late = [row["lateral"] for row in rows[int(0.7 * len(rows)) :]]
    kappa = choice.kappa if math.isfinite(choice.kappa) else "rigid"
    return {
        "program": "granufab", "version": __version__, "role": role, **job_columns(job),
        "kappa": kappa, "residual": choice.residual, "time_step": simulation.step_size,
        "time_step_setting": choice.time_step, "lateral_stress": float(np.mean(late)),
        "lateral_scatter": float(np.std(late)), **cost, **late_means(rows, job),
    }  # fmt: skip
