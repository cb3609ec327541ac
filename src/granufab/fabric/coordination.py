"""Coordination numbers: three definitions, and the grains and contacts each of them counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidSettings
from granufab.fabric.rattlers import backbone, contact_number
from granufab.packing import IntArray

__all__ = [
    "Coordination",
    "ZDefinition",
    "check_definition",
    "coordination",
    "counted_contacts",
    "counted_grains",
]

ZDefinition = Literal["z", "z_backbone", "z_mechanical"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coordination:
    """The three coordination numbers of a contact network.

    Attributes:
        z: 2 N_c/N_p, all grains [-].
        z_backbone: 2 N_c/N_b over the network without rattlers [-]; 0 where nothing is held.
        z_mechanical: (2 N_c − N_1)/(N_p − N_0 − N_1) [-] (Thornton); 0 where nothing is held.
        rattler_fraction: 1 − N_b/N_p [-].
        held: grains of the backbone, shape (grain_count,).
        touched: grains with two contacts or more, before any removal, shape (grain_count,).
    """

    z: float
    z_backbone: float
    z_mechanical: float
    rattler_fraction: float
    held: NDArray[np.bool_]
    touched: NDArray[np.bool_]

    def value(self, definition: ZDefinition) -> float:
        """The coordination number of one definition [-]."""
        return float(getattr(self, check_definition(definition)))


def check_definition(definition: str) -> ZDefinition:
    """The definition, if it is one.

    Raises:
        InvalidSettings: it is none of z, z_backbone, z_mechanical.
    """
    if definition not in get_args(ZDefinition):
        raise InvalidSettings(
            f"z_definition {definition!r} is unknown; allowed: {', '.join(get_args(ZDefinition))}"
        )
    return cast(ZDefinition, definition)


def coordination(
    pair: IntArray, grain_count: int, *, minimum: int = 2, support: IntArray | None = None
) -> Coordination:
    """Mean numbers of grain–grain contacts per grain, in the three usual senses.

    z = 2 N_c/N_p; z_backbone = 2 N_c/N_b after rattlers are removed; z_mechanical =
    (2 N_c − N_1)/(N_p − N_0 − N_1) with N_0, N_1 the grains with no or one contact.
    Walls hold grains, but their contacts are not counted in any z.

    Args:
        pair: grain indices of the contacts, shape (contact_count, 2).
        grain_count: number of grains.
        minimum: fewest contacts that hold a grain (:func:`~granufab.fabric.minimum_contacts`).
        support: wall contacts of each grain, shape (grain_count,).
    """
    pair = np.asarray(pair)
    held = backbone(pair, grain_count, minimum=minimum, support=support)
    touched = contact_number(pair, grain_count, support=support) >= 2
    held_count, touched_count = int(held.sum()), int(touched.sum())
    held_contacts = int((held[pair[:, 0]] & held[pair[:, 1]]).sum())
    return Coordination(
        z=2.0 * len(pair) / grain_count,
        z_backbone=2.0 * held_contacts / held_count if held_count else 0.0,
        # A contact counts once for each of its ends that is no N_1 grain.
        z_mechanical=float(touched[pair].sum()) / touched_count if touched_count else 0.0,
        rattler_fraction=1.0 - held_count / grain_count,
        held=held,
        touched=touched,
    )


def counted_contacts(
    pair: IntArray, numbers: Coordination, definition: ZDefinition
) -> NDArray[np.bool_]:
    """Contacts that a definition of z counts, shape (contact_count,).

    All for z; those between grains of the backbone for z_backbone; those with at least one
    grain of two or more contacts for z_mechanical.
    """
    if check_definition(definition) == "z":
        return np.ones(len(pair), dtype=bool)
    first, second = pair[:, 0], pair[:, 1]
    if definition == "z_backbone":
        return numbers.held[first] & numbers.held[second]
    return numbers.touched[first] | numbers.touched[second]


def counted_grains(numbers: Coordination, definition: ZDefinition) -> int:
    """Number of grains that a definition of z divides by."""
    if check_definition(definition) == "z":
        return len(numbers.held)
    return int((numbers.held if definition == "z_backbone" else numbers.touched).sum())
