import itertools

import numpy as np
import pytest
from fabric_cases import hexagonal
from hypothesis import given, settings
from hypothesis import strategies as st

from granufab.errors import InvalidPacking
from granufab.fabric import branch_vectors, neighbours_within
from granufab.fabric.neighbours import walls_within
from granufab.packing import Cell, Contacts, Grains, Packing


def brute_force(packing, gap, turns=3):
    """Every pair and image, one by one."""
    position, radius, cell = packing.grains.position, packing.grains.radius, packing.cell
    shifts = itertools.product(*(range(-turns, turns + 1) if p else (0,) for p in cell.periodic))
    found = set()
    for shift in shifts:
        for i in range(len(radius)):
            for j in range(i, len(radius)):
                if i == j and not any(shift):
                    continue
                branch = position[j] - position[i] + cell.matrix @ np.array(shift, dtype=float)
                if np.linalg.norm(branch) - radius[i] - radius[j] < gap:
                    if i == j and next(s for s in shift if s) < 0:
                        continue
                    found.add((i, j, shift))
    return found


@given(
    seed=st.integers(0, 10**6),
    tilt=st.floats(-1.2, 1.2),
    dimension=st.sampled_from([2, 3]),
    size=st.floats(1.5, 4.0),
    walls=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_neighbours_are_those_of_brute_force(seed, tilt, dimension, size, walls):
    generator = np.random.default_rng(seed)
    matrix = size * np.diag(generator.uniform(0.8, 1.2, dimension))
    periodic = [True] * dimension
    if walls:
        periodic[-1] = False
    if dimension == 3 or not walls:
        matrix[0, 1] = tilt * size
    origin = generator.uniform(-2, 2, dimension)
    fraction = generator.uniform(0, 1, (7, dimension))
    cell = Cell(matrix=matrix, periodic=tuple(periodic), origin=origin)
    unwrapped = generator.integers(-1, 2, fraction.shape) * np.array(periodic)
    packing = Packing(
        grains=Grains(
            position=origin + (fraction + unwrapped) @ matrix.T,
            radius=generator.uniform(0.1, 0.5, 7),
        ),
        cell=cell,
    )
    found = neighbours_within(packing, 0.1)
    images = found.image
    got = {(*map(int, p), tuple(map(int, m))) for p, m in zip(found.pair, images, strict=True)}
    assert len(got) == found.count
    assert got == brute_force(packing, 0.1, turns=7 if dimension == 2 else 6)
    rebuilt = (
        packing.grains.position[found.pair[:, 1]]
        - packing.grains.position[found.pair[:, 0]]
        + images @ matrix.T
    )
    np.testing.assert_allclose(found.branch, rebuilt, atol=1e-12)
    length = np.linalg.norm(rebuilt, axis=1)
    np.testing.assert_allclose(found.normal * length[:, None], rebuilt, atol=1e-12)
    np.testing.assert_allclose(
        found.gap, length - packing.grains.radius[found.pair].sum(axis=1), atol=1e-12
    )


def test_without_a_cell_nothing_wraps():
    packing = hexagonal(4)
    free = Packing(grains=packing.grains)
    # A 4 × 4 rhombus has 3·4·2 + 9 inner contacts, the periodic one 3 per grain.
    assert neighbours_within(packing, 0.01).count == 48
    assert neighbours_within(free, 0.01).count == 33


def test_one_grain_in_a_unit_cell_touches_its_images():
    found = neighbours_within(hexagonal(1), 0.01)
    assert found.pair.tolist() == [[0, 0]] * 3


def test_coincident_grains_are_named():
    packing = Packing(grains=Grains(position=np.zeros((2, 2)), radius=np.ones(2)))
    with pytest.raises(InvalidPacking, match="grains 0 and 1 have the same centre"):
        neighbours_within(packing, 0.0)


def test_walls_are_near_only_where_the_cell_has_them():
    grains = Grains(position=[[0.5, 0.52], [2.0, 2.0]], radius=[0.5, 0.5])
    box = Packing(grains=grains, cell=Cell(matrix=4 * np.eye(2), periodic=(False, True)))
    assert walls_within(box, 0.1).tolist() == [0]
    closed = Packing(grains=grains, cell=Cell(matrix=4 * np.eye(2), periodic=(False, False)))
    assert walls_within(closed, 0.1).tolist() == [0, 0]
    assert walls_within(closed, 0.01).tolist() == [0]


def test_branches_come_from_whatever_the_list_holds():
    packing = hexagonal(5)
    full = neighbours_within(packing, 0.01)

    def branches(**kept):
        contacts = Contacts(pair=full.pair, normal=full.normal, **kept)
        return branch_vectors(Packing(grains=packing.grains, cell=packing.cell, contacts=contacts))

    for kept in ({"branch": full.branch}, {"gap": full.gap}, {"image": full.image}, {}):
        np.testing.assert_allclose(branches(**kept), full.branch, atol=1e-12)
