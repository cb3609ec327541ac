"""Where the candidate pairs stand at the midpoint, and which of them take part in the solve."""

from __future__ import annotations

from granufab.kernels.options import part
from granufab.kernels.step_arrays import (
    MATRIX,
    RATE,
    Bodies,
    Box,
    Notes,
    Pairs,
    StepLaw,
    piece_of,
)
from granufab.kernels.tracing import root, smaller
from granufab.kernels.vectors import (
    add,
    dot,
    load,
    load_tangent,
    matvec,
    norm,
    norm2,
    scale,
    store,
    sub,
    tangential,
)

__all__ = ["find_missed", "measure_gaps", "survey", "turn_tangents"]


@part
def survey(bodies: Bodies, box: Box, pairs: Pairs, notes: Notes, law: StepLaw, like, piece):
    """Measure a piece of the pairs, keep its springs' memory, mark who takes part."""
    first, end = piece_of(len(pairs.length), piece)
    reach = (first, end)
    measure_gaps(
        bodies.position, bodies.radius, box.tensors[MATRIX], box.origin, pairs.pairs,
        pairs.images, pairs.normal, pairs.length, pairs.gap, reach, like,
    )  # fmt: skip
    if len(like) == 3:
        turn_tangents(pairs.impulse_t, pairs.normal, reach, like)
    smallest = 0.0
    for c in range(first, end):
        smallest = smaller(smallest, pairs.gap[c])
        store(pairs.memory_t, c, load_tangent(pairs.impulse_t, c, like))
    notes.partial[piece, 1] = smallest
    _select(bodies.motion, pairs, box.tensors[RATE], law, reach, like)


@part
def measure_gaps(
    position, radius, matrix, origin, pairs, images, normal, length, gap, reach, like
):  # fmt: skip
    """Normal, branch length and gap of candidate pairs at the present positions.

    Pairs whose second index is N + w join a grain with wall w = 2·axis + side; there the length
    runs from the centre to the wall.

    Args:
        position, radius: of the N grains [m].
        matrix, origin: of the cell [m].
        pairs, images: of the candidates.
        normal, length, gap: out.
        reach: (first pair, end).
        like: tuple of D zeros.
    """
    grain_count = len(position)
    for c in range(reach[0], reach[1]):
        i, j = pairs[c, 0], pairs[c, 1]
        if j >= grain_count:
            axis, side = (j - grain_count) // 2, (j - grain_count) % 2
            for k in range(len(like)):
                normal[c, k] = 0.0
            if side == 0:
                normal[c, axis] = -1.0
                length[c] = position[i, axis] - origin[axis]
            else:
                normal[c, axis] = 1.0
                length[c] = origin[axis] + matrix[axis, axis] - position[i, axis]
            gap[c] = length[c] - radius[i]
            continue
        branch = sub(load(position, j, like), load(position, i, like))
        branch = add(branch, matvec(matrix, load(images, c, like)))
        distance = norm(branch)
        length[c] = distance
        gap[c] = distance - radius[i] - radius[j]
        store(normal, c, scale(1.0 / distance, branch))


@part
def turn_tangents(impulse_t, normal, reach, like):
    """Turn 3D tangential impulses into the new tangent planes, keeping their lengths."""
    for c in range(reach[0], reach[1]):
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


@part
def _select(motion, pairs: Pairs, rate, law: StepLaw, reach, like):
    """Mark pairs that carried an impulse or could close within the step.

    A pair is marked if its gap is below margin + h(|c_i| + |c_j| + |L|·|gap|); with restitution,
    where contacts act only when closed, if it is closed.
    """
    square = 0.0
    for k in range(len(rate)):
        for l in range(len(rate)):
            square += rate[k, l] ** 2
    stretch = law.step * root(square)
    for c in range(reach[0], reach[1]):
        gap = pairs.gap[c]
        if law.restitution > 0.0:
            pairs.active[c] = gap <= law.touching
            continue
        if pairs.impulse_n[c] > 0.0 or gap < law.margin:
            pairs.active[c] = True
            continue
        c_i = norm(load(motion, pairs.pairs[c, 0], like))
        c_j = norm(load(motion, pairs.pairs[c, 1], like))
        pairs.active[c] = gap < law.margin + law.step * (c_i + c_j) + stretch * abs(gap)


@part
def find_missed(pairs: Pairs, motion, rate, law: StepLaw, like, piece):
    """Switch on pairs left out of the solve that would overlap by its end; returns how many."""
    first, end = piece_of(len(pairs.length), piece)
    missed = 0
    for c in range(first, end):
        if pairs.active[c]:
            continue
        n = load(pairs.normal, c, like)
        i, j = pairs.pairs[c, 0], pairs.pairs[c, 1]
        u = sub(load(motion, j, like), load(motion, i, like))
        u_n = dot(n, u) + pairs.length[c] * dot(n, matvec(rate, n))
        if pairs.gap[c] + law.step * u_n < -law.missed:
            pairs.active[c] = True
            missed += 1
    return missed
