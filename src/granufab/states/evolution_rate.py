"""The evolution law axis by axis, for one direction of straining."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from granufab.packing import Array
from granufab.states.evolution import EvolutionLaw

__all__ = ["Drive"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drive:
    """What a strain rate makes of the law: principal values in the axes of d, largest d first.

    Attributes:
        speed: ε̇_q = d_1 − d_D [1/s].
        heading: of N = d/|d| [-], shape (D,).
        exchange: of R [1/s], shape (D,).
        limits: of T_0 [-], shape (D,).
        critical: z* = tr T_0/D [-].
        fade: tr R/D, the rate at which w fades [1/s].
        shedding: of S/⟨z − z*⟩² [1/s], shape (D,).
        early: half of κ [-].
        memory: c [-].
        turnover: 1/s_0 times ε̇_q [1/s].
    """

    speed: float
    heading: Array
    exchange: Array
    limits: Array
    critical: float
    fade: float
    shedding: Array
    early: float
    memory: float
    turnover: float

    @classmethod
    def of(cls, law: EvolutionLaw, values: Array) -> Self:
        """The drive of a strain rate whose deviator has the principal ``values`` [1/s].

        Without a deviatoric rate everything is 0, and the limits play no part.
        """
        speed = float(values[0] - values[-1])
        share = (values - values[-1]) / speed if speed > 0.0 else np.zeros_like(values)
        gain, loss = law.gain_rate * float(values[0]), law.loss_rate * float(-values[-1])
        exchange = loss + (gain - loss) * share
        limits = law.z_min + (law.z_max - law.z_min) * share
        return cls(
            speed=speed,
            heading=values / np.linalg.norm(values) if speed > 0.0 else share,
            exchange=exchange,
            limits=limits,
            critical=float(limits.mean()),
            fade=float(exchange.mean()),
            shedding=law.shedding * speed * (1.0 - (1.0 - law.shedding_ratio) * share),
            early=0.5 * law.early,
            memory=law.memory,
            turnover=speed / law.early_strain,
        )

    def flow(self, z: float, recent: float, surplus: float) -> tuple[Array, Array]:
        """What each axis gains, and the rate at which it loses, ġ_k = gain_k − loss_k g_k [1/s].

        Args:
            z: coordination number tr g/D [-].
            recent: H:N [-].
            surplus: w [-].
        """
        goal = self.limits
        if self.memory:
            goal = goal + self.memory * surplus * (goal - self.critical)
        exchange = self.exchange
        if self.early:
            exchange = exchange * (1.0 + self.early * (1.0 - recent))
        excess = z - self.critical
        loss = exchange + excess**2 * self.shedding if excess > 0.0 else exchange
        return exchange * goal, loss
