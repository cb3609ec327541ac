"""One grain among its contact neighbours: directions, angles between them, exclusions (Fig. 2b)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from granufab.errors import MissingData
from granufab.fabric.neighbours import branch_vectors
from granufab.packing import Array, Contacts, IntArray, Packing

__all__ = ["Environment", "environment", "opening_angle"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Environment:
    """A disk and its contact neighbours, in turn around it.

    Attributes:
        grain: index of the disk.
        neighbour: indices of its neighbours, shape (contact_count,).
        branch: from its centre to theirs [m], shape (contact_count, 2).
        angle: direction of the branches, rising [rad], shape (contact_count,).
        step: angle to the next neighbour; they sum to 2π [rad], shape (contact_count,).
        exclusion: smallest angle to the next neighbour that the sizes allow [rad], shaped alike:
            cos δθ = (ℓ² + ℓ'² − (R + R')²) / (2 ℓ ℓ') with branches ℓ, ℓ' and radii R, R' of the
            two neighbours, which then touch.
    """

    grain: int
    neighbour: IntArray
    branch: Array
    angle: Array
    step: Array
    exclusion: Array


def environment(packing: Packing, contacts: Contacts, grain: int) -> Environment:
    """The neighbours of a grain of a 2D packing, in turn.

    Args:
        packing: the state.
        contacts: its contacts that count.
        grain: index.
    Raises:
        MissingData: the grain has fewer than two contacts.
    """
    branch = branch_vectors(Packing(grains=packing.grains, contacts=contacts, cell=packing.cell))
    first, second = contacts.pair.T
    neighbour = np.concatenate([second[first == grain], first[second == grain]])
    links = np.concatenate([branch[first == grain], -branch[second == grain]])
    if len(neighbour) < 2:
        raise MissingData(f"grain {grain} has {len(neighbour)} contacts; an angle needs two")
    angle = np.mod(np.arctan2(links[:, 1], links[:, 0]), 2 * np.pi)
    order = np.argsort(angle)
    neighbour, links, angle = neighbour[order], links[order], angle[order]
    length = np.linalg.norm(links, axis=1)
    following = np.roll(length, -1)
    radius = packing.grains.radius[neighbour]
    touching = radius + np.roll(radius, -1)
    return Environment(
        grain=grain,
        neighbour=neighbour,
        branch=links,
        angle=angle,
        step=np.mod(np.roll(angle, -1) - angle, 2 * np.pi),
        exclusion=opening_angle(length, following, touching),
    )


def opening_angle(one: Array, other: Array, opposite: Array) -> Array:
    """Angle between two sides of a triangle, cos γ = (a² + b² − c²)/(2ab) [rad].

    Args:
        one: length a [m], any shape.
        other: length b [m].
        opposite: length c of the third side [m]; where it is too long the angle is π.
    """
    cosine = (one**2 + other**2 - opposite**2) / (2.0 * one * other)
    return np.arccos(np.clip(cosine, -1.0, 1.0))
