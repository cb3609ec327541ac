"""The cell as one more body: what contacts push it with and how it moves them."""

from __future__ import annotations

from typing import Any

from granufab.kernels.access import item, set_item, summed
from granufab.kernels.options import compiled, inlined, kernel
from granufab.kernels.vectors import dot, scale

__all__ = ["add_outer", "cell_weight", "hand_on", "move_cell", "stretching"]


def _by_dimension(vector: Any, two: Any, three: Any) -> Any:
    return two if vector.count == 2 else three


@kernel
def hand_on(rate, push, pending, times):
    """rate += times·pending, push += pending, pending ← 0, for matrices (D, D)."""
    for k in range(len(rate)):
        for l in range(len(rate)):
            rate[k, l] += times * pending[k, l]
            push[k, l] += pending[k, l]
            pending[k, l] = 0.0


@kernel
def move_cell(rate, push):
    """rate += push, push ← 0, for matrices (D, D)."""
    for k in range(len(rate)):
        for l in range(len(rate)):
            rate[k, l] += push[k, l]
            push[k, l] = 0.0


def add_outer(target, weight, a, b):
    """target += weight ∘ (a⊗b), a contact's push on the free cell rates.

    ``target`` and ``weight`` are addresses of matrices (D, D); lanes are summed.
    """
    dimension = len(a)
    for k in range(dimension):
        for l in range(dimension):
            target[k * dimension + l] += weight[k * dimension + l] * summed(a[k] * b[l])


@inlined
def _add_item(target, weight, k, a, b):
    set_item(target, k, item(target, k) + item(weight, k) * summed(a * b))


@compiled(add_outer)
def _add_outer(target, weight, a, b):
    def two(target, weight, a, b):
        _add_item(target, weight, 0, a[0], b[0])
        _add_item(target, weight, 1, a[0], b[1])
        _add_item(target, weight, 2, a[1], b[0])
        _add_item(target, weight, 3, a[1], b[1])

    def three(target, weight, a, b):
        _add_item(target, weight, 0, a[0], b[0])
        _add_item(target, weight, 1, a[0], b[1])
        _add_item(target, weight, 2, a[0], b[2])
        _add_item(target, weight, 3, a[1], b[0])
        _add_item(target, weight, 4, a[1], b[1])
        _add_item(target, weight, 5, a[1], b[2])
        _add_item(target, weight, 6, a[2], b[0])
        _add_item(target, weight, 7, a[2], b[1])
        _add_item(target, weight, 8, a[2], b[2])

    return _by_dimension(a, two, three)


def stretching(rate, a):
    """L a for the address of a matrix (D, D)."""
    return tuple(sum(rate[k * len(a) + l] * a[l] for l in range(len(a))) for k in range(len(a)))


@compiled(stretching)
def _stretching(rate, a):
    return _by_dimension(
        a,
        lambda rate, a: (
            item(rate, 0) * a[0] + item(rate, 1) * a[1],
            item(rate, 2) * a[0] + item(rate, 3) * a[1],
        ),
        lambda rate, a: (
            item(rate, 0) * a[0] + item(rate, 1) * a[1] + item(rate, 2) * a[2],
            item(rate, 3) * a[0] + item(rate, 4) * a[1] + item(rate, 5) * a[2],
            item(rate, 6) * a[0] + item(rate, 7) * a[1] + item(rate, 8) * a[2],
        ),
    )


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
    return normal, 0.0, max(s)


@compiled(cell_weight)
def _cell_weight(weight, n, length):
    def two(weight, n, length):
        xx, yy = n[0] * n[0], n[1] * n[1]
        s_0, s_1 = scale(length * length, stretching(weight, (xx, yy)))
        return xx * s_0 + yy * s_1, n[0] * n[1] * (s_1 - s_0), yy * s_0 + xx * s_1

    def three(weight, n, length):
        squared = (n[0] * n[0], n[1] * n[1], n[2] * n[2])
        s = scale(length * length, stretching(weight, squared))
        return dot(squared, s), 0.0, max(s[0], max(s[1], s[2]))

    return _by_dimension(n, two, three)
