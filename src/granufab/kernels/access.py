"""How a kernel reads and writes contacts and bodies: one at a time, or eight as lanes.

A kernel text takes its width from ``like``: a tuple of D zeros means one contact, that tuple in
another tuple means eight (:mod:`granufab.kernels.lanes`). ``like_numbers`` turns either into the
tuple of D zeros, numbers or lanes, that the functions of ``vectors`` expect.
"""

from __future__ import annotations

import numpy as np
from numba import types

from granufab.kernels.lanes import (
    LANES,
    MASK,
    WIDTH,
    address_of,
    choose_lanes,
    gather_4,
    gather_8,
    largest,
    load_lanes,
    prefetch_4,
    prefetch_8,
    prefetch_line,
    read_item,
    scatter_4,
    scatter_8,
    spread,
    store_lanes,
    total,
    write_item,
)
from granufab.kernels.options import compiled

__all__ = [
    "address",
    "announce",
    "body_of",
    "choose",
    "greatest",
    "inverse_mass_of",
    "item",
    "like_numbers",
    "put",
    "put_body",
    "put_tangent",
    "set_item",
    "spin_of",
    "stride",
    "summed",
    "take",
    "take_body",
    "take_tangent",
    "take_vector",
    "velocity_of",
]


def like_numbers(like):
    """The tuple of D zeros, numbers or lanes."""
    return like


@compiled(like_numbers)
def _like_numbers(like):
    if not isinstance(like[0], types.BaseTuple):
        return lambda like: like
    if like[0].count == 2:
        return lambda like: (spread(0.0), spread(0.0))
    return lambda like: (spread(0.0), spread(0.0), spread(0.0))


def stride(like):
    """Contacts that are updated at once."""
    return 1


@compiled(stride)
def _stride(like):
    width = WIDTH if isinstance(like[0], types.BaseTuple) else 1
    return lambda like: width


def address(array):
    """Where the numbers of a contiguous array begin; kernels pass this on, it costs nothing."""
    return array.reshape(-1)


@compiled(address)
def _address(array):
    return lambda array: address_of(array)


def item(place, k):
    """Number ``k`` behind an address."""
    return float(place[k])


@compiled(item)
def _item(place, k):
    return lambda place, k: read_item(place, k)


def set_item(place, k, value):
    """Write number ``k`` behind an address."""
    place[k] = value


@compiled(set_item)
def _set_item(place, k, value):
    return lambda place, k, value: write_item(place, k, value)


def take(slots, at, field, like):
    """Item ``field`` of the contact (or eight contacts) at ``at``."""
    return item(slots, at + WIDTH * field)


@compiled(take)
def _take(slots, at, field, like):
    if like[0] == LANES:
        return lambda slots, at, field, like: load_lanes(slots, at + WIDTH * field)
    return lambda slots, at, field, like: read_item(slots, at + WIDTH * field)


def put(slots, at, field, value):
    """Write item ``field`` of the contact (or eight contacts) at ``at``."""
    slots[at + WIDTH * field] = value


@compiled(put)
def _put(slots, at, field, value):
    if value == LANES:
        return lambda slots, at, field, value: store_lanes(slots, at + WIDTH * field, value)
    return lambda slots, at, field, value: write_item(slots, at + WIDTH * field, value)


def take_vector(slots, at, field, like):
    """Items ``field`` … ``field`` + D − 1: a vector."""
    return tuple(float(slots[at + WIDTH * (field + k)]) for k in range(len(like)))


@compiled(take_vector)
def _take_vector(slots, at, field, like):
    if like.count == 2:
        return lambda slots, at, field, like: (
            take(slots, at, field, like),
            take(slots, at, field + 1, like),
        )
    return lambda slots, at, field, like: (
        take(slots, at, field, like),
        take(slots, at, field + 1, like),
        take(slots, at, field + 2, like),
    )


def take_tangent(slots, at, field, like):
    """Items from ``field`` on: what lies in the tangent plane, 1 number in 2D, 3 in 3D."""
    count = 1 if len(like) == 2 else 3
    return tuple(float(slots[at + WIDTH * (field + k)]) for k in range(count))


@compiled(take_tangent)
def _take_tangent(slots, at, field, like):
    if like.count == 2:
        return lambda slots, at, field, like: (take(slots, at, field, like),)
    return lambda slots, at, field, like: take_vector(slots, at, field, like)


def put_tangent(slots, at, field, value):
    """Write what :func:`take_tangent` read."""
    for k, x in enumerate(value):
        put(slots, at, field + k, x)


@compiled(put_tangent)
def _put_tangent(slots, at, field, value):
    def one(slots, at, field, value):
        put(slots, at, field, value[0])

    def three(slots, at, field, value):
        put(slots, at, field, value[0])
        put(slots, at, field + 1, value[1])
        put(slots, at, field + 2, value[2])

    return one if value.count == 1 else three


def take_body(bodies, index, place, like):
    """All numbers of the body (or eight bodies) that ``index`` names at ``place``."""
    width = 4 if len(like) == 2 else 8
    first = int(index[place]) * width
    return tuple(float(x) for x in bodies[first : first + width])


@compiled(take_body)
def _take_body(bodies, index, place, like):
    if like[0] == LANES:
        if like.count == 2:
            return lambda bodies, index, place, like: gather_4(bodies, index, place)
        return lambda bodies, index, place, like: gather_8(bodies, index, place)

    def disk(bodies, index, place, like):
        k = np.int64(read_item(index, place)) * 4
        v, s = (read_item(bodies, k), read_item(bodies, k + 1)), read_item(bodies, k + 2)
        return v[0], v[1], s, read_item(bodies, k + 3)

    def sphere(bodies, index, place, like):
        k = np.int64(read_item(index, place)) * 8
        return (
            read_item(bodies, k),
            read_item(bodies, k + 1),
            read_item(bodies, k + 2),
            read_item(bodies, k + 3),
            read_item(bodies, k + 4),
            read_item(bodies, k + 5),
            read_item(bodies, k + 6),
            0.0,
        )

    return disk if like.count == 2 else sphere


def put_body(bodies, index, place, body):
    """Write what :func:`take_body` read."""
    first = int(index[place]) * len(body)
    bodies[first : first + len(body)] = body


@compiled(put_body)
def _put_body(bodies, index, place, body):
    if body[0] == LANES:
        if body.count == 4:
            return lambda bodies, index, place, body: scatter_4(bodies, index, place, body)
        return lambda bodies, index, place, body: scatter_8(bodies, index, place, body)

    def disk(bodies, index, place, body):
        k = np.int64(read_item(index, place)) * 4
        write_item(bodies, k, body[0])
        write_item(bodies, k + 1, body[1])
        write_item(bodies, k + 2, body[2])

    def sphere(bodies, index, place, body):
        k = np.int64(read_item(index, place)) * 8
        write_item(bodies, k, body[0])
        write_item(bodies, k + 1, body[1])
        write_item(bodies, k + 2, body[2])
        write_item(bodies, k + 3, body[3])
        write_item(bodies, k + 4, body[4])
        write_item(bodies, k + 5, body[5])

    return disk if body.count == 4 else sphere


def announce(slots, bodies, one, two, batch, size, like):
    """Have a batch and its bodies brought near, some batches before they are swept."""


@compiled(announce)
def _announce(slots, bodies, one, two, batch, size, like):
    if not isinstance(like[0], types.BaseTuple):
        return lambda slots, bodies, one, two, batch, size, like: None

    def disks(slots, bodies, one, two, batch, size, like):
        prefetch_4(bodies, one, batch * WIDTH)
        prefetch_4(bodies, two, batch * WIDTH)
        for k in range(0, size, WIDTH):
            prefetch_line(slots, batch * size + k)

    def spheres(slots, bodies, one, two, batch, size, like):
        prefetch_8(bodies, one, batch * WIDTH)
        prefetch_8(bodies, two, batch * WIDTH)
        for k in range(0, size, WIDTH):
            prefetch_line(slots, batch * size + k)

    return disks if like[0].count == 2 else spheres


def velocity_of(body):
    """v of a body's numbers."""
    return body[:2] if len(body) == 4 else body[:3]


@compiled(velocity_of)
def _velocity_of(body):
    if body.count == 4:
        return lambda body: (body[0], body[1])
    return lambda body: (body[0], body[1], body[2])


def spin_of(body):
    """s = R·ω of a body's numbers."""
    return body[2:3] if len(body) == 4 else body[3:6]


@compiled(spin_of)
def _spin_of(body):
    if body.count == 4:
        return lambda body: (body[2],)
    return lambda body: (body[3], body[4], body[5])


def inverse_mass_of(body):
    """1/m of a body's numbers."""
    return body[3] if len(body) == 4 else body[6]


@compiled(inverse_mass_of)
def _inverse_mass_of(body):
    return (lambda body: body[3]) if body.count == 4 else (lambda body: body[6])


def body_of(v, s, body):
    """A body's numbers with new velocity and spin."""
    return (*v, *s, *body[len(v) + len(s) :])


@compiled(body_of)
def _body_of(v, s, body):
    if body.count == 4:
        return lambda v, s, body: (v[0], v[1], s[0], body[3])
    return lambda v, s, body: (v[0], v[1], v[2], s[0], s[1], s[2], body[6], body[7])


def choose(condition, one, two):
    """``one`` where the condition holds, else ``two``; both are computed."""
    return one if condition else two


@compiled(choose)
def _choose(condition, one, two):
    if condition == MASK:
        return lambda condition, one, two: choose_lanes(condition, one, two)
    return lambda condition, one, two: one if condition else two


def summed(value):
    """Sum over the lanes; a number as it is."""
    return value


@compiled(summed)
def _summed(value):
    return (lambda value: total(value)) if value == LANES else (lambda value: value)


def greatest(value):
    """Maximum over the lanes; a number as it is."""
    return value


@compiled(greatest)
def _greatest(value):
    return (lambda value: largest(value)) if value == LANES else (lambda value: value)
