"""How a kernel reads and writes contacts and bodies: one at a time, or eight as lanes.

A kernel text takes its width from ``like``: a tuple of D zeros means one contact, that tuple in
another tuple means eight (:mod:`granufab.kernels.lanes`). ``like_numbers`` turns either into the
tuple of D zeros, numbers or lanes, that the functions of ``vectors`` expect.
"""

from __future__ import annotations

from granufab.kernels.lanes import WIDTH
from granufab.kernels.standins import Address, is_lanes
from granufab.kernels.tracing import spread, traced, whole

__all__ = [
    "address",
    "body_of",
    "extrapolate_body",
    "find_body",
    "inverse_mass_of",
    "item",
    "like_numbers",
    "prefetch",
    "put",
    "put_body",
    "put_tangent",
    "set_item",
    "spin_of",
    "stride",
    "take",
    "take_body",
    "take_tangent",
    "take_vector",
    "velocity_of",
]


def like_numbers(like):
    """The tuple of D zeros, numbers or lanes, inside a traced function."""
    return tuple(spread(x) for x in like[0]) if isinstance(like[0], tuple) else like


@traced
def stride(like):
    """Contacts that are updated at once."""
    return WIDTH if isinstance(like[0], tuple) else 1


@traced
def address(array):
    """Where the numbers of a contiguous array begin; kernels pass this on, it costs nothing."""
    return array.reshape(-1)


@traced
def item(place, k):
    """Number ``k`` behind an address."""
    return place[k]


@traced
def set_item(place, k, value):
    """Write number ``k`` behind an address."""
    place[k] = value


@traced
def take(slots, at, field, like):
    """Item ``field`` of the contact (or eight contacts) at ``at``."""
    place = at + WIDTH * field
    return slots.lanes(place) if is_lanes(like[0]) else slots[place]


@traced
def put(slots, at, field, value):
    """Write item ``field`` of the contact (or eight contacts) at ``at``."""
    if is_lanes(value):
        slots.put_lanes(at + WIDTH * field, value)
    else:
        slots[at + WIDTH * field] = value


def take_vector(slots, at, field, like):
    """Items ``field`` … ``field`` + D − 1: a vector."""
    return tuple(take(slots, at, field + k, like) for k in range(len(like)))


@traced
def take_tangent(slots, at, field, like):
    """Items from ``field`` on: what lies in the tangent plane, 1 number in 2D, 3 in 3D."""
    return tuple(take(slots, at, field + k, like) for k in range(1 if len(like) == 2 else 3))


@traced
def put_tangent(slots, at, field, value):
    """Write what :func:`take_tangent` read."""
    for k, x in enumerate(value):
        put(slots, at, field + k, x)


def find_body(bodies, index, place, like):
    """Where the body (or eight bodies) that ``index`` names at ``place`` lies."""
    width = _body_width(like)
    if is_lanes(like[0]):
        return bodies.rows(index, place, width)
    return whole(index[place]) * width


def take_body(bodies, where, like):
    """All numbers of a body (or eight bodies)."""
    if is_lanes(like[0]):
        return where.gather()
    return tuple(bodies[where + k] for k in range(_body_width(like)))


def put_body(bodies, where, body):
    """Write what :func:`take_body` read; of one body, what moves."""
    if is_lanes(body[0]):
        where.scatter(body)
        return
    for k, x in enumerate((*velocity_of(body), *spin_of(body))):
        bodies[where + k] = x


@traced
def extrapolate_body(bodies, before, row, beta, like):
    """bodies ← bodies + β (bodies − before), before ← bodies, for the body of a row."""
    width = _body_width(like[0] if isinstance(like[0], tuple) else like)
    start = row * width
    if isinstance(bodies, Address):
        bodies.move_on(before, start, width, beta)
        return
    for k in range(start, start + width):
        now = bodies[k]
        bodies[k], before[k] = now + beta * (now - before[k]), now


@traced
def prefetch(slots, bodies, one, two, batch, size, fields, like):
    """Have a batch of ``size`` numbers and its bodies brought near; nothing for single contacts.

    ``fields`` of the batch are asked for, a line of the cache each.
    """
    if not isinstance(like[0], tuple):
        return
    for index in (one, two):
        bodies.rows(index, batch * WIDTH, _body_width(like[0])).prefetch()
    for field in range(fields):
        slots.prefetch(batch * size + field * WIDTH)


def _body_width(like):
    return 4 if len(like) == 2 else 8


def velocity_of(body):
    """v of a body's numbers."""
    return body[:2] if len(body) == 4 else body[:3]


def spin_of(body):
    """s = R·ω of a body's numbers."""
    return body[2:3] if len(body) == 4 else body[3:6]


def inverse_mass_of(body):
    """1/m of a body's numbers."""
    return body[3] if len(body) == 4 else body[6]


def body_of(v, s, body):
    """A body's numbers with new velocity and spin."""
    return (*v, *s, *body[len(v) + len(s) :])
