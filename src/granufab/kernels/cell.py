"""The cell as one more body: what contacts push it with and how it moves them."""

from __future__ import annotations

from granufab.kernels.options import part
from granufab.kernels.tracing import larger, summed, traced
from granufab.kernels.vectors import scale

__all__ = ["add_outer", "cell_weight", "hand_on", "move_cell", "stretching"]


@part
def hand_on(rate, push, pending, times):
    """rate += times·pending, push += pending, pending ← 0, for matrices (D, D)."""
    for k in range(len(rate)):
        for l in range(len(rate)):
            rate[k, l] += times * pending[k, l]
            push[k, l] += pending[k, l]
            pending[k, l] = 0.0


@part
def move_cell(rate, push):
    """rate += push, push ← 0, for matrices (D, D)."""
    for k in range(len(rate)):
        for l in range(len(rate)):
            rate[k, l] += push[k, l]
            push[k, l] = 0.0


@traced
def add_outer(target, weight, a, b):
    """target += weight ∘ (a⊗b), a contact's push on the free cell rates.

    ``target`` and ``weight`` are addresses of matrices (D, D); lanes are summed.
    """
    dimension = len(a)
    for k in range(dimension):
        for l in range(dimension):
            target[k * dimension + l] += weight[k * dimension + l] * summed(a[k] * b[l])


@traced
def stretching(rate, a):
    """L a for the address of a matrix (D, D)."""
    return tuple(sum(rate[k * len(a) + l] * a[l] for l in range(len(a))) for k in range(len(a)))


@traced
def cell_weight(weight, n, length):
    """What free cell components add to the local Delassus matrix, as (nn, nt, tt).

    ``weight`` is the address of a matrix (D, D). The addition is diag(s_k) in global axes,
    s_k = Σ_l weight_kl ℓ_l². In 3D nt is 0 and tt an
    upper bound (the largest s_k): the coupling is O(1/grain_count) and left to the sweeps.
    """
    s = scale(length**2, stretching(weight, tuple(x * x for x in n)))
    normal = sum(n[k] ** 2 * s[k] for k in range(len(n)))
    if len(n) == 2:
        return normal, n[0] * n[1] * (s[1] - s[0]), n[1] ** 2 * s[0] + n[0] ** 2 * s[1]
    return normal, 0.0, larger(s[0], larger(s[1], s[2]))
