"""The order of the sweep: batches of eight contacts that share no grain, in chunks.

Every chunk is arranged by itself, so that threads can share them; the contacts between chunks
come last. Nothing is allocated: ``Plan`` is memory for the largest problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granufab.kernels.lanes import WIDTH
from granufab.kernels.options import kernel, part
from granufab.kernels.step_arrays import PIECES
from granufab.kernels.tracing import larger, smaller

__all__ = ["Plan", "arrange_chunk", "home_of", "list_homes", "place_chunks", "schedule"]

BLOCK, LEAP = 256, 331  # a prime beyond the block: every contact is visited once


class Plan(NamedTuple):
    """Contacts by chunk.

    Attributes:
        chunk: of every grain, shape (N,).
        heads: first listed contact of every chunk, of those between chunks, and the end, shape
            (chunk_count + 2,).
        listed: contacts by chunk, each chunk's in increasing order, shape (capacity,).
        order: slot of every contact, counted from its chunk's first batch, shape (capacity,).
        starts: first batch of every chunk, of those between chunks, and the end, as heads.
        taken: filled places of every batch; chunk k's begin at heads[k] + k.
        last: batch of a grain's last contact, shape (N,).
        tally: contacts by piece and chunk, then where a piece lists them, shape
            (PIECES, chunk_count + 1).
        numbers: first contact of every piece, and the end, shape (PIECES + 1,).
    """

    chunk: np.ndarray
    heads: np.ndarray
    listed: np.ndarray
    order: np.ndarray
    starts: np.ndarray
    taken: np.ndarray
    last: np.ndarray
    tally: np.ndarray
    numbers: np.ndarray

    @staticmethod
    def of(chunk: np.ndarray, chunk_count: int, capacity: int) -> Plan:
        """Memory for ``capacity`` contacts of grains in these chunks."""
        return Plan(
            chunk=chunk,
            heads=np.zeros(chunk_count + 2, np.int64),
            listed=np.zeros(capacity, np.int64),
            order=np.zeros(capacity, np.int64),
            starts=np.zeros(chunk_count + 2, np.int64),
            taken=np.zeros(capacity + chunk_count + 2, np.int64),
            last=np.zeros(len(chunk), np.int64),
            tally=np.zeros((PIECES, chunk_count + 1), np.int64),
            numbers=np.zeros(PIECES + 1, np.int64),
        )


@part
def home_of(chunk, i, j):
    """Chunk of a contact of body i and body j (a wall: any from N on), or −1 between chunks."""
    if j >= len(chunk) or chunk[i] == chunk[j]:
        return chunk[i]
    return -1


@part
def list_homes(plan: Plan):
    """From the tallies: where each piece lists its contacts, and how many there are."""
    homes = plan.tally.shape[1]
    count = 0
    for piece in range(PIECES):
        plan.numbers[piece] = count
        for home in range(homes):
            count += plan.tally[piece, home]
    plan.numbers[PIECES] = count
    at = 0
    for home in range(homes):
        plan.heads[home] = at
        for piece in range(PIECES):
            here = plan.tally[piece, home]
            plan.tally[piece, home] = at
            at += here
    plan.heads[homes] = at
    return count


@part
def arrange_chunk(plan: Plan, first, second, home):
    """Put a chunk's contacts into batches that share no grain; walls and cells may be shared.

    Blocks of contacts keep their order, so a sweep moves through memory: each contact goes into
    the first batch with room after the last ones of its grains. The number of batches is left in
    ``starts[home + 1]`` until :func:`place_chunks`. ``last`` holds −1 for all grains before.
    """
    grain_count, head, end = len(plan.last), plan.heads[home], plan.heads[home + 1]
    taken = plan.taken[head + home :]
    for k in range(end - head + 1):
        taken[k] = 0
    if home == len(plan.heads) - 2:  # between chunks: these grains had batches in their own
        for at in range(head, end):
            plan.last[first[plan.listed[at]]] = -1
            plan.last[second[plan.listed[at]]] = -1
    low, top = 0, 0
    for at in range(head, end):
        c = plan.listed[_mixed(at, head, end)]
        i, j = first[c], second[c]
        batch = larger(low, plan.last[i] + 1)
        if j < grain_count:
            batch = larger(batch, plan.last[j] + 1)
        while taken[batch] == WIDTH:
            batch += 1
        plan.order[c] = batch * WIDTH + taken[batch]
        taken[batch] += 1
        plan.last[i] = batch
        if j < grain_count:
            plan.last[j] = batch
        top = larger(top, batch + 1)
        while taken[low] == WIDTH:
            low += 1
    plan.starts[home + 1] = top


@part
def _mixed(at, head, end):
    """Visit each block in leaps: contacts in a row share grains and would have to queue."""
    start = head + (at - head) // BLOCK * BLOCK
    size = smaller(BLOCK, end - start)
    return start + (at - start) * LEAP % size


@part
def place_chunks(plan: Plan):
    """One chunk's batches after the other's; returns how many there are."""
    plan.starts[0] = 0
    for k in range(1, len(plan.starts)):
        plan.starts[k] += plan.starts[k - 1]
    return plan.starts[-1]


@kernel
def schedule(plan: Plan, first, second):
    """Arrange all of these contacts, by one thread; ``order`` then counts from the first batch.

    Args:
        plan: memory for as many contacts, at least.
        first, second: bodies i, j, shape (contact_count,).
    Returns:
        Number of batches.
    """
    between = len(plan.heads) - 2
    for piece in range(PIECES):
        for home in range(between + 1):
            plan.tally[piece, home] = 0
    for i in range(len(plan.last)):
        plan.last[i] = -1
    for c in range(len(first)):
        plan.tally[0, home_of(plan.chunk, first[c], second[c])] += 1
    list_homes(plan)
    for c in range(len(first)):
        home = home_of(plan.chunk, first[c], second[c])
        plan.listed[plan.tally[0, home]] = c
        plan.tally[0, home] += 1
    for home in range(between + 1):
        arrange_chunk(plan, first, second, home)
    return place_chunks(plan)
