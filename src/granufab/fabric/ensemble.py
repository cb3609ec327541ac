"""Contacts of one or several states pooled for statistics, and their bootstrap."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion, parse_criterion
from granufab.fabric.neighbours import branch_vectors
from granufab.fabric.network import Network, select_network
from granufab.fabric.orientation import symmetry_axis
from granufab.fabric.tensors import fabric_tensor, major_direction
from granufab.history import Frame, Run, packing_of
from granufab.packing import Array, IntArray, Packing

__all__ = [
    "ContactSample",
    "States",
    "late_frames",
    "pool_contacts",
    "resample",
    "state_list",
    "unit_sums",
]

States = Packing | Frame | Sequence[Packing | Frame]
"""One state or several: packings, or the frames of a run."""

_FEWEST_STATES = 8
_DRAWS_AT_ONCE = 25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactSample:
    """Contacts in use of one or several states, one after another.

    Attributes:
        normal: [-], shape (contact_count, D).
        branch: r_j − r_i [m], shape (contact_count, D).
        force: on grain j [N], shape (contact_count, D), or None where a state has none.
        state: index of the state of each contact, ascending, shape (contact_count,).
        packings: the states.
        networks: what the criterion and the definition of z picked from each.
        axis: unit vector that angles and signed anisotropies refer to, shape (D,).
        axis_origin: where the axis comes from, in words.
    """

    normal: Array
    branch: Array
    force: Array | None
    state: IntArray
    packings: tuple[Packing, ...]
    networks: tuple[Network, ...]
    axis: Array
    axis_origin: str

    @property
    def count(self) -> int:
        """Number of contacts."""
        return len(self.normal)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.normal.shape[1]

    @property
    def length(self) -> Array:
        """Branch lengths ℓ [m], shape (contact_count,)."""
        return np.linalg.norm(self.branch, axis=1)

    @property
    def by_state(self) -> bool:
        """Whether the bootstrap resamples whole states instead of contacts."""
        return len(self.packings) >= _FEWEST_STATES

    @property
    def attributes(self) -> dict[str, Any]:
        """Definitions that every result made from this sample carries."""
        network = self.networks[0]
        unit = "states" if self.by_state else "contacts"
        return {
            "criterion": network.criterion.text,
            "z_definition": network.z_definition,
            "contact_count": self.count,
            "state_count": len(self.packings),
            "dimension": self.dimension,
            "axis": self.axis,
            "axis_origin": self.axis_origin,
            "bootstrap": f"over {unit}, taken as independent",
            "bin_errors": "contacts taken as independent; states of one path share contacts",
        }


def state_list(states: States) -> list[Packing | Frame]:
    """The states as a list.

    Raises:
        MissingData: there are none, or they differ in dimension.
    """
    listed = [states] if isinstance(states, Packing | Frame) else list(states)
    if not listed:
        raise MissingData("there are no states to measure")
    dimensions = {packing_of(state).dimension for state in listed}
    if len(dimensions) > 1:
        raise MissingData("the states are of different dimension, so they cannot be pooled")
    return listed


def late_frames(run: Run, *, share: float = 1 / 3, stage: int = -1) -> list[Frame]:
    """Frames of the last part of a stage, for averages over the critical state.

    Args:
        run: with recorded frames.
        share: part of the stage's strain, counted from its end, 0 < share ≤ 1.
        stage: index of the stage; −1 is the last one.
    Raises:
        MissingData: the run has no frame of that stage.
        InvalidSettings: the share lies outside 0..1.
    """
    if not 0.0 < share <= 1.0:
        raise InvalidSettings(f"share is {share!r}, must lie in 0..1")
    frames = list(run.frames)
    stages = sorted({frame.stage for frame in frames})
    wanted = stages[stage] if stage < 0 and -stage <= len(stages) else stage
    chosen = [frame for frame in frames if frame.stage == wanted]
    if not chosen:
        raise MissingData(f"run {run.name!r} has no frame of stage {stage}; it has {stages}")
    first, last = chosen[0].eps_q_total, chosen[-1].eps_q_total
    start = last - share * (last - first) - 1e-9
    return [frame for frame in chosen if frame.eps_q_total >= start]


def pool_contacts(
    states: States,
    *,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    minimum: int = 2,
    reach: float | None = None,
    axis: Array | None = None,
) -> ContactSample:
    """Contacts in use of all states, with the axis that their angles refer to.

    Args:
        states: a packing, a frame, or several of one dimension.
        criterion: ``force``, ``gap:δ`` or ``listed``.
        z_definition: the contacts that this z counts are pooled.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
        axis: of any length, shape (D,); default the loading direction of the first frame, and
            for packings the principal axis of the pooled fabric (2D major direction, 3D
            :func:`~granufab.fabric.symmetry_axis`).
    Raises:
        MissingData: no states, no contacts, or what the criterion needs is not there.
        InvalidSettings: an unknown criterion or definition, or an axis of wrong shape.
    """
    listed = state_list(states)
    rule = parse_criterion(criterion)
    packings = tuple(packing_of(state) for state in listed)
    networks = tuple(
        select_network(
            packing, criterion=rule, z_definition=z_definition, minimum=minimum, reach=reach
        )
        for packing in packings
    )
    normal = np.concatenate([network.contacts.normal for network in networks])
    if not len(normal):
        raise MissingData("there are no contacts under this criterion")
    forces = [network.contacts.force for network in networks]
    known = [force for force in forces if force is not None]
    unit, origin = _axis(axis, listed[0], normal)
    return ContactSample(
        normal=normal,
        branch=np.concatenate(
            [
                branch_vectors(replace(packing, contacts=network.contacts))
                for packing, network in zip(packings, networks, strict=True)
            ]
        ),
        force=np.concatenate(known) if len(known) == len(forces) else None,
        state=np.repeat(np.arange(len(networks)), [network.contacts.count for network in networks]),
        packings=packings,
        networks=networks,
        axis=unit,
        axis_origin=origin,
    )


def unit_sums(sample: ContactSample, statistics: Callable[[slice], Array]) -> Array:
    """Additive statistics of each unit of the bootstrap, shape (unit_count, statistic_count).

    Args:
        sample: units are its states where there are at least 8, else its contacts.
        statistics: rows of a slice of contacts, shape (its contacts, statistic_count).
    """
    if not sample.by_state:
        return statistics(slice(0, sample.count))
    edges = np.searchsorted(sample.state, np.arange(len(sample.packings) + 1))
    return np.array(
        [
            statistics(slice(int(first), int(last))).sum(axis=0)
            for first, last in itertools.pairwise(edges)
        ]
    )


def resample(sums: Array, replicas: int, seed: int = 0) -> Array:
    """Sums over units drawn with replacement, shape (replicas, statistic_count).

    Args:
        sums: additive statistics, shape (unit_count, statistic_count).
        replicas: number of draws.
        seed: of the draws.
    """
    generator, count = np.random.default_rng(seed), len(sums)
    rows = []
    for first in range(0, replicas, _DRAWS_AT_ONCE):
        weight = np.empty((min(_DRAWS_AT_ONCE, replicas - first), count))
        for draw in weight:
            draw[:] = np.bincount(generator.integers(0, count, count), minlength=count)
        rows.append(weight @ sums)
    return np.concatenate(rows)


def _axis(given: Iterable[float] | None, first: Packing | Frame, normal: Array) -> tuple:
    dimension = normal.shape[1]
    if given is not None:
        axis, origin = np.asarray(given, dtype=np.float64), "given"
    elif isinstance(first, Frame):
        axis, origin = np.asarray(first.direction), "loading direction of the first frame"
    elif dimension == 2:
        axis, origin = major_direction(fabric_tensor(normal)), "major direction of the fabric"
    else:
        axis, origin = symmetry_axis(normal), "symmetry axis of the fabric"
    if axis.shape != (dimension,) or not 0.0 < np.linalg.norm(axis) < math.inf:
        raise InvalidSettings(
            f"axis must be a non-zero vector of {dimension} numbers, got {axis.tolist()}"
        )
    return axis / np.linalg.norm(axis), origin
