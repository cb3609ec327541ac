r"""Detailed balance of contacts by direction, in whole numbers [Radjai2012, eq. 16].

Between two states each contact is gained, lost, or persistent and turned. In every bin

    after = before + gain − loss + current_in − current_out

holds exactly: the integral over an interval of :math:`\partial E/\partial t = I^+ - I^- -
\partial J/\partial\theta`. J is the net number of persistent contacts that cross a bin edge
towards growing θ; it enters a bin through its lower edge and leaves through its upper one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from granufab.errors import InvalidPacking
from granufab.fabric.affine import affine_current, mean_gradient
from granufab.fabric.attribution import attribute, fabric_term
from granufab.fabric.contact_identity import (
    ContactRule,
    IdentifiedContacts,
    follow_contacts,
    persistent,
)
from granufab.fabric.coordination import ZDefinition, check_definition
from granufab.fabric.criterion import Criterion, parse_criterion
from granufab.fabric.direction_bins import DirectionBins
from granufab.fabric.lattice import lattice_changes
from granufab.history import Frame, packing_of
from granufab.packing import Array, Packing

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["balance", "balance_attributes", "balance_coordinates", "balance_item", "count_balance"]

_AXES = {2: np.array([1.0, 0.0]), 3: np.array([0.0, 0.0, 1.0])}
_BINS = {
    2: "equal angles over half a turn, counter-clockwise from the direction; edge 0 is the last",
    3: "equal solid angles over the polar angle from the direction, summed over azimuth",
}
_TEXT: dict[str, tuple[tuple[str, ...], str, str]] = {
    "before": (("bin",), "-", "contacts at the start"),
    "after": (("bin",), "-", "contacts at the end"),
    "gain": (("bin",), "-", "contacts gained"),
    "loss": (("bin",), "-", "contacts lost"),
    "current_in": (("bin",), "-", "net persistent contacts in through the lower edge"),
    "current_out": (("bin",), "-", "net persistent contacts out through the upper edge"),
    "current": (("edge",), "-", "net persistent contacts across the edge, growing θ positive"),
    "crossings": (("edge",), "-", "persistent contacts across the edge, either way"),
    "current_affine": (("edge",), "-", "net contacts across the edge in the mean flow"),
    "gained": ((), "-", "contacts gained"),
    "lost": ((), "-", "contacts lost"),
    "persistent": ((), "-", "persistent contacts"),
    "z_before": ((), "-", "coordination number of the counted contacts at the start"),
    "z_after": ((), "-", "coordination number of the counted contacts at the end"),
    "z_gain": ((), "-", "change of z by gain"),
    "z_loss": ((), "-", "change of z by loss"),
    "z_rotation": ((), "-", "change of z by rotation"),
    "az_before": ((), "-", "z a' at the start"),
    "az_after": ((), "-", "z a' at the end"),
    "az_gain": ((), "-", "change of z a' by gain"),
    "az_loss": ((), "-", "change of z a' by loss"),
    "az_rotation": ((), "-", "change of z a' by rotation of persistent contacts"),
    "az_rotation_affine": ((), "-", "the same if they turned with the mean flow"),
    "z_gain_error": ((), "-", "standard error of z_gain, Poisson"),
    "z_loss_error": ((), "-", "standard error of z_loss, Poisson"),
    "az_gain_error": ((), "-", "standard error of az_gain, Poisson"),
    "az_loss_error": ((), "-", "standard error of az_loss, Poisson"),
    "az_rotation_error": ((), "-", "standard error of az_rotation, contacts independent"),
}


def balance(
    before: Frame | Packing,
    after: Frame | Packing,
    *,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z",
    bins: int = 18,
    direction: Array | None = None,
    keep: float | None = None,
    minimum: int = 2,
    reach: float | None = None,
) -> xr.Dataset:
    """Contacts gained, lost and turned between two states, by direction, closing in integers.

    Every contact of the criterion counts by default (``z``): the backbone changes where contacts
    far away appear, so that with ``z_backbone`` contacts would be gained and lost that neither
    opened nor closed. z here is 2N_c/N with all N grains, whichever contacts count.

    Args:
        before: first state; a frame knows its remaps, two packings are compared by their cells.
        after: second state, the same grains by ``number``, positions not wrapped in between.
        criterion: ``force``, ``gap:δ`` or ``listed``.
        z_definition: whose contacts count.
        bins: equal angles over [0, π) in 2D, equal solid angles of the half space in 3D.
        direction: where θ starts, and axis of a', shape (D,); default the frame's contraction
            axis, else x in 2D and z in 3D.
        keep: a contact of the first state lasts in the second while its gap is below this [mean
            diameters], whatever the criterion says.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
    Returns:
        Integers over ``bin``: before, after, gain, loss, current_in, current_out (signed: net
        through the lower and the upper edge); over ``edge``: current, crossings, and
        current_affine of the mean flow; gained, lost, persistent; z and z a' at both ends and
        their changes by gain, loss and rotation with errors (their sums are exact).
    Raises:
        InvalidPacking: the states hold different grains, or list a contact twice.
        MissingData: a state lacks what the criterion needs.
        InvalidSettings: an unknown criterion or definition, bad bins, direction or keep.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    rule = ContactRule(
        criterion=parse_criterion(criterion),
        keep=keep,
        z_definition=check_definition(z_definition),
        minimum=minimum,
        reach=reach,
    )
    packings = packing_of(before), packing_of(after)
    dimension = packings[0].dimension
    if packings[1].dimension != dimension:
        raise InvalidPacking("one state is 2D, the other 3D; a balance needs the same grains")
    if direction is None:
        direction = before.direction if isinstance(before, Frame) else _AXES[dimension]
    chosen = DirectionBins.of(direction, bins, dimension)
    states = zip(packings, lattice_changes((before, after)), strict=True)
    first, second = follow_contacts(states, rule)
    data = {n: balance_item(n, v) for n, v in count_balance(first, second, chosen).items()}
    attributes = balance_attributes(rule, chosen, first.grain_count)
    return xr.Dataset(data, coords=balance_coordinates(chosen), attrs=attributes)


def count_balance(
    before: IdentifiedContacts, after: IdentifiedContacts, bins: DirectionBins
) -> dict[str, Any]:
    """Numbers of one interval; names and units as in :func:`balance_item`.

    Raises:
        InvalidPacking: the two states hold different grains.
    """
    rows, others = persistent(before, after)
    lost = np.delete(before.normal, rows, axis=0)
    gained = np.delete(after.normal, others, axis=0)
    turned = before.normal[rows], after.normal[others]
    forward, backward = bins.crossings(*turned)
    current = forward - backward
    gradient = mean_gradient(before, after)
    affine = np.full(bins.count + 1, math.nan)
    if gradient is not None:
        both = [affine_current(state.normal, bins, gradient) for state in (before, after)]
        affine = 0.5 * (both[0] + both[1])
    share, d = 2.0 / before.grain_count, bins.direction
    values = {
        "before": bins.histogram(before.normal),
        "after": bins.histogram(after.normal),
        "gain": bins.histogram(gained),
        "loss": bins.histogram(lost),
        "current_in": current[:-1],
        "current_out": current[1:],
        "current": current,
        "crossings": forward + backward,
        "current_affine": affine,
        "gained": len(gained),
        "lost": len(lost),
        "persistent": len(rows),
        "z_before": share * before.count,
        "z_after": share * after.count,
        "az_before": share * float(fabric_term(before.normal, d).sum()),
        "az_after": share * float(fabric_term(after.normal, d).sum()),
    }
    return values | attribute(
        gained, lost, turned, direction=d, grain_count=before.grain_count, gradient=gradient
    )


def balance_item(name: str, value: Any, *, over: str = "") -> tuple:
    """A variable of the balance with its dimensions, after ``over`` if given, and its units."""
    dims, units, text = _TEXT[name]
    dims = (over, *dims) if over else dims
    return dims, np.asarray(value), {"units": units, "long_name": text}


def balance_coordinates(bins: DirectionBins) -> dict[str, tuple]:
    """Directions of the bins and of their edges [rad]."""
    start = "from the direction" if bins.dimension == 2 else "polar angle from the direction"
    return {
        "theta": ("bin", bins.centres, {"units": "rad", "long_name": f"{start}, middle"}),
        "theta_edge": ("edge", bins.edges, {"units": "rad", "long_name": f"{start}, edge"}),
    }


def balance_attributes(rule: ContactRule, bins: DirectionBins, grain_count: int) -> dict[str, Any]:
    """What was counted, and how."""
    return {
        "criterion": rule.criterion.text,
        "keep": "none" if rule.keep is None else f"gap:{rule.keep!r}",
        "z_definition": rule.z_definition,
        "minimum_contacts": rule.minimum,
        "dimension": bins.dimension,
        "direction": bins.direction,
        "grain_count": grain_count,
        "bin_measure": bins.measure,
        "bins": _BINS[bins.dimension],
        "closure": "after = before + gain - loss + current_in - current_out",
    }
