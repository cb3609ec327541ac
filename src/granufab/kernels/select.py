"""Which candidate pairs take part in the solve of a step."""

from __future__ import annotations

from granufab.kernels.options import kernel
from granufab.kernels.vectors import load, norm

__all__ = ["select_active"]


@kernel
def select_active(pairs, gap, impulse_n, motion, limits, active, like):
    """Mark pairs that carried an impulse or could close within the step.

    Args:
        limits: (margin, h, |L|, touching): a pair is marked if its gap is below
            margin + h(|c_i| + |c_j| + |L|·|gap|); margin < 0 marks only pairs with
            gap ≤ touching (restitution: contacts act only when closed).
    """
    margin, step, rate, touching = limits
    for c in range(len(pairs)):
        if margin < 0.0:
            active[c] = gap[c] <= touching
            continue
        speed = norm(load(motion, pairs[c, 0], like)) + norm(load(motion, pairs[c, 1], like))
        active[c] = impulse_n[c] > 0.0 or gap[c] < margin + step * (speed + rate * abs(gap[c]))
