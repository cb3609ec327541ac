"""Frames of grains that move affinely with a cell, plus steps of one's choice."""

from __future__ import annotations

import numpy as np
from fabric_cases import jittered
from scipy.linalg import expm

from granufab.history import Frame
from granufab.packing import Cell, Grains, Packing

SIMPLE = np.array([[0.0, 1.0], [0.0, 0.0]])
"""Simple shear in 2D with ε̇_q = 1."""

BIAXIAL = np.diag([0.6, -0.4])
TRIAXIAL = np.diag([0.3, -0.7, 0.3])
SIMPLE_3D = np.pad(SIMPLE, (0, 1))


def shorten(matrix, remap):
    """The shorter basis of a lattice sheared along x, and the accumulated change."""
    turns = round(matrix[0, 1] / matrix[0, 0])
    change = np.eye(len(matrix))
    change[0, 1] = -turns
    return matrix @ change, remap @ change


def frames(
    rate,
    *,
    count=400,
    number=6,
    interval=0.05,
    steps=None,
    velocities=None,
    generator=None,
    wrapped=False,
    first=0.0,
):
    """States under a constant velocity gradient ``rate`` with ε̇_q = 1, or 0.

    ``steps(k, position)`` gives the non-affine displacement of interval k, ``velocities(k,
    position)`` the recorded fluctuation c of state k. ``wrapped`` moves grains by random lattice
    vectors in every state; ``first`` is the tilt at the start.
    """
    generator = generator or np.random.default_rng(7)
    dimension = len(rate)
    side = round(count ** (1 / dimension))
    matrix = side * np.eye(dimension)
    matrix[0, 1] = first * side
    start = jittered(generator, count, dimension, matrix=matrix)
    position, radius = start.grains.position, start.grains.radius
    remap, growth = np.eye(dimension), expm(rate * interval)
    found = []
    for k in range(number):
        shown = position
        if wrapped:
            shown = position + generator.integers(-3, 4, position.shape) @ matrix.T
        c = None if velocities is None else velocities(k, position)
        packing = Packing(
            grains=Grains(position=shown, radius=radius, velocity=c),
            cell=Cell(matrix=matrix, rate=rate),
            time=k * interval,
        )
        found.append(_frame(packing, k * interval, remap))
        position = position @ growth.T
        matrix, remap = shorten(growth @ matrix, remap)
        if steps is not None:
            position = position + steps(k, position)
    return found


def _frame(packing, strain, remap, stage=0):
    dimension = packing.dimension
    return Frame(
        packing=packing,
        eps_q=strain,
        eps_q_total=strain,
        strain=np.zeros((dimension, dimension)),
        stage=stage,
        stress=np.eye(dimension),
        inertial_number=1e-3,
        direction=np.eye(dimension)[1],
        remap=remap,
    )
