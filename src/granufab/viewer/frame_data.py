"""One frame as a block of bytes: grains in the cell, contacts under a criterion, their changes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import GranufabError, MissingData
from granufab.fabric.contact_identity import ContactRule, persistent, see_contacts
from granufab.fabric.coordination import counted_contacts
from granufab.fabric.criterion import normal_force
from granufab.fabric.lattice import lattice_change
from granufab.fabric.neighbours import branch_images, branch_vectors, wrap
from granufab.fabric.network import Network
from granufab.fabric.rattlers import contact_number
from granufab.history import Frame
from granufab.packing import Array, Cell, Contacts, IntArray, Packing
from granufab.viewer.buffer import pack, unpack
from granufab.viewer.choice import Choice

__all__ = ["contact_changes", "frame_buffer", "mean_normal_force", "unpack"]

Arrays = dict[str, NDArray]


def frame_buffer(
    frame: Frame,
    choice: Choice,
    *,
    before: Frame | None = None,
    header: dict[str, Any] | None = None,
) -> bytes:
    """What the page draws of one frame, as :func:`granufab.viewer.buffer.pack` lays it out.

    Positions are float32, counted from the origin that the header holds; forces are in units of
    the mean normal force of the contacts that z counts, which the header holds too.

    Args:
        frame: the state.
        choice: criterion and definition of z.
        before: the frame before, for contacts gained and lost in between.
        header: further entries of the header.
    Returns:
        Header: criterion, z_definition, grain_count, contact_count, dimension, cell, origin, low
        and high (corners of the box that holds the grains), eps_q, eps_q_total, stage, time,
        direction, mean_radius, mean_normal_force, changes, missing. Arrays: position, radius,
        number, and where known velocity, spin, held, contact_number; pair, normal, branch,
        image, counted, gap, force, normal_force; gained, lost_pair, lost_branch; wall_grain,
        wall, wall_normal, wall_force.
    """
    packing = frame.packing
    position, _ = wrap(packing.grains.position, packing.cell)
    origin = _origin(packing)
    arrays = _grains(packing, position - origin)
    mean, count, missing = None, 0, None
    changes: dict[str, Any] = {"missing": "there is no frame before"}
    try:
        contacts, network = choice.contacts(packing), choice.network(packing)
    except MissingData as error:
        missing, changes = str(error), {"missing": str(error)}
    else:
        mean, count = mean_normal_force(network.contacts), contacts.count
        arrays |= _contacts(packing, contacts, network, position, mean)
        if before is not None:
            changes, more = _changes(before, frame, choice)
            arrays |= more
    words = {
        **(header or {}),
        "criterion": choice.criterion.text,
        "z_definition": choice.z_definition,
        "grain_count": packing.grains.count,
        "contact_count": count,
        "dimension": packing.dimension,
        "cell": _cell(packing.cell),
        "origin": origin,
        **_corners(packing, position - origin),
        "eps_q": frame.eps_q,
        "eps_q_total": frame.eps_q_total,
        "stage": frame.stage,
        "time": packing.time,
        "direction": frame.direction,
        "mean_radius": float(packing.grains.radius.mean()),
        "mean_normal_force": mean,
        "changes": changes,
        "missing": missing,
    }
    return pack(words, arrays | _walls(packing, mean))


def _origin(packing: Packing) -> Array:
    if packing.cell is not None and packing.cell.origin is not None:
        return packing.cell.origin
    return packing.grains.position.min(axis=0)


def _cell(cell: Cell | None) -> dict[str, Any] | None:
    """Lattice vectors as rows, so that the page reads one after another."""
    if cell is None:
        return None
    return {"vectors": cell.matrix.T, "periodic": list(cell.periodic), "volume": cell.volume}


def _corners(packing: Packing, position: Array) -> dict[str, Array]:
    """The box along the axes that holds the cell, or the grains where there is none."""
    if packing.cell is None:
        radius = packing.grains.radius[:, None]
        return {"low": (position - radius).min(axis=0), "high": (position + radius).max(axis=0)}
    matrix = packing.cell.matrix
    return {"low": np.minimum(matrix, 0).sum(axis=1), "high": np.maximum(matrix, 0).sum(axis=1)}


def _grains(packing: Packing, position: Array) -> Arrays:
    grains = packing.grains
    arrays: Arrays = {
        "position": position.astype(np.float32),
        "radius": grains.radius.astype(np.float32),
    }
    assert grains.number is not None
    small = grains.number.min() >= 0 and grains.number.max() < 2**32
    arrays["number"] = grains.number.astype(np.uint32 if small else np.float64)
    for name in ("velocity", "spin"):
        value = getattr(grains, name)
        if value is not None:
            arrays[name] = value.astype(np.float32)
    return arrays


def mean_normal_force(contacts: Contacts) -> float | None:
    """Mean normal force over the contacts [N]; None without forces or a positive mean."""
    if contacts.force is None or not contacts.count:
        return None
    mean = float(normal_force(contacts).mean())
    return mean if mean > 0 else None


def _contacts(
    packing: Packing, contacts: Contacts, network: Network, position: Array, mean: float | None
) -> Arrays:
    held = network.coordination.held
    number = contact_number(contacts.pair, packing.grains.count)
    listed = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    branch = branch_vectors(listed)
    counted = counted_contacts(contacts.pair, network.coordination, network.z_definition)
    arrays: Arrays = {
        "held": held.astype(np.uint32),
        "contact_number": number.astype(np.uint32),
        "pair": contacts.pair.astype(np.uint32),
        "normal": contacts.normal.astype(np.float32),
        "branch": branch.astype(np.float32),
        "image": branch_images(branch, contacts.pair, position, packing.cell).astype(np.int32),
        "counted": counted.astype(np.uint32),
    }
    if contacts.gap is not None:
        arrays["gap"] = contacts.gap.astype(np.float32)
    if mean is not None:
        assert contacts.force is not None
        arrays["force"] = (contacts.force / mean).astype(np.float32)
        arrays["normal_force"] = (normal_force(contacts) / mean).astype(np.float32)
    return arrays


def _walls(packing: Packing, mean: float | None) -> Arrays:
    walls = packing.wall_contacts
    if walls is None or not walls.count:
        return {}
    arrays: Arrays = {
        "wall_grain": walls.grain.astype(np.uint32),
        "wall": walls.wall.astype(np.uint32),
        "wall_normal": walls.normal.astype(np.float32),
    }
    if mean is not None:
        arrays["wall_force"] = (walls.force / mean).astype(np.float32)
    return arrays


def contact_changes(
    before: Frame, after: Frame, rule: ContactRule
) -> tuple[NDArray[np.bool_], IntArray]:
    """Contacts of a criterion gained and lost from one frame to a later one.

    Args:
        before: the earlier frame.
        after: the later one, of the same grains.
        rule: which contacts count; those of z, all.
    Returns:
        Whether each contact of ``after`` is new, in the order of
        :func:`~granufab.fabric.select_contacts`; and of each lost one the grains (indices in
        ``after``) and the lattice vectors from i to the image of j, in the cell of ``after``,
        positions not wrapped, shape (lost, 2 + D).
    Raises:
        MissingData: a state lacks what the criterion needs.
        InvalidPacking: the two hold different grains, or list a contact twice.
    """
    first, second = (
        see_contacts(frame.packing, lattice_change(frame), rule).made for frame in (before, after)
    )
    kept, found = persistent(first, second)
    gained = np.ones(second.count, dtype=bool)
    gained[found] = False
    key = np.delete(first.key, kept, axis=0)
    number = after.packing.grains.number
    assert number is not None
    order = np.argsort(number)
    pair = order[np.searchsorted(number, key[:, :2], sorter=order)]
    change = np.linalg.inv(lattice_change(after))
    image = np.rint(key[:, 2:] @ change.T).astype(np.int64)
    return gained, np.column_stack([pair, image])


def _changes(before: Frame, after: Frame, choice: Choice) -> tuple[dict[str, Any], Arrays]:
    """Gained contacts as a mask, lost ones as lines in the state after."""
    rule = ContactRule(criterion=choice.criterion, reach=choice.reach)
    try:
        gained, lost = contact_changes(before, after, rule)
    except GranufabError as error:
        return {"missing": str(error)}, {}
    i, j, image = lost[:, 0], lost[:, 1], lost[:, 2:]
    grains, cell = after.packing.grains, after.packing.cell
    branch = grains.position[j] - grains.position[i]
    if cell is not None:
        branch = branch + image @ cell.matrix.T
    words = {
        "since_eps_q": before.eps_q,
        "gained": int(gained.sum()),
        "lost": len(lost),
    }
    return words, {
        "gained": gained.astype(np.uint32),
        "lost_pair": lost[:, :2].astype(np.uint32),
        "lost_branch": branch.astype(np.float32),
    }
