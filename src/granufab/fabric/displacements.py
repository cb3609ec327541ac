"""Motion between recorded states, told apart into affine and non-affine parts.

A sheared cell may be remapped: the same lattice is then described by other vectors. Lattice
vectors M = C·T⁻¹ (T the accumulated remap) are followed here instead, so that the affine motion
between two states is F = M_after M_before⁻¹ whatever happened to the cell in between.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from granufab.errors import InvalidPacking, InvalidSettings
from granufab.fabric.criterion import mean_diameter
from granufab.fabric.lattice import lattice_change, lattice_remap
from granufab.history import Frame, FrameSource, Run, packing_of
from granufab.packing import Array, Cell, Packing, require

__all__ = ["States", "Track", "follow", "mean_motion", "nonaffine_displacement", "select_states"]

State = Packing | Frame
States = Run | FrameSource | Sequence[State] | Iterable[State] | State
"""A run, its frames, packings, an iterator over them, or one of them."""

_UNEVEN = 0.05


def nonaffine_displacement(before: State, after: State) -> Array:
    r"""Displacement of each grain less the affine motion of the cell.

    :math:`u'_i = r_i^{after} - F r_i^{before}` with F = M_after M_before⁻¹, M the lattice
    vectors followed through remaps of the cell. Positions may be wrapped or not: the image
    nearest to the affine motion is taken. In periodic directions the mean is zero (a periodic
    sample has no rest frame).

    Args:
        before: first state, with a cell.
        after: second state, the same grains. Frames tell the remap between them; for bare
            packings it is found from the cells, which needs a strain below about a half.
    Returns:
        [m], shape (grain_count, D).
    Raises:
        InvalidPacking: the two states hold different grains or walls.
        MissingData: a state has no cell.
    """
    first = _lattice(before, None)
    last = _lattice(after, first)
    step = _step(before, after, first, last)
    return _without_drift(step, packing_of(before)) @ last.T


def mean_motion(before: State, after: State) -> Packing:
    r"""Mean velocities over the interval between two states, on the state half way.

    Contact Dynamics' instantaneous velocities jump; these do not. Grains lie at the middle of
    their old and new positions; the cell's rate is :math:`L = 2(F-1)(F+1)^{-1}/Δt` and the
    velocities are the fluctuations :math:`2(F+1)^{-1}u'/Δt`, so that L·r + c is the mean velocity
    exactly.

    Args:
        before: first state.
        after: second state; see :func:`nonaffine_displacement`.
    Returns:
        Grains with velocities and cell, without contacts. Where the states tell no times,
        the interval counts as the unit of time.
    Raises:
        InvalidPacking: the two states hold different grains or walls.
        MissingData: a state has no cell.
    """
    old, new = packing_of(before), packing_of(after)
    first = _lattice(before, None)
    last = _lattice(after, first)
    step = _step(before, after, first, last)
    place = _fractions(old, first)
    origin = 0.5 * (_origin(old) + _origin(new))
    position = place @ first.T + (place + step) @ last.T
    growth = last @ np.linalg.inv(first)
    identity = np.eye(old.dimension)
    half = np.linalg.inv(growth + identity)
    elapsed = (new.time or 0.0) - (old.time or 0.0)
    interval = elapsed if elapsed > 0 else 1.0
    cell = require(new.cell, "cell lengths")
    return Packing(
        grains=replace(
            old.grains,
            position=0.5 * position + origin,
            velocity=2.0 / interval * _without_drift(step, old) @ (half @ last).T,
            spin=None,
        ),
        cell=Cell(
            # The newest basis: as short as the source keeps it.
            matrix=0.5 * (cell.matrix + np.linalg.solve(growth, cell.matrix)),
            periodic=cell.periodic,
            origin=origin,
            rate=2.0 / interval * (growth - identity) @ half,
        ),
        time=None if old.time is None else old.time + 0.5 * elapsed,
        source=old.source,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Positions of the grains over several states, through images and remaps.

    Attributes:
        place: coordinates along the followed lattice vectors, continuous in time [-],
            shape (state_count, grain_count, D).
        matrix: followed lattice vectors as columns [m], shape (state_count, D, D).
        strain: ∫|dε_q| [-], shape (state_count,).
        velocity: fluctuations of the velocity [m/s] where every state has them, as ``place``.
        deviatoric_rate: ε̇_q of the cell [1/s], shape (state_count,).
        periodic: per axis.
        diameter: mean diameter [m].
    """

    place: Array
    matrix: Array
    strain: Array
    velocity: Array | None
    deviatoric_rate: Array
    periodic: tuple[bool, ...]
    diameter: float

    def displacement(self, start: int, end: int) -> Array:
        """Non-affine displacement between two states [m], shape (grain_count, D)."""
        step = self.place[end] - self.place[start]
        return _centred(step, self.periodic) @ self.matrix[end].T

    @property
    def interval(self) -> float:
        """Strain between two states [-]."""
        return float(np.diff(self.strain).mean())


def follow(states: States, *, stage: int | None = None, strain: Range = None) -> Track:
    """Follow the grains over states at equal intervals of strain; contacts are not kept.

    A last state at another interval than the rest (the end of a stage) is left out.

    Args:
        states: a run, frames or packings, at least two.
        stage: keep the frames of this stage.
        strain: keep the frames with ∫|dε_q| in this range.
    Raises:
        InvalidSettings: fewer than two states, several stages, or uneven intervals.
        InvalidPacking: two states hold different grains or walls.
        MissingData: a state has no cell.
    """
    chosen = select_states(states, stage=stage, strain=strain)
    before = next(chosen, None)
    if before is None:
        raise InvalidSettings("no state is in the wanted stage and range of strain")
    matrices = [_lattice(before, None)]
    places = [_fractions(packing_of(before), matrices[0])]
    walked = [before.eps_q_total if isinstance(before, Frame) else 0.0]
    packings = [replace(packing_of(before), contacts=None, wall_contacts=None)]
    for after in chosen:
        matrices.append(_lattice(after, matrices[-1]))
        places.append(places[-1] + _step(before, after, *matrices[-2:]))
        walked.append(_walked(after, walked[-1], *matrices[-2:]))
        packings.append(replace(packing_of(after), contacts=None, wall_contacts=None))
        before = after
    keep = _even(np.array(walked))
    velocities = [p.grains.velocity for p in packings[:keep]]
    known = [v for v in velocities if v is not None]
    cells = [require(p.cell, "cell lengths") for p in packings[:keep]]
    return Track(
        place=np.array(places[:keep]),
        matrix=np.array(matrices[:keep]),
        strain=np.array(walked[:keep]),
        velocity=np.array(known) if len(known) == keep else None,
        deviatoric_rate=np.array([deviatoric(np.asarray(cell.rate)) for cell in cells]),
        periodic=cells[0].periodic,
        diameter=mean_diameter(packings[0]),
    )


Range = tuple[float, float] | None


def select_states(
    states: States, *, stage: int | None = None, strain: Range = None
) -> Iterator[State]:
    """States one after another, read only when asked for; frames of one stage.

    Args:
        states: a run, frames, packings, or one of them.
        stage: keep the frames of this stage.
        strain: keep the frames with ∫|dε_q| in this range, ends included.
    Raises:
        InvalidSettings: frames of several stages and no ``stage``; a stage or range for
            packings, which do not know them.
    """
    seen: int | None = None
    for state in _each(states):
        if not isinstance(state, Frame):
            if stage is not None or strain is not None:
                raise InvalidSettings("stage and strain select frames; packings know neither")
            yield state
            continue
        slack = 1e-9
        inside = strain is None or strain[0] - slack <= state.eps_q_total <= strain[1] + slack
        if not inside or (stage is not None and state.stage != stage):
            continue
        if seen is not None and state.stage != seen:
            raise InvalidSettings(
                f"the states belong to stages {seen} and {state.stage}, which shear differently; "
                "choose one with stage="
            )
        seen = state.stage
        yield state


def deviatoric(rate: Array) -> float:
    """ε̇_q of a velocity gradient: largest less smallest principal strain rate [1/s]."""
    values = np.linalg.eigvalsh(0.5 * (rate + rate.T))
    return float(values[-1] - values[0])


def _each(states: States) -> Iterator[State]:
    if isinstance(states, Packing | Frame):
        yield states
    elif isinstance(states, Iterator):
        yield from states
    else:
        frames = states.frames if isinstance(states, Run) else states
        if hasattr(frames, "__iter__"):
            yield from frames
            return
        for index in range(len(frames)):  # pyright: ignore[reportArgumentType]
            yield frames[index]  # pyright: ignore[reportIndexIssue]


def _origin(packing: Packing) -> Array:
    origin = None if packing.cell is None else packing.cell.origin
    return np.zeros(packing.dimension) if origin is None else origin


def _lattice(state: State, previous: Array | None) -> Array:
    """Lattice vectors in a basis that is followed through remaps."""
    matrix = require(packing_of(state).cell, "cell lengths", "give the cell of the packing").matrix
    if isinstance(state, Frame) and state.remap is not None:
        change = lattice_change(state)
    elif previous is None:
        return np.array(matrix)
    else:
        change = lattice_remap(previous, matrix)
    return matrix @ np.rint(np.linalg.inv(change))


def _fractions(packing: Packing, lattice: Array) -> Array:
    place = np.linalg.solve(lattice, (packing.grains.position - _origin(packing)).T).T
    return np.asarray(place, dtype=np.float64)


def _step(before: State, after: State, first: Array, last: Array) -> Array:
    """Change of the coordinates along the followed lattice vectors, nearest image."""
    old, new = packing_of(before), packing_of(after)
    if not np.array_equal(old.grains.number, new.grains.number):  # pyright: ignore[reportArgumentType]
        raise InvalidPacking("the two states hold different grains, so nothing can be compared")
    periodic = require(old.cell, "cell lengths").periodic
    if periodic != require(new.cell, "cell lengths").periodic:
        raise InvalidPacking("one state has walls where the other is periodic")
    step = _fractions(new, last) - _fractions(old, first)
    return step - np.rint(step - step[0]) * np.array(periodic)


def _without_drift(step: Array, packing: Packing) -> Array:
    return _centred(step, require(packing.cell, "cell lengths").periodic)


def _centred(step: Array, periodic: tuple[bool, ...]) -> Array:
    return step - step.mean(axis=0) * np.array(periodic)


def _walked(after: State, before: float, first: Array, last: Array) -> float:
    """∫|dε_q| up to a state: its own, or that of the affine motion since the one before."""
    if isinstance(after, Frame):
        return after.eps_q_total
    growth = last @ np.linalg.inv(first)
    stretch = 0.5 * np.log(np.linalg.eigvalsh(growth.T @ growth))
    return before + float(stretch[-1] - stretch[0])


def _even(strain: Array) -> int:
    """How many states lie at equal intervals; all, or all but the last."""
    steps = np.diff(strain)
    if not len(steps):
        raise InvalidSettings("displacements need at least two states, got 1")
    usual = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - usual) > _UNEVEN * usual)
    if len(uneven) and uneven[0] < len(steps) - 1:
        raise InvalidSettings(
            f"states must lie at equal intervals of strain; number {uneven[0] + 1} follows after "
            f"{steps[uneven[0]]:.4g}, the others after {usual:.4g}; choose a stage or range"
        )
    return len(strain) - len(uneven)
