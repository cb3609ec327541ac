"""Packing contacts into batches of eight that share no grain, and into chunks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granufab.kernels.lanes import WIDTH
from granufab.kernels.schedule import Plan, schedule


def _check(first, second, grains, chunk, chunk_count):
    plan = Plan.of(chunk[:grains], chunk_count, len(first))
    assert schedule(plan, first, second) == plan.starts[-1]
    starts, order = plan.starts, np.empty(len(first), np.int64)
    for k in range(chunk_count + 1):
        own = plan.listed[plan.heads[k] : plan.heads[k + 1]]
        assert (np.diff(own) > 0).all()
        order[own] = plan.order[own] + starts[k] * WIDTH
    assert len(set(order.tolist())) == len(first)
    assert starts[0] == 0
    assert (np.diff(starts) >= 0).all()
    batch = order // WIDTH
    for number in range(starts[-1]):
        here = np.flatnonzero(batch == number)
        ends = np.concatenate([first[here], second[here]])
        moving = ends[ends < grains]
        assert len(set(moving.tolist())) == len(moving)
    for number in range(chunk_count):
        inside = (batch >= starts[number]) & (batch < starts[number + 1])
        ends = np.concatenate([first[inside], second[inside]])
        assert set(chunk[ends[ends < grains]].tolist()) <= {number}
    between = batch >= starts[chunk_count]
    assert (chunk[first[between]] != chunk[second[between]]).all()
    return order, starts


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 10**6), st.integers(0, 80), st.integers(2, 15), st.integers(1, 4))
def test_batches_share_no_grain_and_chunks_keep_apart(seed, count, grains, chunks):
    generator = np.random.default_rng(seed)
    first = generator.integers(0, grains, count).astype(np.int32)
    second = ((first + generator.integers(1, grains, count)) % grains).astype(np.int32)
    wall = generator.random(count) < 0.1
    second[wall] = grains + generator.integers(0, 4, int(wall.sum()))
    _check(first, second, grains, generator.integers(0, chunks, grains), chunks)


@pytest.mark.parametrize("chunks", [1, 4])
def test_a_packing_leaves_few_places_empty(chunks):
    """Contacts of a triangular lattice, row by row."""
    side = 40
    grain = np.arange(side * side)
    x, y = grain % side, grain // side
    pairs = [
        (grain, (x + dx) % side + (y + dy) % side * side) for dx, dy in ((1, 0), (0, 1), (1, 1))
    ]
    first = np.stack([p[0] for p in pairs], 1).ravel().astype(np.int32)
    second = np.stack([p[1] for p in pairs], 1).ravel().astype(np.int32)
    _, starts = _check(first, second, len(grain), y * chunks // side, chunks)
    assert starts[-1] * WIDTH < 1.03 * len(first)


def test_a_contact_comes_after_the_last_ones_of_its_grains():
    """A chain visited along itself: each link one batch after the one before."""
    first = np.arange(10, dtype=np.int32)
    order, _ = _check(first, first + 1, 11, np.zeros(11, np.int64), 1)
    assert (np.diff(order // WIDTH) == 1).all()
