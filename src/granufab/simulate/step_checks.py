"""What must not happen in a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granufab.errors import InvalidPacking, NotConverged
from granufab.simulate.step_law import OVERLAP_LIMIT
from granufab.simulate.step_report import StepReport

if TYPE_CHECKING:
    from granufab.simulate.stepping import Simulation

__all__ = ["check_step"]


def check_step(s: Simulation, report: StepReport) -> None:
    """Refuse a state after a step.

    Raises:
        InvalidPacking: velocities are not finite or grains overlap beyond the limit.
        NotConverged: the residual was not met and the solver is ``strict``.
    """
    if not np.isfinite(s.motion).all() or not np.isfinite(s.rate).all():
        bad = np.flatnonzero(~np.isfinite(s.motion).all(axis=1))[:3]
        raise InvalidPacking(f"the velocity of grains {bad.tolist()} is not finite after a step")
    if report.overlap > OVERLAP_LIMIT:
        worst = int(np.argmin(s.candidates.gap))
        i, j = s.candidates.pairs[worst]
        raise InvalidPacking(
            f"grains {i} and {j} overlap by {report.overlap:.2g} diameters, limit "
            f"{OVERLAP_LIMIT}; take a smaller time_step"
        )
    if not report.converged and s.solver.strict:
        raise NotConverged(
            f"a step ended at residual {report.residual:.2e} after {report.sweeps} sweeps, "
            f"tolerance {s.solver.tolerance:.1e}; raise solver.max_sweeps or lower stiffness"
        )
