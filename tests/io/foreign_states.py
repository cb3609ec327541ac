"""A touching packing with everything that files of other programs may hold."""

from __future__ import annotations

import dataclasses

import numpy as np

from granufab.fabric.neighbours import neighbours_within
from granufab.packing import Cell, Grains, Packing

EDGE = 8.0


def touching(dimension: int, *, seed: int = 1, count: int = 40, tilt: float = 1.5) -> Packing:
    """Random overlapping grains in a tilted periodic cell, with forces on all close pairs."""
    rng = np.random.default_rng(seed)
    matrix = np.eye(dimension) * EDGE
    matrix[0, 1] = tilt
    packing = Packing(
        grains=Grains(
            position=rng.uniform(0, EDGE, (count, dimension)),
            radius=rng.uniform(0.6, 0.9, count),
            mass=rng.uniform(1, 2, count),
            velocity=rng.normal(size=(count, dimension)),
            spin=rng.normal(size=(count, 1 if dimension == 2 else 3)),
            number=rng.permutation(count) + 5,
        ),
        cell=Cell(matrix=matrix, origin=np.full(dimension, 0.25)),
        time=1.25,
    )
    contacts = neighbours_within(packing, 0.05)
    force = rng.normal(size=contacts.normal.shape) + 3.0 * contacts.normal
    return dataclasses.replace(packing, contacts=dataclasses.replace(contacts, force=force))


def assert_same_packing(
    got: Packing, wanted: Packing, *, contacts: bool, tolerance: float = 1e-14
) -> None:
    """Grains, cell and, where asked, contacts agree, whatever their order."""
    order = np.argsort(got.grains.number), np.argsort(wanted.grains.number)
    for name in ("number", "position", "radius", "mass", "velocity", "spin"):
        one, two = getattr(got.grains, name)[order[0]], getattr(wanted.grains, name)[order[1]]
        np.testing.assert_allclose(one, two, rtol=tolerance, atol=tolerance, err_msg=name)
    assert got.cell is not None
    assert wanted.cell is not None
    np.testing.assert_allclose(got.cell.matrix, wanted.cell.matrix, rtol=tolerance)
    np.testing.assert_allclose(got.cell.origin, wanted.cell.origin, rtol=tolerance)
    assert got.cell.periodic == wanted.cell.periodic
    if contacts:
        _assert_same_contacts(got, wanted, tolerance)


def _assert_same_contacts(got: Packing, wanted: Packing, tolerance: float) -> None:
    one, two = got.contacts, wanted.contacts
    assert one is not None
    assert two is not None
    assert one.count == two.count
    np.testing.assert_array_equal(got.grains.number[one.pair], wanted.grains.number[two.pair])
    for name in ("normal", "gap", "force"):
        np.testing.assert_allclose(
            getattr(one, name), getattr(two, name), rtol=0, atol=10 * tolerance, err_msg=name
        )
