"""The same contact in several states: by grain numbers and periodic image.

A contact joins grain i to one image of grain j. Positions are not wrapped and images are lattice
shifts, so (i, j, image) lasts as long as the contact does; where a sheared cell was remapped,
C_now = C T, images are brought back to the lattice vectors before the remap, T·image.

Grains that are not round touch in several points. Which point is which is not known, so those of
one (i, j, image) are matched such that their normals turn least: as many persist as both states
have, and the others are gained or lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidPacking, InvalidSettings
from granufab.fabric.coordination import ZDefinition, coordination, counted_contacts
from granufab.fabric.criterion import Criterion, select_contacts, wall_support
from granufab.fabric.neighbours import branch_images, branch_vectors
from granufab.fabric.row_labels import row_labels
from granufab.packing import Array, Contacts, IntArray, Packing

__all__ = [
    "ContactRule",
    "IdentifiedContacts",
    "SeenContacts",
    "follow_contacts",
    "follow_seen",
    "identify",
    "persistent",
    "see_contacts",
]

_ALONG = 1e-9
"""1 − cosine between normal and branch up to which grains count as round."""
_TOUCH = 1e-6
"""Difference of a gap from the one between spheres, in sums of radii, up to which they do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactRule:
    """Which pairs are contacts, and which of them count.

    Attributes:
        criterion: what makes a contact.
        keep: gap up to which a contact, once made, is kept [mean diameters], or None.
        z_definition: whose contacts count.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
    """

    criterion: Criterion
    keep: float | None = None
    z_definition: ZDefinition = "z"
    minimum: int = 2
    reach: float | None = None

    def __post_init__(self) -> None:
        if self.keep is None:
            return
        least = self.criterion.gap
        if not least <= self.keep <= 1.0:
            raise InvalidSettings(
                f"keep is {self.keep}, allowed {least:g}..1 mean diameters: a contact is kept at "
                "least as far as it is made"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IdentifiedContacts:
    """Contacts of one state that can be found again in another.

    Attributes:
        key: numbers of grains i ≤ j and the image of j in the first lattice vectors, shape
            (contact_count, 2 + D); alike for the points where two grains touch.
        pair: indices of i and j, shape (contact_count, 2).
        normal: unit vector from i to j [-], shape (contact_count, D).
        number: numbers of all grains, sorted, shape (grain_count,).
        lattice: cell of the state in the first lattice vectors [m], shape (D, D), or None.
    """

    key: IntArray
    pair: IntArray
    normal: Array
    number: IntArray
    lattice: Array | None

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.key)

    @property
    def grain_count(self) -> int:
        """Number of grains of the state, with and without contacts."""
        return len(self.number)

    def select(self, keep: NDArray) -> IdentifiedContacts:
        """The contacts where ``keep`` (a mask or indices) says so."""
        return self._with(self.key[keep], self.pair[keep], self.normal[keep])

    def join(self, other: IdentifiedContacts) -> IdentifiedContacts:
        """These contacts and those that only ``other``, of the same state, holds."""
        new = np.ones(other.count, dtype=bool)
        new[persistent(self, other)[1]] = False
        return self._with(
            np.concatenate([self.key, other.key[new]]),
            np.concatenate([self.pair, other.pair[new]]),
            np.concatenate([self.normal, other.normal[new]]),
        )

    def _with(self, key: IntArray, pair: IntArray, normal: Array) -> IdentifiedContacts:
        return IdentifiedContacts(
            key=key, pair=pair, normal=normal, number=self.number, lattice=self.lattice
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenContacts:
    """Contacts of one state.

    Attributes:
        made: by the criterion.
        near: pairs within the gap that keeps a contact, or None without one.
        support: wall contacts of each grain, shape (grain_count,), or None.
    """

    made: IdentifiedContacts
    near: IdentifiedContacts | None
    support: IntArray | None


def identify(packing: Packing, contacts: Contacts, change: IntArray) -> IdentifiedContacts:
    """Contacts of a packing with their identity.

    Args:
        packing: the state; its grain ``number`` tells grains apart.
        contacts: some of its pairs; where they carry no image it follows from the branches.
        change: T of :func:`~granufab.fabric.lattice.lattice_changes`, shape (D, D).
    Raises:
        InvalidPacking: two grains have one number, or a contact of round grains is listed twice.
    """
    assert packing.grains.number is not None
    number = packing.grains.number
    ordered = np.unique(number)
    if len(ordered) < len(number):
        raise InvalidPacking("grain numbers are not unique, so contacts cannot be followed")
    image = _images(packing, contacts) @ change.T
    turned = _turned(number[contacts.pair], image)
    pair = np.where(turned[:, None], contacts.pair[:, ::-1], contacts.pair)
    sign = np.where(turned, -1, 1)[:, None]
    key = np.column_stack([number[pair], image * sign])
    _check_once(packing, contacts, key)
    lattice = None if packing.cell is None else packing.cell.matrix @ np.linalg.inv(change)
    return IdentifiedContacts(
        key=key, pair=pair, normal=contacts.normal * sign, number=ordered, lattice=lattice
    )


def _check_once(packing: Packing, contacts: Contacts, key: IntArray) -> None:
    """Refuse a second contact of two grains that touch as round ones do."""
    label = row_labels(key)
    count = np.bincount(label)
    if len(count) == len(key):
        return
    rows = np.flatnonzero(count[label] > 1)
    keep = np.zeros(len(key), bool)
    keep[rows] = True
    several = contacts.select(keep)
    branch = branch_vectors(Packing(grains=packing.grains, contacts=several, cell=packing.cell))
    length = np.linalg.norm(branch, axis=1)
    reach = packing.grains.radius[several.pair].sum(axis=1)
    round_ = np.einsum("ci,ci->c", several.normal, branch) > (1 - _ALONG) * length
    round_ |= contacts.branch is None and contacts.gap is None  # nothing tells another shape
    if several.gap is not None:
        round_ &= np.abs(length - reach - several.gap) < _TOUCH * reach
    if round_.any():
        twice = key[rows[np.argmax(round_)]]
        raise InvalidPacking(
            f"the contact of grains {twice[0]} and {twice[1]} (image {twice[2:].tolist()}) is "
            "listed twice; list each pair once"
        )


def _images(packing: Packing, contacts: Contacts) -> IntArray:
    if contacts.image is not None:
        return contacts.image
    listed = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    branch = branch_vectors(listed)
    return branch_images(branch, contacts.pair, packing.grains.position, packing.cell)


def _turned(numbers: IntArray, image: IntArray) -> NDArray[np.bool_]:
    """Where i and j must change places: i > j, or a grain's own image that points backwards."""
    turned = numbers[:, 0] > numbers[:, 1]
    sign = np.zeros(len(image), dtype=np.int64)
    for column in image.T:
        sign = np.where(sign == 0, np.sign(column), sign)
    return turned | ((numbers[:, 0] == numbers[:, 1]) & (sign < 0))


def persistent(before: IdentifiedContacts, after: IdentifiedContacts) -> tuple[IntArray, IntArray]:
    """Rows, in ``before`` and in ``after``, of the contacts that both hold.

    Raises:
        InvalidPacking: the two states hold different grains.
    """
    if not np.array_equal(before.number, after.number):
        raise InvalidPacking(
            f"the two states hold different grains ({before.grain_count} and "
            f"{after.grain_count}), so contacts cannot be followed; N must be fixed"
        )
    keys = np.concatenate([before.key, after.key])
    label = row_labels(keys)
    first, second = label[: before.count], label[before.count :]
    counts = [np.bincount(part, minlength=len(keys)) for part in (first, second)]
    single = (counts[0] <= 1) & (counts[1] <= 1)
    lone, others = np.flatnonzero(single[first]), np.flatnonzero(single[second])
    _, rows, twins = np.intersect1d(
        first[lone], second[others], assume_unique=True, return_indices=True
    )
    found = [np.stack([lone[rows], others[twins]], axis=1)]
    shared = np.flatnonzero(~single & (counts[0] > 0) & (counts[1] > 0))
    if len(shared):
        found += _nearest_normals(before.normal, after.normal, first, second, shared)
    pairs = np.concatenate(found).astype(np.int64)
    return pairs[:, 0], pairs[:, 1]


def _nearest_normals(
    before: Array, after: Array, first: IntArray, second: IntArray, shared: IntArray
) -> Iterator[IntArray]:
    """Rows, before and after, of the points that two grains share, for each of these labels."""
    from scipy.optimize import linear_sum_assignment  # slow to import: only for such grains

    orders = [np.argsort(part, kind="stable") for part in (first, second)]
    begin, end = (
        [np.searchsorted(part, shared, side=side, sorter=order)
         for part, order in zip((first, second), orders, strict=True)]
        for side in ("left", "right")
    )  # fmt: skip
    for k in range(len(shared)):
        one, two = (order[begin[s][k] : end[s][k]] for s, order in enumerate(orders))
        chosen = linear_sum_assignment(before[one] @ after[two].T, maximize=True)
        yield np.stack([one[chosen[0]], two[chosen[1]]], axis=1)


def follow_contacts(
    states: Iterable[tuple[Packing, IntArray]], rule: ContactRule
) -> Iterator[IdentifiedContacts]:
    """Contacts of successive states under a rule, which with ``keep`` looks back.

    A contact is made when the criterion says so. With ``keep`` it then lasts, force or not, as
    long as its gap is below ``keep`` in every state given; a made contact lasts in any case.

    Args:
        states: packings, each with its T of :func:`~granufab.fabric.lattice.lattice_changes`.
        rule: which contacts count.
    Raises:
        MissingData: a state lacks what the criterion needs.
        InvalidPacking: as for :func:`identify`.
    """
    return follow_seen((see_contacts(*state, rule) for state in states), rule)


def see_contacts(packing: Packing, change: IntArray, rule: ContactRule) -> SeenContacts:
    """What one state tells, whatever was before: states can be read in any order.

    Raises:
        MissingData, InvalidPacking: as for :func:`follow_contacts`.
    """
    made = identify(packing, select_contacts(packing, rule.criterion, reach=rule.reach), change)
    near = None
    if rule.keep is not None:
        pairs = select_contacts(packing, Criterion("gap", rule.keep), reach=rule.reach)
        near = identify(packing, pairs, change)
    counts_all = rule.z_definition == "z"
    support = None if counts_all else wall_support(packing, rule.criterion, reach=rule.reach)
    return SeenContacts(made=made, near=near, support=support)


def follow_seen(states: Iterable[SeenContacts], rule: ContactRule) -> Iterator[IdentifiedContacts]:
    """Contacts of successive states, of which each was seen alone."""
    known: IdentifiedContacts | None = None
    for seen in states:
        held = seen.made
        if seen.near is not None and known is not None:
            held = held.join(seen.near.select(persistent(known, seen.near)[1]))
        known = held
        yield _counted(held, seen.support, rule)


def _counted(
    contacts: IdentifiedContacts, support: IntArray | None, rule: ContactRule
) -> IdentifiedContacts:
    if rule.z_definition == "z":
        return contacts
    numbers = coordination(
        contacts.pair, contacts.grain_count, minimum=rule.minimum, support=support
    )
    return contacts.select(counted_contacts(contacts.pair, numbers, rule.z_definition))
