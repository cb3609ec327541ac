"""How steps went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granufab.packing import Array, IntArray

__all__ = ["StepReport", "StepReports"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReport:
    """How one step went (see :class:`granufab.history.StepStatistics` for the names)."""

    sweeps: int
    residual: float
    residual_contact: float
    violation: float
    overlap: float
    converged: bool
    contacts: int
    resolves: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepReports:
    """How consecutive steps went: arrays of one value per step.

    Attributes:
        sweeps, residual, residual_contact, violation, overlap, converged, contacts, resolves: as
            in :class:`StepReport`.
        contact_updates: sweeps × contacts, over all solves of a step.
        stress_error: worst |σ − σ_ext| / p on the stress-driven components [-].
        strain: of the cell after each step [-], shape (step_count, D, D).
    """

    sweeps: IntArray
    residual: Array
    residual_contact: Array
    violation: Array
    overlap: Array
    converged: np.ndarray
    contacts: IntArray
    resolves: IntArray
    contact_updates: IntArray
    stress_error: Array
    strain: Array

    def __len__(self) -> int:
        return len(self.sweeps)

    @property
    def last(self) -> StepReport:
        """Of the last step."""
        return StepReport(
            sweeps=int(self.sweeps[-1]),
            residual=float(self.residual[-1]),
            residual_contact=float(self.residual_contact[-1]),
            violation=float(self.violation[-1]),
            overlap=float(self.overlap[-1]),
            converged=bool(self.converged[-1]),
            contacts=int(self.contacts[-1]),
            resolves=int(self.resolves[-1]),
        )
