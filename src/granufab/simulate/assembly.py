"""From the active candidates to the contact problem of one step."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from granufab.kernels.motion import relative_velocity, set_offsets
from granufab.kernels.problem import Problem
from granufab.packing import Array, IntArray
from granufab.simulate.candidates import Candidates

__all__ = ["Buffers", "StepLaw", "assemble", "impulses"]


class Buffers(NamedTuple):
    """Contact arrays reused from step to step; their heads hold the active contacts."""

    normal: Array
    length: Array
    offset_n: Array
    offset_t: Array
    impulse_n: Array
    impulse_t: Array

    @classmethod
    def of(cls, count: int, dimension: int) -> Self:
        """Room for ``count`` contacts."""
        tangents = 1 if dimension == 2 else 3
        line, plane = (lambda: np.empty(count)), (lambda: np.empty((count, tangents)))
        return cls(
            np.empty((count, dimension)),
            line(), line(), plane(), line(), plane(),
        )  # fmt: skip


class StepLaw(NamedTuple):
    """What the contact law of a step needs besides the contacts.

    Attributes:
        step: h [s].
        softness: ε = 1/(k h²) [1/kg], 0 rigid.
        overlap_correction: β [-].
        restitution: e [-].
        spin_factor: m R²/I [-].
        coupled, dilation_weight, weight: the free cell, see :class:`Problem`.
        imposed: imposed part of L [1/s], shape (D, D).
    """

    step: float
    softness: float
    overlap_correction: float
    restitution: float
    spin_factor: float
    coupled: bool
    dilation_weight: float
    weight: Array
    imposed: Array


def assemble(
    candidates: Candidates,
    buffers: Buffers,
    law: StepLaw,
    start: tuple[Array, Array],
    like: tuple[float, ...],
) -> tuple[Problem, IntArray]:
    """The problem of the active candidates, and which candidates they are.

    Args:
        candidates: neighbour list with fresh gaps and ``active`` marks.
        buffers: filled here; impulses get the warm start.
        law: contact law of the step.
        start: (motion, L) at the start of the step, for the bounce.
        like: tuple of D zeros.
    """
    chosen = np.flatnonzero(candidates.active)
    count = len(chosen)
    pairs = candidates.pairs[chosen]
    np.take(candidates.normal, chosen, axis=0, out=buffers.normal[:count])
    np.take(candidates.length, chosen, out=buffers.length[:count])
    np.take(candidates.impulse_n, chosen, out=buffers.impulse_n[:count])
    np.take(candidates.impulse_t, chosen, axis=0, out=buffers.impulse_t[:count])
    problem = Problem(
        first=np.ascontiguousarray(pairs[:, 0]),
        second=np.ascontiguousarray(pairs[:, 1]),
        normal=buffers.normal[:count],
        length=buffers.length[:count],
        offset_n=buffers.offset_n[:count],
        offset_t=buffers.offset_t[:count],
        mu=candidates.friction[chosen],
        softness=law.softness,
        spin_factor=law.spin_factor,
        coupled=law.coupled,
        dilation_weight=law.dilation_weight,
        weight=law.weight,
    )
    bounce = np.zeros(count)
    if law.restitution > 0:
        slip = np.empty_like(buffers.offset_t[:count])
        relative_velocity(problem, start[0], start[1], like, bounce, slip)
        bounce *= law.restitution
    set_offsets(
        problem,
        candidates.gap[chosen],
        law.imposed,
        bounce,
        (law.step, law.overlap_correction, law.restitution),
        candidates.memory_t[chosen],
        like,
    )
    return problem, chosen


def impulses(buffers: Buffers, count: int) -> tuple[Array, Array]:
    """(P_n, P_t) of the active contacts."""
    return buffers.impulse_n[:count], buffers.impulse_t[:count]
