"""Neighbour search against all pairs and images; orders of grains and contacts."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from granufab.kernels.insertion import insert_randomly
from granufab.kernels.neighbours import (
    bin_counts,
    find_pairs,
    find_wall_pairs,
    morton_order,
)

SKIN = 0.2


def _all_pairs(position, radius, matrix, periodic, skin, span=3):
    """Every (i, j, image) with i < j within reach, tried one by one."""
    dimension = position.shape[1]
    images = [
        image
        for image in product(range(-span, span + 1), repeat=dimension)
        if all(p or m == 0 for p, m in zip(periodic, image, strict=True))
    ]
    images = np.array(images)
    inverse = np.linalg.inv(matrix)
    found = set()
    for i in range(len(position)):
        for j in range(i + 1, len(position)):
            apart = position[j] - position[i]
            nearest = -np.round(inverse @ apart).astype(int) * np.array(periodic)
            tried = images + nearest
            distance = np.linalg.norm(apart + tried @ matrix.T, axis=1)
            for image in tried[distance < radius[i] + radius[j] + skin]:
                found.add((i, j, *(int(m) for m in image)))
    return found


def _found_pairs(position, radius, matrix, periodic, skin, origin):
    cell = (matrix, origin, np.array(periodic))
    pairs, images = find_pairs(position, radius, cell, skin)
    count = len(pairs)
    rows = np.column_stack([pairs, images])
    unique = {tuple(int(x) for x in row) for row in rows}
    assert len(unique) == count, "a pair is listed twice"
    return unique


CELLS = {
    "square": ([[8.0, 0], [0, 8.0]], (True, True)),
    "tilted": ([[8.0, 3.9], [0, 6.0]], (True, True)),
    "tilted backwards, flat": ([[9.0, -4.0], [0, 3.5]], (True, True)),
    "general": ([[7.0, 1.0], [-2.0, 6.0]], (True, True)),
    "three bins wide": ([[4.3, 0], [0, 9.0]], (True, True)),
    "two bins wide": ([[3.4, 0], [0, 9.0]], (True, True)),
    "tiny": ([[1.6, 0.2], [0, 1.7]], (True, True)),
    "walls": ([[8.0, 0], [0, 5.0]], (False, False)),
    "walls on one axis": ([[8.0, 0], [0, 5.0]], (True, False)),
    "cube": (np.eye(3) * 4.5, (True, True, True)),
    "sheared cube": ([[4.4, 2.0, 0], [0, 4.4, -1.5], [0, 0, 4.4]], (True, True, True)),
    "flat box": ([[5.0, 1.0, 0], [0, 5.0, 0], [0, 0, 2.0]], (True, True, False)),
}


@pytest.mark.parametrize("shift", [0.0, 37.3])
@pytest.mark.parametrize("name", CELLS)
def test_every_pair_is_found_once(name, shift):
    """Positions are scattered over several cells: nothing needs to be wrapped."""
    matrix, periodic = np.array(CELLS[name][0], dtype=float), CELLS[name][1]
    dimension = len(matrix)
    generator = np.random.default_rng(len(name))
    count = 8 if name == "tiny" else 50
    fraction = generator.uniform(0, 1, (count, dimension))
    fraction += np.array(periodic) * generator.integers(-3, 4, (count, dimension))
    origin = np.full(dimension, shift)
    position = origin + fraction @ matrix.T
    radius = generator.uniform(0.4, 0.6, count)
    found = _found_pairs(position, radius, matrix, periodic, SKIN, origin)
    assert found == _all_pairs(position, radius, matrix, periodic, SKIN)
    assert len(found) > 10


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 10**6), st.floats(-0.6, 0.6), st.floats(1.5, 6.0), st.integers(2, 25))
def test_every_pair_is_found_in_random_cells(seed, tilt, height, count):
    generator = np.random.default_rng(seed)
    width = generator.uniform(1.9, 7.0)
    matrix = np.array([[width, tilt * width], [0.0, height]])
    position = generator.uniform(-10, 10, (count, 2))
    radius = generator.uniform(0.2, 0.6, count)
    found = _found_pairs(position, radius, matrix, (True, True), SKIN, np.zeros(2))
    assert found == _all_pairs(position, radius, matrix, (True, True), SKIN)


@pytest.mark.parametrize("members", [2, 3, 40])
def test_members_of_a_team_find_the_same_pairs_in_the_same_order(members):
    generator = np.random.default_rng(5)
    position, radius = generator.uniform(0, 9, (200, 2)), np.full(200, 0.4)
    cell = (np.array([[9.0, 2.0], [0.0, 9.0]]), np.zeros(2), np.array([True, True]))

    def run(kernel, arguments):
        for member in reversed(range(members)):
            kernel(*arguments, member, members)

    alone = find_pairs(position, radius, cell, SKIN)
    shared = find_pairs(position, radius, cell, SKIN, run=run, room=10_000)
    assert len(alone[0]) > 200
    assert (np.diff(alone[0][:, 0]) >= 0).all()
    for one, other in zip(alone, shared, strict=True):
        assert np.array_equal(one, other)


def test_walls_within_reach():
    """Walls are numbered 2·axis + side; periodic axes have none."""
    generator = np.random.default_rng(1)
    matrix, origin = np.diag([5.0, 4.0, 3.0]), np.array([1.0, -2.0, 0.5])
    position = origin + generator.uniform(0, 1, (60, 3)) * np.diag(matrix)
    radius = generator.uniform(0.3, 0.5, 60)
    periodic = np.array([False, True, False])
    pairs, count = find_wall_pairs(position, radius, matrix, origin, periodic, SKIN, 500)
    expected = set()
    for i, axis in product(range(60), (0, 2)):
        gaps = (
            position[i, axis] - origin[axis] - radius[i],
            origin[axis] + matrix[axis, axis] - position[i, axis] - radius[i],
        )
        expected |= {(i, 2 * axis + side) for side in (0, 1) if gaps[side] < SKIN}
    found = [tuple(int(x) for x in pair) for pair in pairs[:count]]
    assert len(found) == len(set(found))
    assert set(found) == expected
    assert len(expected) > 20


def test_bins_are_at_least_one_reach_wide():
    matrix = np.array([[8.0, 3.9], [0, 6.0]])
    inverse = np.linalg.inv(matrix)
    counts = bin_counts(inverse, 1.4, np.array([True, True]))
    heights = 1 / np.linalg.norm(inverse, axis=1)
    assert (heights / counts >= 1.4).all()
    assert (counts >= 3).all()
    assert bin_counts(inverse, 2.5, np.array([True, True])).tolist() == [1, 1]
    assert bin_counts(np.eye(2) / 6.0, 2.5, np.array([False, True])).tolist() == [2, 1]


# --- orders -----------------------------------------------------------------------------------


def _hexagonal_contacts(side=30):
    index = np.arange(side * side).reshape(side, side)
    neighbours = [np.roll(index, -1, 0), np.roll(index, -1, 1), np.roll(index, (-1, 1), (0, 1))]
    pairs = np.array(
        sorted(
            (int(i), int(j)) for n in neighbours for i, j in zip(index.flat, n.flat, strict=True)
        )
    )
    return pairs[:, 0].astype(np.int32), pairs[:, 1].astype(np.int32)


def _conflicts(first, second, distance=8):
    """Share of contacts that touch a body of one of the ``distance`` contacts before."""
    hits = 0
    for c in range(len(first)):
        bodies = {int(first[c]), int(second[c])}
        window = range(max(0, c - distance), c)
        hits += any(int(first[k]) in bodies or int(second[k]) in bodies for k in window)
    return hits / len(first)


def test_morton_order_keeps_neighbours_near():
    generator = np.random.default_rng(5)
    position = generator.uniform(0, 10, (4000, 2))
    order = morton_order(position, np.zeros(2), np.eye(2) / 10)
    assert sorted(order.tolist()) == list(range(4000))
    jump = np.linalg.norm(np.diff(position[order], axis=0), axis=1)
    assert np.median(jump) < 0.3
    assert np.median(np.linalg.norm(np.diff(position, axis=0), axis=1)) > 3


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("dimension", [2, 3])
def test_random_insertion_leaves_no_overlap(dimension, periodic):
    radius = np.sort(np.random.default_rng(0).uniform(0.3, 0.6, 60))[::-1].copy()
    size = np.full(dimension, 12.0 if dimension == 2 else 6.0)
    axes = np.full(dimension, periodic)
    position, placed = insert_randomly(radius, size, axes, 10_000, 3)
    assert placed == 60
    found = _found_pairs(position, radius, np.diag(size), tuple(axes), 0.0, np.zeros(dimension))
    assert found == set()
    if not periodic:
        assert (position >= radius[:, None]).all()
        assert (position <= size - radius[:, None]).all()


def test_random_insertion_gives_up_when_there_is_no_room():
    _, placed = insert_randomly(np.full(9, 1.0), np.full(2, 4.5), np.array([True, True]), 200, 1)
    assert 1 <= placed < 9
