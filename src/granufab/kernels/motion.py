"""What contacts and grains do as a whole: relative velocities, virial stress, kinetic energy."""

from __future__ import annotations

from granufab.kernels.impulses import local_velocity
from granufab.kernels.options import kernel, part
from granufab.kernels.problem import Problem
from granufab.kernels.vectors import compose, load, load_tangent, store

__all__ = ["kinetic_energy", "relative_velocity", "virial"]


@kernel
def relative_velocity(problem: Problem, motion, rate, like, out_n, out_t):
    """u of each contact for bodies and the whole velocity gradient ``rate`` [m/s]."""
    for c in range(len(problem.length)):
        u_n, u_t = local_velocity(problem, motion, rate, c, like)
        out_n[c] = u_n
        store(out_t, c, u_t)


@part
def virial(problem: Problem, impulse_n, impulse_t, reach, total, like):
    """Write Σ P⊗ℓ over contacts ``reach`` [N m s] into ``total``, row by row.

    Divided by h V the sum over all contacts is the stress.
    """
    dimension = len(like)
    for k in range(dimension * dimension):
        total[k] = 0.0
    for c in range(reach[0], reach[1]):
        n = load(problem.normal, c, like)
        push = compose(n, impulse_n[c], load_tangent(impulse_t, c, like))
        for k in range(dimension):
            for l in range(dimension):
                total[k * dimension + l] += push[k] * n[l] * problem.length[c]


def kinetic_energy(motion, grain_count, spin_factor, like):
    """Σ ½ m c² + ½ I ω² over the grains [J]."""
    dimension = len(like)
    heavy = dimension + (1 if dimension == 2 else 3)
    grains = motion[:grain_count]
    square = (grains[:, :dimension] ** 2).sum(axis=1)
    if spin_factor > 0.0:
        square += (grains[:, dimension:heavy] ** 2).sum(axis=1) / spin_factor
    return float(0.5 * (square / grains[:, heavy]).sum())
