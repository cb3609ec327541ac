"""Small vectors as tuples: the only file that knows the dimension.

A vector is a tuple of D floats; a spin, and whatever lies in the tangent plane, is a 1-tuple in
2D (component along t = (−n_y, n_x)) and a 3-tuple in 3D (global axes, perpendicular to n). The
length of the tuple is part of its type, so one kernel text compiles to hand-written 2D and 3D
code; ``like`` arguments carry the dimension into loads. Each function exists as plain Python
(used with the JIT off) and as a compiled overload that picks its text by tuple length.

Bodies are rows of ``motion``: (v_x, v_y, s, 1/m) in 2D, (v, s, 1/m, 0) in 3D, where s = R·ω.
"""

from __future__ import annotations

import math
from typing import Any

from granufab.kernels.options import compiled

__all__ = [
    "add",
    "axpy",
    "compose",
    "dot",
    "inverse_mass",
    "load",
    "load_tangent",
    "matvec",
    "moment",
    "norm",
    "norm2",
    "scale",
    "shorten",
    "slip",
    "spin",
    "store",
    "store_spin",
    "sub",
    "tangential",
]


def _choose(vector: Any, two: Any, three: Any, one: Any = None) -> Any:
    return {1: one, 2: two, 3: three}[getattr(vector, "count", None) or len(vector)]


def dot(a, b):
    """Scalar product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


@compiled(dot)
def _dot(a, b):
    return _choose(
        a,
        lambda a, b: a[0] * b[0] + a[1] * b[1],
        lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
        lambda a, b: a[0] * b[0],
    )


def norm2(a):
    """Squared length."""
    return dot(a, a)


@compiled(norm2)
def _norm2(a):
    return lambda a: dot(a, a)


def norm(a):
    """Length."""
    return math.sqrt(dot(a, a))


@compiled(norm)
def _norm(a):
    if a.count == 1:
        return lambda a: abs(a[0])
    return lambda a: math.sqrt(dot(a, a))


def add(a, b):
    """a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@compiled(add)
def _add(a, b):
    return _choose(
        a,
        lambda a, b: (a[0] + b[0], a[1] + b[1]),
        lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2]),
        lambda a, b: (a[0] + b[0],),
    )


def sub(a, b):
    """a − b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@compiled(sub)
def _sub(a, b):
    return _choose(
        a,
        lambda a, b: (a[0] - b[0], a[1] - b[1]),
        lambda a, b: (a[0] - b[0], a[1] - b[1], a[2] - b[2]),
        lambda a, b: (a[0] - b[0],),
    )


def scale(s, a):
    """s·a."""
    return tuple(s * x for x in a)


@compiled(scale)
def _scale(s, a):
    return _choose(
        a,
        lambda s, a: (s * a[0], s * a[1]),
        lambda s, a: (s * a[0], s * a[1], s * a[2]),
        lambda s, a: (s * a[0],),
    )


def axpy(s, a, b):
    """s·a + b."""
    return tuple(s * x + y for x, y in zip(a, b, strict=True))


@compiled(axpy)
def _axpy(s, a, b):
    return _choose(
        a,
        lambda s, a, b: (s * a[0] + b[0], s * a[1] + b[1]),
        lambda s, a, b: (s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2]),
        lambda s, a, b: (s * a[0] + b[0],),
    )


def load(array, i, like):
    """Row i of an array with at least D columns, as a vector."""
    return tuple(float(array[i, k]) for k in range(len(like)))


@compiled(load)
def _load(array, i, like):
    return _choose(
        like,
        lambda array, i, like: (array[i, 0], array[i, 1]),
        lambda array, i, like: (array[i, 0], array[i, 1], array[i, 2]),
    )


def load_tangent(array, i, like):
    """Row i of an array of tangential vectors or spins (1 column in 2D, 3 in 3D)."""
    return tuple(float(array[i, k]) for k in range(1 if len(like) == 2 else 3))


@compiled(load_tangent)
def _load_tangent(array, i, like):
    return _choose(
        like,
        lambda array, i, like: (array[i, 0],),
        lambda array, i, like: (array[i, 0], array[i, 1], array[i, 2]),
    )


def store(array, i, a):
    """Write a tuple into the first columns of row i."""
    for k, value in enumerate(a):
        array[i, k] = value


@compiled(store)
def _store(array, i, a):
    def one(array, i, a):
        array[i, 0] = a[0]

    def two(array, i, a):
        array[i, 0] = a[0]
        array[i, 1] = a[1]

    def three(array, i, a):
        array[i, 0] = a[0]
        array[i, 1] = a[1]
        array[i, 2] = a[2]

    return _choose(a, two, three, one)


def spin(motion, i, like):
    """s = R·ω of body i."""
    return (motion[i, 2],) if len(like) == 2 else (motion[i, 3], motion[i, 4], motion[i, 5])


@compiled(spin)
def _spin(motion, i, like):
    return _choose(
        like,
        lambda motion, i, like: (motion[i, 2],),
        lambda motion, i, like: (motion[i, 3], motion[i, 4], motion[i, 5]),
    )


def store_spin(motion, i, s, like):
    """Write s = R·ω of body i."""
    for k, value in enumerate(s):
        motion[i, len(like) + k] = value


@compiled(store_spin)
def _store_spin(motion, i, s, like):
    def two(motion, i, s, like):
        motion[i, 2] = s[0]

    def three(motion, i, s, like):
        motion[i, 3] = s[0]
        motion[i, 4] = s[1]
        motion[i, 5] = s[2]

    return _choose(like, two, three)


def inverse_mass(motion, i, like):
    """1/m of body i (0 for a wall)."""
    return motion[i, 3] if len(like) == 2 else motion[i, 6]


@compiled(inverse_mass)
def _inverse_mass(motion, i, like):
    return _choose(
        like,
        lambda motion, i, like: motion[i, 3],
        lambda motion, i, like: motion[i, 6],
    )


def tangential(u, n, u_n):
    """Part of u in the plane perpendicular to n; u_n = n·u."""
    if len(n) == 2:
        return (n[0] * u[1] - n[1] * u[0],)
    return tuple(x - u_n * y for x, y in zip(u, n, strict=True))


@compiled(tangential)
def _tangential(u, n, u_n):
    return _choose(
        n,
        lambda u, n, u_n: (n[0] * u[1] - n[1] * u[0],),
        lambda u, n, u_n: (u[0] - u_n * n[0], u[1] - u_n * n[1], u[2] - u_n * n[2]),
    )


def slip(s, n):
    """s×n in the tangent plane: the surface velocity of a spinning grain."""
    if len(n) == 2:
        return (s[0],)
    return (
        s[1] * n[2] - s[2] * n[1],
        s[2] * n[0] - s[0] * n[2],
        s[0] * n[1] - s[1] * n[0],
    )


@compiled(slip)
def _slip(s, n):
    return _choose(
        n,
        lambda s, n: (s[0],),
        lambda s, n: (
            s[1] * n[2] - s[2] * n[1],
            s[2] * n[0] - s[0] * n[2],
            s[0] * n[1] - s[1] * n[0],
        ),
    )


def moment(n, p_t):
    """n×P for a tangential impulse."""
    if len(n) == 2:
        return (p_t[0],)
    return slip(n, p_t)


@compiled(moment)
def _moment(n, p_t):
    return _choose(n, lambda n, p_t: (p_t[0],), lambda n, p_t: slip(n, p_t))


def compose(n, p_n, p_t):
    """P = P_n n + P_t as a vector in global axes."""
    if len(n) == 2:
        return (p_n * n[0] - p_t[0] * n[1], p_n * n[1] + p_t[0] * n[0])
    return tuple(p_n * x + y for x, y in zip(n, p_t, strict=True))


@compiled(compose)
def _compose(n, p_n, p_t):
    return _choose(
        n,
        lambda n, p_n, p_t: (p_n * n[0] - p_t[0] * n[1], p_n * n[1] + p_t[0] * n[0]),
        lambda n, p_n, p_t: (p_n * n[0] + p_t[0], p_n * n[1] + p_t[1], p_n * n[2] + p_t[2]),
    )


def matvec(matrix, a):
    """Matrix (D, D) times vector."""
    return tuple(sum(matrix[k, l] * a[l] for l in range(len(a))) for k in range(len(a)))


@compiled(matvec)
def _matvec(matrix, a):
    return _choose(
        a,
        lambda matrix, a: (
            matrix[0, 0] * a[0] + matrix[0, 1] * a[1],
            matrix[1, 0] * a[0] + matrix[1, 1] * a[1],
        ),
        lambda matrix, a: (
            matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
            matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
            matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
        ),
    )


def shorten(a, longest):
    """A tangential vector, cut to a length."""
    return scale(min(1.0, longest / max(norm(a), 1e-300)), a)


@compiled(shorten)
def _shorten(a, longest):
    if a.count == 1:
        return lambda a, longest: (min(max(a[0], -1.0 * longest), longest),)
    return lambda a, longest: scale(min(1.0, longest / max(norm(a), 1e-300)), a)
