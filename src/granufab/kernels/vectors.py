"""Small vectors as tuples: the only file that knows the dimension.

A vector is a tuple of D floats; a spin, and whatever lies in the tangent plane, is a 1-tuple in
2D (component along t = (−n_y, n_x)) and a 3-tuple in 3D (global axes, perpendicular to n). The
length of the tuple is part of its type, so one kernel text compiles to hand-written 2D and 3D
code; ``like`` arguments carry the dimension into loads. All are traced: kernels run the plain text
once, when they are compiled.

Bodies are rows of ``motion``: (v_x, v_y, s, 1/m) in 2D, (v, s, 1/m, 0) in 3D, where s = R·ω.
"""

from __future__ import annotations

from granufab.kernels.tracing import larger, root, smaller, traced

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


@traced
def dot(a, b):
    """Scalar product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


@traced
def norm2(a):
    """Squared length."""
    return dot(a, a)


@traced
def norm(a):
    """Length."""
    return abs(a[0]) if len(a) == 1 else root(dot(a, a))


@traced
def add(a, b):
    """a + b."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


@traced
def sub(a, b):
    """a − b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


@traced
def scale(s, a):
    """s·a."""
    return tuple(s * x for x in a)


@traced
def axpy(s, a, b):
    """s·a + b."""
    return tuple(s * x + y for x, y in zip(a, b, strict=True))


@traced
def load(array, i, like):
    """Row i of an array with at least D columns, as a vector."""
    return tuple(array[i, k] for k in range(len(like)))


@traced
def load_tangent(array, i, like):
    """Row i of an array of tangential vectors or spins (1 column in 2D, 3 in 3D)."""
    return tuple(array[i, k] for k in range(1 if len(like) == 2 else 3))


@traced
def store(array, i, a):
    """Write a tuple into the first columns of row i."""
    for k, value in enumerate(a):
        array[i, k] = value


@traced
def spin(motion, i, like):
    """s = R·ω of body i."""
    return (motion[i, 2],) if len(like) == 2 else (motion[i, 3], motion[i, 4], motion[i, 5])


@traced
def store_spin(motion, i, s, like):
    """Write s = R·ω of body i."""
    for k, value in enumerate(s):
        motion[i, len(like) + k] = value


@traced
def inverse_mass(motion, i, like):
    """1/m of body i (0 for a wall)."""
    return motion[i, 3] if len(like) == 2 else motion[i, 6]


@traced
def tangential(u, n, u_n):
    """Part of u in the plane perpendicular to n; u_n = n·u."""
    if len(n) == 2:
        return (n[0] * u[1] - n[1] * u[0],)
    return tuple(x - u_n * y for x, y in zip(u, n, strict=True))


@traced
def slip(s, n):
    """s×n in the tangent plane: the surface velocity of a spinning grain."""
    if len(n) == 2:
        return (s[0],)
    return (
        s[1] * n[2] - s[2] * n[1],
        s[2] * n[0] - s[0] * n[2],
        s[0] * n[1] - s[1] * n[0],
    )


@traced
def moment(n, p_t):
    """n×P for a tangential impulse."""
    if len(n) == 2:
        return (p_t[0],)
    return slip(n, p_t)


@traced
def compose(n, p_n, p_t):
    """P = P_n n + P_t as a vector in global axes."""
    if len(n) == 2:
        return (p_n * n[0] - p_t[0] * n[1], p_n * n[1] + p_t[0] * n[0])
    return tuple(p_n * x + y for x, y in zip(n, p_t, strict=True))


@traced
def matvec(matrix, a):
    """Matrix (D, D) times vector."""
    return tuple(sum(matrix[k, l] * a[l] for l in range(len(a))) for k in range(len(a)))


@traced
def shorten(a, longest):
    """A tangential vector, cut to a length."""
    if len(a) == 1:
        return (smaller(larger(a[0], -longest), longest),)
    return scale(smaller(1.0, longest / larger(root(dot(a, a)), 1e-300)), a)
