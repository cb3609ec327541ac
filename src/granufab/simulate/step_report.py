"""How a step went."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["StepReport"]


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
