"""What must not happen in a step: which grains are named, and what can be done."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granufab.errors import BrokenState, NotConverged
from granufab.simulate.step_law import OVERLAP_LIMIT
from granufab.simulate.step_report import StepReport

if TYPE_CHECKING:
    from granufab.simulate.stepping import Simulation

__all__ = ["check_places", "check_step"]

NAMED = 3
"""Grains that a message names one by one."""


def check_step(s: Simulation, report: StepReport) -> None:
    """Refuse a state after a step; the kernel has seen that something is wrong, or a goal reached.

    Raises:
        BrokenState: a number of the state is not finite, a radius, mass or the cell's volume is
            not positive, or grains overlap beyond the limit.
        NotConverged: the residual was not met and the solver is ``strict``.
    """
    fault = _fault_of_grains(s, s.memory.free) or _fault_of_contacts(s) or _fault_of_cell(s)
    if fault:
        raise BrokenState(f"{fault} after the step to time {s.time:.6g}; {_remedy(s)}")
    if report.overlap > OVERLAP_LIMIT:
        raise BrokenState(
            f"{_worst_pair(s)} overlap by {report.overlap:.2g} diameters after the step to time "
            f"{s.time:.6g}, limit {OVERLAP_LIMIT}; {_remedy(s)}"
        )
    if not report.converged and s.solver.strict:
        raise NotConverged(
            f"a step ended at residual {report.residual:.2e} after {report.sweeps} sweeps, "
            f"tolerance {s.solver.tolerance:.1e}; raise solver.max_sweeps or lower stiffness"
        )


def check_places(s: Simulation) -> None:
    """Refuse positions or a cell in which no neighbours can be found.

    Raises:
        BrokenState: they are not finite.
    """
    if np.isfinite(s.position).all() and np.isfinite(s.matrix).all():
        return
    fault = _fault_of_grains(s, s.motion) or _fault_of_cell(s)
    raise BrokenState(f"{fault} in the step from time {s.time:.6g}; {_remedy(s)}")


def _fault_of_grains(s: Simulation, before: NDArray) -> str:
    """The first quantity that cannot be; causes before what follows from them.

    Args:
        s: the system after the step, in which a fault has spread over all contacts.
        before: body records before the contacts acted.
    """
    count, dimension = s.grain_count, s.dimension
    heavy = dimension + s.candidates.tangents
    motion, before = s.motion[:count], before[:count]
    inverse = motion[:, heavy]
    checks = (
        ("radius", "is not positive", ~((s.radius > 0) & np.isfinite(s.radius))),
        ("mass", "is not positive", ~((inverse > 0) & np.isfinite(inverse))),
        ("velocity", "is not finite", _broken(before[:, :dimension])),
        ("spin", "is not finite", _broken(before[:, dimension:heavy])),
        ("position", "is not finite", _lost(s)),
        ("position", "is not finite", _broken(s.position)),
        ("velocity", "is not finite", _broken(motion[:, :dimension])),
        ("spin", "is not finite", _broken(motion[:, dimension:heavy])),
    )
    for name, what, bad in checks:
        if bad.any():
            return f"the {name} of {_grains(s, np.flatnonzero(bad))} {what}"
    return ""


def _fault_of_contacts(s: Simulation) -> str:
    c = s.candidates
    bad = ~np.isfinite(c.impulse_n) | _broken(c.impulse_t)
    if not bad.any():
        return ""
    return f"the impulse between {_pair(s, int(np.flatnonzero(bad)[0]))} is not finite"


def _fault_of_cell(s: Simulation) -> str:
    for name, value in (("matrix", s.matrix), ("rate", s.rate), ("stress", s.stress)):
        if not np.isfinite(value).all():
            return f"the {name} of the cell is not finite"
    if not np.isfinite(s.strain).all() or not np.linalg.det(s.matrix) > 0:
        return f"the volume of the cell is {s.volume:.3g}"
    return ""


def _lost(s: Simulation) -> NDArray[np.bool_]:
    """Grains whose gaps were all unknown when the contacts were found."""
    first, second = s.candidates.pairs.T
    broken, bodies = ~np.isfinite(s.candidates.gap), s.grain_count + 2 * s.dimension
    ends = np.concatenate([first, second])
    pairs = np.bincount(ends, minlength=bodies)[: s.grain_count]
    ends = ends[np.concatenate([broken, broken])]
    unknown = np.bincount(ends, minlength=bodies)[: s.grain_count]
    return np.logical_and(unknown > 0, unknown == pairs)


def _broken(table: NDArray) -> NDArray[np.bool_]:
    return ~np.logical_and.reduce(np.isfinite(table), axis=1)


def _grains(s: Simulation, index: NDArray) -> str:
    """The grains by their numbers, the first few of many."""
    numbers = [_number(s, k) for k in index[:NAMED].tolist()]
    if len(index) == 1:
        return f"grain {numbers[0]}"
    more = f" and {len(index) - NAMED} more" if len(index) > NAMED else ""
    return f"grains {', '.join(map(str, numbers))}{more}"


def _number(s: Simulation, index: int) -> int:
    return index if s.number is None else int(s.number[index])


def _worst_pair(s: Simulation) -> str:
    return _pair(s, int(np.argmin(s.candidates.gap)))


def _pair(s: Simulation, candidate: int) -> str:
    i, j = (int(k) for k in s.candidates.pairs[candidate])
    if j < s.grain_count:
        return f"grains {_number(s, i)} and {_number(s, j)}"
    wall = j - s.grain_count
    side = ("lower", "upper")[wall % 2]
    return f"grain {_number(s, i)} and the {side} wall across {'xyz'[wall // 2]}"


def _remedy(s: Simulation) -> str:
    return f"take a smaller time_step (solver.time_step is {s.solver.time_step:g})"
