"""Contacts with prescribed harmonics of orientation, force and branch length."""

from __future__ import annotations

import numpy as np
from fabric_cases import contacts_of, draw_plane, draw_sphere

from granufab.packing import Cell, Contacts, Grains, Packing


def second_order(normal, axis):
    """cos 2ψ in 2D, 3cos²ψ − 1 in 3D, and the vector sin 2ψ e_ψ."""
    cosine = normal @ axis
    shape = 2 * cosine**2 - 1 if len(axis) == 2 else 3 * cosine**2 - 1
    # sin ψ e_ψ = cos ψ n − d, in any dimension.
    return shape, 2 * cosine[:, None] * (cosine[:, None] * normal - axis)


def stressed(generator, count, a, a_l, a_n, a_t, axis, *, noise=True):
    """A packing whose contacts follow the second-order forms about ``axis``."""
    axis = np.array(axis, dtype=float) / np.linalg.norm(axis)
    if len(axis) == 2:
        quarter = np.pi / 2 if a < 0 else 0.0
        turn = np.arctan2(axis[1], axis[0]) + quarter
        normal = draw_plane(count, abs(a), turn, generator)
    else:
        normal = draw_sphere(count, a, axis, generator)
    return packing_of(normal, a_l, a_n, a_t, axis, generator if noise else None)


def packing_of(normal, a_l, a_n, a_t, axis, generator=None):
    shape, shear = second_order(normal, axis)
    count = len(normal)
    length, force = 1.0 + a_l * shape, 2.0 * (1.0 + a_n * shape)
    tangential = -a_t * 2.0 * shear
    if generator is not None:
        length = length * generator.uniform(0.9, 1.1, count)
        force = force * generator.exponential(1.0, count)
        away = generator.normal(0.0, 0.1, normal.shape)
        tangential = tangential + away - np.sum(away * normal, axis=1)[:, None] * normal
    made = contacts_of(normal, count)  # a ring: every grain has two contacts
    contacts = Contacts(
        pair=made.pair,
        normal=normal,
        branch=length[:, None] * normal,
        force=force[:, None] * normal + tangential,
    )
    position = np.arange(count)[:, None] * np.ones(normal.shape[1])
    return Packing(
        grains=Grains(position=position, radius=np.full(count, 0.5)),
        contacts=contacts,
        cell=Cell(matrix=100.0 * np.eye(normal.shape[1])),
    )
