"""Small vectors as tuples against numpy: plain and compiled, in the plane and in space."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from granufab.kernels import vectors as v
from granufab.kernels.access import address
from granufab.kernels.cell import add_outer, cell_weight

dot, norm, norm2, add, sub, scale, axpy = v.dot, v.norm, v.norm2, v.add, v.sub, v.scale, v.axpy
matvec, tangential, slip, moment, compose = v.matvec, v.tangential, v.slip, v.moment, v.compose
load, load_tangent, store, spin, store_spin = v.load, v.load_tangent, v.store, v.spin, v.store_spin
inverse_mass = v.inverse_mass

LOADED = ("plain", "compiled")


@njit
def _algebra(a, b, n, matrix):
    u_n = dot(a, n)
    return (
        dot(a, b),
        norm(a),
        norm2(a),
        add(a, b),
        sub(a, b),
        scale(1.5, a),
        axpy(-0.5, a, b),
        matvec(matrix, a),
        tangential(a, n, u_n),
    )


@njit
def _contact(s, p_t, n, weight, target):
    push = compose(n, 0.7, p_t)
    add_outer(address(target), address(weight), push, n)
    return (
        slip(s, n),
        moment(n, p_t),
        push,
        cell_weight(address(weight), n, 1.3),
        norm(p_t),
        add(s, p_t),
        sub(s, p_t),
        scale(2.0, s),
        axpy(0.5, s, p_t),
    )


@njit
def _bodies(motion, tangents, like):
    first, turning = load(motion, 0, like), spin(motion, 0, like)
    store(motion, 1, scale(2.0, first))
    store_spin(motion, 1, scale(3.0, turning), like)
    push = load_tangent(tangents, 0, like)
    store(tangents, 1, scale(-1.0, push))
    return first, turning, push, inverse_mass(motion, 0, like)


@pytest.fixture(params=LOADED)
def as_run(request):
    """The kernel as plain Python text, or compiled."""
    if request.param == "plain":
        return lambda function: getattr(function, "py_func", function)
    return lambda function: function


def _directions(dimension):
    generator = np.random.default_rng(dimension)
    a, b, n = generator.standard_normal((3, dimension))
    n /= np.linalg.norm(n)
    return generator, a, b, n


def _tuple(vector):
    return tuple(float(x) for x in np.atleast_1d(vector))


@pytest.mark.parametrize("dimension", [2, 3])
def test_algebra(dimension, as_run):
    generator, a, b, n = _directions(dimension)
    matrix = generator.standard_normal((dimension, dimension))
    found = as_run(_algebra)(_tuple(a), _tuple(b), _tuple(n), matrix)
    across = a - (a @ n) * n
    if dimension == 2:
        across = across @ np.array([-n[1], n[0]])
    expected = (
        a @ b,
        np.linalg.norm(a),
        a @ a,
        a + b,
        a - b,
        1.5 * a,
        b - 0.5 * a,
        matrix @ a,
        across,
    )
    for mine, right in zip(found, expected, strict=True):
        assert np.asarray(mine).ravel() == pytest.approx(np.atleast_1d(right), abs=1e-14)


def test_contact_frames_in_space(as_run):
    generator, s, p, n = _directions(3)
    p -= (p @ n) * n
    weight, target = generator.uniform(0, 1, (3, 3)), np.zeros((3, 3))
    found = as_run(_contact)(_tuple(s), _tuple(p), _tuple(n), weight, target)
    push = 0.7 * n + p
    added = np.diag(1.3**2 * weight @ n**2)
    expected = [
        np.cross(s, n),
        np.cross(n, p),
        push,
        (n @ added @ n, 0.0, added.max()),
        np.linalg.norm(p),
    ]
    for mine, right in zip(found[:5], expected, strict=True):
        assert np.asarray(mine).ravel() == pytest.approx(np.atleast_1d(right), abs=1e-14)
    assert target == pytest.approx(weight * np.outer(push, n), abs=1e-15)


def test_contact_frames_in_the_plane(as_run):
    """t = (−n_y, n_x); the cell adds ℓ² Σ w n² per axis to the local 2×2 matrix."""
    generator, _, _, n = _directions(2)
    t = np.array([-n[1], n[0]])
    weight, target = generator.uniform(0, 1, (2, 2)), np.zeros((2, 2))
    found = as_run(_contact)((0.4,), (-0.3,), _tuple(n), weight, target)
    push = 0.7 * n - 0.3 * t
    added = np.diag(1.3**2 * weight @ n**2)
    local = (n @ added @ n, n @ added @ t, t @ added @ t)
    expected = [0.4, -0.3, push, local, 0.3, 0.1, 0.7, 0.8, -0.1]
    for mine, right in zip(found, expected, strict=True):
        assert np.asarray(mine).ravel() == pytest.approx(np.atleast_1d(right), abs=1e-14)
    assert target == pytest.approx(weight * np.outer(push, n), abs=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_body_records(dimension, as_run):
    spins, width = (1, 4) if dimension == 2 else (3, 8)
    generator = np.random.default_rng(0)
    motion, tangents = generator.standard_normal((2, width)), np.ones((2, spins))
    tangents[0] = generator.standard_normal(spins)
    before = motion.copy()
    first, turning, push, inverse = as_run(_bodies)(motion, tangents, (0.0,) * dimension)
    assert np.array(first) == pytest.approx(before[0, :dimension])
    assert np.array(turning) == pytest.approx(before[0, dimension : dimension + spins])
    assert inverse == before[0, dimension + spins]
    assert np.array(push) == pytest.approx(tangents[0])
    assert tangents[1] == pytest.approx(-tangents[0])
    assert np.array_equal(motion[0], before[0])
    assert motion[1, :dimension] == pytest.approx(2 * before[0, :dimension])
    ends = dimension + spins
    assert motion[1, dimension:ends] == pytest.approx(3 * before[0, dimension:ends])
    assert np.array_equal(motion[1, ends:], before[1, ends:])
