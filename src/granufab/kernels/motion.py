"""Geometry and motion of one step: contact frames at the midpoint, offsets, drift, missed pairs.

Velocities in ``motion`` are fluctuations c = v − L·r; a grain moves by ṙ = L r + c. The affine
part is applied as exp(h L/2) on each half step, so imposed strains are exact.
"""

from __future__ import annotations

import numpy as np

from granufab.kernels.impulses import local_velocity
from granufab.kernels.memory import empty, zeros
from granufab.kernels.options import kernel
from granufab.kernels.problem import Problem
from granufab.kernels.tracing import larger, root, traced
from granufab.kernels.vectors import (
    add,
    compose,
    dot,
    load,
    load_tangent,
    matvec,
    norm2,
    scale,
    store,
    sub,
    tangential,
)

__all__ = [
    "accumulate_drift",
    "drift",
    "find_missed",
    "kinetic_energy",
    "measure_gaps",
    "relative_velocity",
    "set_offsets",
    "turn_tangents",
    "virial",
]


@kernel
def drift(position, motion, affine, half_step):
    """r ← exp(h L/2) r + (h/2) c for every grain; ``affine`` is exp(h L/2)."""
    dimension = position.shape[1]
    moved = empty((dimension,), np.float64)
    for i in range(len(position)):
        for k in range(dimension):
            x = half_step * motion[i, k]
            for l in range(dimension):
                x += affine[k, l] * position[i, l]
            moved[k] = x
        for k in range(dimension):
            position[i, k] = moved[k]


@kernel
def accumulate_drift(walked, motion, step):
    """Add h·c to each grain's non-affine displacement; returns the largest length so far."""
    dimension = walked.shape[1]
    largest = 0.0
    for i in range(len(walked)):
        square = 0.0
        for k in range(dimension):
            walked[i, k] += step * motion[i, k]
            square += walked[i, k] ** 2
        largest = larger(largest, square)
    return root(largest)


@kernel
def measure_gaps(position, radius, matrix, origin, pairs, images, grain_count, normal, length, gap):
    """Normal, branch length and gap of every candidate pair at the present positions.

    Pairs whose second index is ``grain_count`` + w join a grain with wall w; there the length
    runs from the centre to the wall.
    """
    dimension = position.shape[1]
    for c in range(len(pairs)):
        i, j = pairs[c, 0], pairs[c, 1]
        if j >= grain_count:
            axis, side = (j - grain_count) // 2, (j - grain_count) % 2
            for k in range(dimension):
                normal[c, k] = 0.0
            if side == 0:
                normal[c, axis] = -1.0
                length[c] = position[i, axis] - origin[axis]
            else:
                normal[c, axis] = 1.0
                length[c] = origin[axis] + matrix[axis, axis] - position[i, axis]
            gap[c] = length[c] - radius[i]
            continue
        square = 0.0
        for k in range(dimension):
            x = position[j, k] - position[i, k]
            for l in range(dimension):
                x += matrix[k, l] * images[c, l]
            normal[c, k] = x
            square += x * x
        distance = root(square)
        length[c] = distance
        gap[c] = distance - radius[i] - radius[j]
        for k in range(dimension):
            normal[c, k] /= distance


@kernel
def relative_velocity(problem: Problem, motion, rate, like, out_n, out_t):
    """u of each contact for bodies and the whole velocity gradient ``rate`` [m/s]."""
    for c in range(len(problem.length)):
        u_n, u_t = local_velocity(problem, motion, rate, c, like)
        out_n[c] = u_n
        store(out_t, c, u_t)


@kernel
def set_offsets(problem: Problem, gap, imposed, bounce, law, old_t, like):
    """Fill the velocity offsets b_n, b_t of the step.

    Rigid: max(g, 0)/h + β min(g, 0)/h, or the bounce e·u_n⁻ with restitution; compliant: g/h of
    both signs, and −ε P_t,old for the tangential spring; plus the imposed flow L ℓ.

    Args:
        gap: at the midpoint [m].
        imposed: imposed part of L, shape (D, D).
        bounce: e·u_n⁻ per contact [m/s], used where e > 0.
        law: (h, β, e).
        old_t: tangential impulses of the previous step, in the present frame.
        like: tuple of D zeros.
    """
    step, beta, restitution = law
    for c in range(len(problem.length)):
        n = load(problem.normal, c, like)
        u = scale(problem.length[c], matvec(imposed, n))
        u_n = dot(n, u)
        u_t = tangential(u, n, u_n)
        if restitution > 0.0:
            u_n += bounce[c]
        elif problem.softness > 0.0 or gap[c] > 0.0:
            u_n += gap[c] / step
        else:
            u_n += beta * gap[c] / step
        problem.offset_n[c] = u_n
        memory = scale(-problem.softness, load_tangent(old_t, c, like))
        store(problem.offset_t, c, add(u_t, memory))


@kernel
def find_missed(pairs, normal, length, gap, active, motion, total_rate, step, tolerance, like):
    """Switch on pairs left out of the solve that would overlap by its end; returns how many."""
    missed = 0
    for c in range(len(pairs)):
        if active[c]:
            continue
        n = load(normal, c, like)
        u = sub(load(motion, pairs[c, 1], like), load(motion, pairs[c, 0], like))
        u_n = dot(n, u) + length[c] * dot(n, matvec(total_rate, n))
        if gap[c] + step * u_n < -tolerance:
            active[c] = True
            missed += 1
    return missed


@kernel
def virial(problem: Problem, impulse_n, impulse_t, like):
    """Σ P⊗ℓ over contacts [N m s], shape (D, D); divided by h V it is the stress."""
    dimension = len(like)
    total = zeros((dimension, dimension), np.float64)
    for c in range(len(problem.length)):
        n = load(problem.normal, c, like)
        push = compose(n, impulse_n[c], load_tangent(impulse_t, c, like))
        _add_product(total, push, scale(problem.length[c], n))
    return total


@traced
def _add_product(total, a, b):
    """total += a⊗b."""
    for k, x in enumerate(a):
        for l, y in enumerate(b):
            total[k, l] += x * y


@kernel
def kinetic_energy(motion, grain_count, spin_factor, like):
    """Σ ½ m c² + ½ I ω² over the grains [J]."""
    total = 0.0
    heavy = len(like) + (1 if len(like) == 2 else 3)
    for i in range(grain_count):
        square = norm2(load(motion, i, like))
        turning = 0.0
        for k in range(len(like), heavy):
            turning += motion[i, k] ** 2
        if spin_factor > 0.0:
            square += turning / spin_factor
        total += 0.5 * square / motion[i, heavy]
    return total


@kernel
def turn_tangents(impulse_t, normal, like):
    """Turn 3D tangential impulses into the new tangent planes, keeping their lengths."""
    for c in range(len(impulse_t)):
        before = load_tangent(impulse_t, c, like)
        size = norm2(before)
        if size == 0.0:
            continue
        n = load(normal, c, like)
        turned = tangential(before, n, dot(n, before))
        kept = norm2(turned)
        if kept > 0.0:
            store(impulse_t, c, scale(root(size / kept), turned))
        else:
            store(impulse_t, c, scale(0.0, before))
