"""Rattlers: grains that too few contacts hold, removed again and again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidSettings
from granufab.packing import IntArray

__all__ = ["RATTLER_RULES", "backbone", "contact_number", "minimum_contacts"]

RATTLER_RULES = ("frictional", "frictionless", "below-3", "below-4")
"""Named conventions of :func:`minimum_contacts`."""


def minimum_contacts(rule: str | int, dimension: int) -> int:
    """Fewest contacts of a grain that is no rattler.

    ``frictional``: 2 in any dimension (friction holds even a sphere on two contacts);
    ``frictionless``: D + 1; ``below-3`` and ``below-4``: 3 and 4. Use one rule over a whole
    path, so that z does not jump where friction is switched on.

    Args:
        rule: a name of :data:`RATTLER_RULES`, or the number itself.
        dimension: 2 or 3.
    Raises:
        InvalidSettings: the rule is unknown.
    """
    numbers = {"frictional": 2, "frictionless": dimension + 1, "below-3": 3, "below-4": 4}
    if isinstance(rule, str) and rule in numbers:
        return numbers[rule]
    if isinstance(rule, int | np.integer) and rule >= 1:
        return int(rule)
    raise InvalidSettings(
        f"rattler rule {rule!r} is unknown; allowed: {', '.join(RATTLER_RULES)} or a number >= 1"
    )


def contact_number(
    pair: IntArray, grain_count: int, *, support: IntArray | None = None
) -> IntArray:
    """Number of contacts of each grain, shape (grain_count,).

    Args:
        pair: grain indices, shape (contact_count, 2); a grain's contact with its own image
            counts twice.
        grain_count: number of grains.
        support: further contacts of each grain (walls), shape (grain_count,).
    """
    number = np.bincount(np.ravel(pair), minlength=grain_count)
    return number if support is None else number + support


def backbone(
    pair: IntArray, grain_count: int, *, minimum: int = 2, support: IntArray | None = None
) -> NDArray[np.bool_]:
    """Grains that remain when those with fewer than ``minimum`` contacts are removed repeatedly.

    Args:
        pair: grain indices of the force-bearing contacts, shape (contact_count, 2).
        grain_count: number of grains.
        minimum: fewest contacts that hold a grain (:func:`minimum_contacts`).
        support: further contacts of each grain that never vanish (walls), shape (grain_count,).
    Returns:
        True for grains of the backbone, False for rattlers, shape (grain_count,).
    """
    pair = np.asarray(pair)
    number = contact_number(pair, grain_count, support=support)
    held = number >= minimum
    while True:
        keep = held[pair[:, 0]] & held[pair[:, 1]]
        if keep.all():
            return held
        number = number - np.bincount(np.ravel(pair[~keep]), minlength=grain_count)
        pair = pair[keep]
        held = held & (number >= minimum)
