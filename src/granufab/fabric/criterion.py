"""Which of the listed pairs count as contacts: the choice that decides z and a."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidSettings
from granufab.fabric.neighbours import neighbours_within, walls_within
from granufab.packing import Array, Contacts, IntArray, Packing, require

__all__ = [
    "FORCE_FRACTION",
    "Criterion",
    "counted_pairs",
    "force_threshold",
    "mean_diameter",
    "normal_force",
    "parse_criterion",
    "select_contacts",
    "wall_support",
]

FORCE_FRACTION = 1e-6
"""A contact bears force above this share of the mean normal force."""

_ALLOWED = (
    "force, force:SHARE (of the mean normal force, for example force:0.001), "
    "gap:DELTA (mean diameters, for example gap:0.015) or listed"
)


@dataclass(frozen=True, slots=True)
class Criterion:
    """A rule that says which pairs are contacts.

    Attributes:
        kind: ``force`` (|f·n| above a share of its mean), ``gap`` or ``listed`` (all pairs).
        gap: largest surface distance of a contact [mean diameters], for ``gap`` only.
        share: of the mean normal force, above which a contact bears force [-], for ``force``.
    """

    kind: Literal["force", "gap", "listed"]
    gap: float = 0.0
    share: float = FORCE_FRACTION

    @property
    def text(self) -> str:
        """The words that :func:`parse_criterion` reads back."""
        if self.kind == "gap":
            return f"gap:{self.gap!r}"
        if self.kind == "force" and self.share != FORCE_FRACTION:
            return f"force:{self.share!r}"
        return self.kind


def parse_criterion(text: str | Criterion) -> Criterion:
    """Read a contact criterion from its words.

    Args:
        text: ``force`` (the share 10⁻⁶), ``force:x`` with 0 ≤ x ≤ 10, ``listed``, or ``gap:δ``
            with δ in mean diameters, 0 ≤ δ ≤ 1.
    Raises:
        InvalidSettings: any other text.
    """
    if isinstance(text, Criterion):
        return text
    words = str(text).strip()
    if words == "force":
        return Criterion("force")
    if words == "listed":
        return Criterion("listed")
    kind, colon, value = words.partition(":")
    if kind not in ("force", "gap") or not colon:
        raise InvalidSettings(f"criterion {text!r} is unknown; allowed: {_ALLOWED}")
    try:
        number = float(value)
    except ValueError:
        raise InvalidSettings(f"criterion {text!r}: {value!r} is no number; {_ALLOWED}") from None
    if kind == "force":
        if not 0.0 <= number <= 10.0:
            raise InvalidSettings(f"criterion {text!r}: the share of the mean must lie in 0..10")
        return Criterion("force", share=number)
    if not 0.0 <= number <= 1.0:
        raise InvalidSettings(f"criterion {text!r}: the gap must lie in 0..1 mean diameters")
    return Criterion("gap", number)


def mean_diameter(packing: Packing) -> float:
    """Mean grain diameter d = 2<R> [m], the unit of gaps and overlaps."""
    return 2.0 * float(packing.grains.radius.mean())


def normal_force(contacts: Contacts) -> Array:
    """Normal forces f·n [N], > 0 in compression, shape (contact_count,).

    Raises:
        MissingData: the contacts carry no forces.
    """
    force = require(contacts.force, "contact forces", "use the criterion gap:DELTA or listed")
    return np.einsum("ci,ci->c", force, contacts.normal)


def select_contacts(
    packing: Packing, criterion: str | Criterion = "force", *, reach: float | None = None
) -> Contacts:
    """The pairs of a packing that count as contacts.

    ``force``: |f·n| > 10⁻⁶ <f_n>, the mean over contacts with f_n > 0; ``force:x``: the share x
    instead of 10⁻⁶. ``gap:δ``: surface distance < δ d. ``listed``: every pair the source lists.

    Args:
        packing: needs contact forces for ``force``, a contact list for ``listed``.
        criterion: the rule or its words.
        reach: the list is known to hold every pair up to this gap [mean diameters]. Without
            it, or where it is below δ, ``gap:δ`` finds the pairs from positions and radii,
            and they carry no forces.
    Returns:
        Selected contacts, in the order of the list.
    Raises:
        MissingData: the packing lacks what the criterion needs.
        InvalidSettings: the criterion is unknown.
    """
    rule = parse_criterion(criterion)
    contacts = packing.contacts
    if rule.kind == "gap":
        diameter = mean_diameter(packing)
        if contacts is not None and contacts.gap is not None and _complete(rule, reach):
            return contacts.select(counted_pairs(contacts, rule, diameter))
        return neighbours_within(packing, rule.gap * diameter)
    contacts = require(contacts, "contacts", "use the criterion gap:DELTA")
    if rule.kind == "listed":
        return contacts
    return contacts.select(counted_pairs(contacts, rule, mean_diameter(packing)))


def counted_pairs(contacts: Contacts, criterion: Criterion, diameter: float) -> NDArray[np.bool_]:
    """Which pairs of a list count as contacts, shape (contact_count,).

    Args:
        contacts: the list; for ``gap`` it holds every pair up to that gap.
        criterion: the rule.
        diameter: mean diameter of the grains [m], in which gaps are given.
    Raises:
        MissingData: the list lacks the forces or gaps that the criterion needs.
    """
    if criterion.kind == "listed":
        return np.ones(contacts.count, dtype=bool)
    if criterion.kind == "gap":
        return require(contacts.gap, "gaps", "use the criterion force") < criterion.gap * diameter
    force = normal_force(contacts)
    return np.abs(force) > force_threshold(force, criterion.share)


def wall_support(
    packing: Packing, criterion: str | Criterion = "force", *, reach: float | None = None
) -> IntArray | None:
    """Number of wall contacts of each grain under a criterion.

    Args:
        packing: the state.
        criterion: the rule or its words, as for :func:`select_contacts`.
        reach: as for :func:`select_contacts`.
    Returns:
        Shape (grain_count,), or None where no grain touches a wall.
    Raises:
        InvalidSettings: the criterion is unknown.
    """
    rule = parse_criterion(criterion)
    walls = packing.wall_contacts
    if rule.kind == "gap":
        widest = rule.gap * mean_diameter(packing)
        if walls is not None and _complete(rule, reach):
            grain = walls.grain[walls.gap < widest]
        else:
            grain = walls_within(packing, widest)
    elif walls is None:
        return None
    elif rule.kind == "listed":
        grain = walls.grain
    else:
        force = np.einsum("ci,ci->c", walls.force, walls.normal)
        grain = walls.grain[np.abs(force) > _wall_threshold(packing, force, rule.share)]
    return np.bincount(grain, minlength=packing.grains.count) if len(grain) else None


def _complete(rule: Criterion, reach: float | None) -> bool:
    return reach is not None and reach >= rule.gap


def force_threshold(force: Array, share: float = FORCE_FRACTION) -> float:
    """Normal force above which a contact bears force: a share of the mean over f_n > 0 [N].

    Args:
        force: normal forces or impulses, shape (contact_count,).
        share: of the mean [-].
    """
    pushing = force[force > 0]
    if not len(pushing):
        pushing = np.abs(force[force != 0])
    return share * float(pushing.mean()) if len(pushing) else 0.0


def _wall_threshold(packing: Packing, wall_force: Array, share: float) -> float:
    contacts = packing.contacts
    if contacts is not None and contacts.force is not None:
        force = normal_force(contacts)
        if force.any():
            return force_threshold(force, share)
    return force_threshold(wall_force, share)
