"""The contact network that a criterion and a definition of z pick from a packing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granufab.fabric.coordination import (
    Coordination,
    ZDefinition,
    check_definition,
    coordination,
    counted_contacts,
    counted_grains,
)
from granufab.fabric.criterion import Criterion, parse_criterion, select_contacts, wall_support
from granufab.packing import Contacts, Packing

__all__ = ["Network", "select_network"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Network:
    """Contacts and grains in use, with the coordination numbers of the whole state.

    Attributes:
        contacts: contacts that the definition of z counts.
        grain_count: number of grains that it divides by.
        counted: these grains, shape (number of grains of the packing,).
        z: coordination number in use [-].
        coordination: all three definitions, over every contact of the criterion.
        contact_count: contacts of the criterion, counted by z or not.
        criterion: the criterion.
        z_definition: the definition of z.
    """

    contacts: Contacts
    grain_count: int
    counted: NDArray[np.bool_]
    z: float
    coordination: Coordination
    contact_count: int
    criterion: Criterion
    z_definition: ZDefinition


def select_network(
    packing: Packing,
    *,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    reach: float | None = None,
) -> Network:
    """Contacts under a criterion, reduced to those that a definition of z counts.

    Use it before :func:`~granufab.fabric.fabric_tensor` and
    :func:`~granufab.fabric.orientation`, so that z, F and E speak of the same contacts.

    Args:
        packing: the state.
        criterion: ``force``, ``gap:δ`` or ``listed``.
        z_definition: ``z`` (all grains), ``z_backbone`` or ``z_mechanical``.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
    Raises:
        MissingData: the packing lacks what the criterion needs.
        InvalidSettings: an unknown criterion or definition.
    """
    definition, rule = check_definition(z_definition), parse_criterion(criterion)
    contacts = select_contacts(packing, rule, reach=reach)
    support = wall_support(packing, rule, reach=reach)
    count = packing.grains.count
    numbers = coordination(contacts.pair, count, minimum=minimum, support=support)
    everything = np.ones(count, dtype=bool)
    counted = {"z": everything, "z_backbone": numbers.held, "z_mechanical": numbers.touched}
    return Network(
        contacts=contacts.select(counted_contacts(contacts.pair, numbers, definition)),
        grain_count=counted_grains(numbers, definition),
        counted=counted[definition],
        z=numbers.value(definition),
        coordination=numbers,
        contact_count=contacts.count,
        criterion=rule,
        z_definition=definition,
    )
