"""The contacts of a solve, packed in the order of the sweep for one stream through memory.

Eight contacts that share no body form a batch: field f of lane k of batch b is
slots[(b·fields + f)·8 + k]. A batch that could not be filled ends with empty lanes on a spare
body, the last row of ``bodies``. Batches come in chunks: grains that lie together, whose inner
contacts touch no other chunk, and last the contacts between chunks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.access import address, put, put_tangent, set_item, take, take_tangent
from granufab.kernels.cell import cell_weight
from granufab.kernels.lanes import WIDTH
from granufab.kernels.memory import empty, unlinked, zeros
from granufab.kernels.options import kernel, part
from granufab.kernels.problem import Problem
from granufab.kernels.tracing import larger, smaller, traced
from granufab.kernels.vectors import inverse_mass, load, load_tangent, store

__all__ = ["Slots", "fields", "pack", "places", "schedule", "unpack"]

BLOCK, LEAP = 256, 331  # a prime beyond the block: every contact is visited once


class Slots(NamedTuple):
    """Packed contacts.

    Attributes:
        values: numbers of all batches, shape (batch_count·fields·8,).
        first, second: bodies i, j, shape (batch_count·8,), unsigned.
        starts: first batch of every chunk, of the contacts between chunks, and the end, shape
            (chunk_count + 2,).
    """

    values: np.ndarray
    first: np.ndarray
    second: np.ndarray
    starts: np.ndarray


class Places(NamedTuple):
    """Where the fields of a contact begin.

    inverse_n, inverse_t hold 1/(W_nn + ε), 1/(W_tt + ε) with the cell's share; where normal and
    tangent couple (2D, stress-driven shape of the cell) they hold W_nn + ε, W_tt + ε themselves
    and cross holds W_nt.
    """

    normal: int
    length: int
    offset_n: int
    offset_t: int
    mu: int
    inverse_n: int
    inverse_t: int
    impulse_n: int
    impulse_t: int
    before_n: int
    before_t: int
    cross: int


@traced
def places(like):
    """Where the fields begin; ``like`` is a tuple of D zeros, numbers or lanes."""
    return (
        Places(0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)
        if len(like) == 2
        else Places(0, 3, 4, 5, 8, 9, 10, 11, 12, 15, 16, 19)
    )


@kernel
def fields(like, coupled):
    """Numbers that a contact takes."""
    cross = places(like).cross
    return cross + 1 if coupled and len(like) == 2 else cross


@kernel
def schedule(first, second, grain_count, chunk, chunk_count, order):
    """Put contacts into batches of eight that share no grain; walls and cells may be shared.

    Blocks of contacts keep their order, so a sweep moves through memory: each contact goes into the
    first batch with room after the last ones of its grains.

    Args:
        first, second: bodies i, j, shape (contact_count,).
        grain_count: bodies from here on (walls) never move.
        chunk: of every body, shape (body_count,).
        chunk_count: number of chunks.
        order: out: slot of every contact, shape (contact_count,).
    Returns:
        First batch of every chunk, of the contacts between chunks, and the end.
    """
    count = len(first)
    starts = zeros((chunk_count + 2,), np.int64)
    heads = zeros((chunk_count + 2,), np.int64)
    for c in range(count):
        heads[_home(chunk, first[c], second[c], grain_count, chunk_count) + 1] += 1
    for k in range(chunk_count + 1):
        heads[k + 1] += heads[k]
    listed = empty((count,), np.int64)
    fill = empty((chunk_count + 2,), np.int64)
    for k in range(len(heads)):
        fill[k] = heads[k]
    for c in range(count):
        home = _home(chunk, first[c], second[c], grain_count, chunk_count)
        listed[fill[home]] = c
        fill[home] += 1
    last = unlinked((grain_count,), np.int64)
    taken = zeros((count + 1,), np.int64)
    low, top = 0, 0
    for k in range(chunk_count + 1):
        starts[k], low = top, top
        for at in range(heads[k], heads[k + 1]):
            c = listed[_mixed(at, heads[k], heads[k + 1])]
            i, j = first[c], second[c]
            batch = larger(low, last[i] + 1)
            if j < grain_count:
                batch = larger(batch, last[j] + 1)
            while taken[batch] == WIDTH:
                batch += 1
            order[c] = batch * WIDTH + taken[batch]
            taken[batch] += 1
            last[i] = batch
            if j < grain_count:
                last[j] = batch
            top = larger(top, batch + 1)
            while taken[low] == WIDTH:
                low += 1
    starts[chunk_count + 1] = top
    return starts


@part
def _mixed(at, head, end):
    """Visit each block in leaps: contacts in a row share grains and would have to queue."""
    start = head + (at - head) // BLOCK * BLOCK
    size = smaller(BLOCK, end - start)
    return start + (at - start) * LEAP % size


@part
def _home(chunk, i, j, grain_count, chunk_count):
    """Chunk of a contact, or chunk_count for one between chunks."""
    if j >= grain_count or chunk[i] == chunk[j]:
        return chunk[i]
    return chunk_count


@kernel
def pack(problem: Problem, motion, impulse_n, impulse_t, order, slots: Slots, like):
    """Fill the slots with the problem and its impulses; empty lanes get an open contact."""
    size = fields(like, problem.coupled) * WIDTH
    at = places(like)
    spare = len(motion) - 1
    for slot in range(slots.starts[-1] * WIDTH):
        slots.first[slot], slots.second[slot] = spare, spare
    for k in range(slots.starts[-1] * size):
        slots.values[k] = 0.0
    values, weight = address(slots.values), address(problem.weight)
    eps, kappa = problem.softness, problem.spin_factor
    for c in range(len(order)):
        slot = order[c]
        base = slot // WIDTH * size + slot % WIDTH
        i, j = problem.first[c], problem.second[c]
        slots.first[slot], slots.second[slot] = i, j
        n, length = load(problem.normal, c, like), problem.length[c]
        offset = (problem.offset_n[c], load_tangent(problem.offset_t, c, like))
        impulse = (impulse_n[c], load_tangent(impulse_t, c, like))
        _write(values, base, n, length, problem.mu[c], offset, impulse)
        mass = inverse_mass(motion, i, like) + inverse_mass(motion, j, like)
        w_n, w_t = mass + eps, mass + kappa * mass + eps
        if problem.coupled:
            _write_coupled(values, base, weight, n, length, w_n, w_t)
        else:
            w_n += length * length * problem.dilation_weight
            set_item(values, base + WIDTH * at.inverse_n, 1.0 / w_n)
            set_item(values, base + WIDTH * at.inverse_t, 1.0 / w_t)
    _fill_empty(slots, size, at, spare)


@traced
def _write(values, base, n, length, mu, offset, impulse):
    """What a contact has whatever the cell is free to do; it starts without momentum."""
    at = places(n)
    put_tangent(values, base, at.normal, n)
    put(values, base, at.length, length)
    put(values, base, at.offset_n, offset[0])
    put_tangent(values, base, at.offset_t, offset[1])
    put(values, base, at.mu, mu)
    for first_n, first_t in ((at.impulse_n, at.impulse_t), (at.before_n, at.before_t)):
        put(values, base, first_n, impulse[0])
        put_tangent(values, base, first_t, impulse[1])


@traced
def _write_coupled(values, base, weight, n, length, w_n, w_t):
    """W_nn + ε, W_tt + ε with the share of a cell free to change its shape, see :class:`Places`."""
    at = places(n)
    extra_n, extra_nt, extra_t = cell_weight(weight, n, length)
    w_n, w_t = w_n + extra_n, w_t + extra_t
    crossed = len(n) == 2
    put(values, base, at.inverse_n, w_n if crossed else 1.0 / w_n)
    put(values, base, at.inverse_t, w_t if crossed else 1.0 / w_t)
    if crossed:
        put(values, base, at.cross, extra_nt)


@part
def _fill_empty(slots: Slots, size, at, spare):
    for slot in range(slots.starts[-1] * WIDTH):
        if slots.first[slot] == spare:
            base = slot // WIDTH * size + slot % WIDTH
            slots.values[base + WIDTH * at.offset_n] = 1.0
            slots.values[base + WIDTH * at.inverse_n] = 1.0
            slots.values[base + WIDTH * at.inverse_t] = 1.0


@kernel
def unpack(slots: Slots, size, order, impulse_n, impulse_t, like):
    """Write the impulses of the slots back, in the order of the problem."""
    at, values = places(like), address(slots.values)
    for c in range(len(order)):
        slot = order[c]
        base = slot // WIDTH * size + slot % WIDTH
        impulse_n[c] = take(values, base, at.impulse_n, like)
        store(impulse_t, c, take_tangent(values, base, at.impulse_t, like))
