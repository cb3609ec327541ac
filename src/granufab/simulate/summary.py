"""The summary of a path: how it was solved, how homogeneous it stayed, what to be warned of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from granufab.fabric import homogeneity
from granufab.history import Frame, FrameSource, StepStatistics, frame_before
from granufab.simulate.stepping import Simulation

__all__ = ["summarise"]

QUASI_STATIC, STRESS_ERROR = 3e-3, 1e-2
HOMOGENEITY_STRAIN, HOMOGENEITY_GRAINS = 0.1, 200


def summarise(
    simulation: Simulation,
    whole: StepStatistics,
    frames: FrameSource | Sequence[Frame],
    inertial: float,
    seconds: float,
) -> dict[str, Any]:
    """What a person wants to know of a finished path, as plain data.

    Args:
        simulation: the system at the end of the path.
        whole: statistics of all steps.
        frames: recorded states.
        inertial: largest inertial number of a stage.
        seconds: wall time of the path.
    """
    summary: dict[str, Any] = {
        "steps": whole.steps,
        "nonconverged_steps": whole.nonconverged,
        "sweeps_mean": whole.sweeps,
        "residual_max": whole.residual,
        "overlap_max": whole.overlap,
        "violation_max": whole.violation,
        "pressure_error_max": whole.pressure_error,
        "contact_updates": whole.contact_updates,
        "kinetic_ratio": whole.kinetic_ratio,
        "seconds": seconds,
        "seconds_by_stage": dict(simulation.seconds),
        "tolerance": simulation.solver.tolerance,
        "stiffness": simulation.solver.stiffness,
        "step_size": simulation.step_size,
        "inertial_number_max": inertial,
        "friction": simulation.material.friction,
        "grain_count": simulation.grain_count,
        "neighbour_searches": simulation.searches,
        "criterion": "force",
    }
    warnings = []
    if inertial > QUASI_STATIC:
        warnings.append(
            f"inertial number {inertial:.1e} is above {QUASI_STATIC:.0e}: not quasi-static"
        )
    if whole.nonconverged:
        warnings.append(
            f"{whole.nonconverged} of {whole.steps} steps ended above the tolerance "
            f"{simulation.solver.tolerance:.1e}, worst residual {whole.residual:.1e}"
        )
    if whole.pressure_error > STRESS_ERROR:
        warnings.append(
            f"a step missed the wanted stress by {100 * whole.pressure_error:.1f} %, more than "
            f"{100 * STRESS_ERROR:.0f} %"
        )
    summary["warnings"] = warnings
    _add_homogeneity(summary, frames)
    return summary


def _add_homogeneity(summary: dict[str, Any], frames: FrameSource | Sequence[Frame]) -> None:
    """Variance of the local strain over the last part of the path; warns of shear bands."""
    if len(frames) == 0 or frames[-1].packing.grains.count < HOMOGENEITY_GRAINS:
        return
    before = frame_before(frames, -1, HOMOGENEITY_STRAIN)
    if before is None:
        return
    found = homogeneity((before.packing, frames[-1].packing))
    summary["homogeneity"] = dict(found)
    if found["localised"]:
        summary["warnings"].append(
            f"the strain is not homogeneous: local variance {found['relative_variance']:.2f}, "
            f"expected {found['expected']:.2f}; look at plot --figure homogeneity for shear bands"
        )
