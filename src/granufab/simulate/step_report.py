"""How steps went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from granufab.kernels.step_arrays import STRAIN_COLUMN
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

    @classmethod
    def of_rows(
        cls,
        rows: Array,
        shape: tuple[int, int],
        *,
        violation_unit: float,
        diameter: float,
        tolerance: float,
        stress_error: Callable[[Array], Array],
    ) -> Self:
        """From the rows that the kernel wrote (``kernels.step_arrays``).

        Args:
            rows: one per step.
            shape: (D, D).
            violation_unit, diameter: of velocities [m/s] and lengths [m].
            tolerance: residual of a converged step.
            stress_error: of stresses, shape (step_count, D, D).
        """
        strain, stress = np.split(rows[:, STRAIN_COLUMN:], 2, axis=1)
        return cls(
            sweeps=rows[:, 0].astype(np.int64),
            residual=rows[:, 1],
            residual_contact=rows[:, 2],
            violation=rows[:, 3] / violation_unit,
            overlap=rows[:, 4] / diameter,
            converged=rows[:, 1] <= tolerance,
            contacts=rows[:, 5].astype(np.int64),
            resolves=rows[:, 6].astype(np.int64),
            contact_updates=rows[:, 7].astype(np.int64),
            stress_error=stress_error(stress.reshape(-1, *shape)),
            strain=strain.reshape(-1, *shape),
        )

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
