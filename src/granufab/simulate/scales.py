"""Reference scales of a packing under pressure: what d, m, √(m/p) and I mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from granufab.packing import Packing, require

__all__ = ["Scales"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Reference scales of a packing under pressure p.

    Attributes:
        diameter: mean diameter d [m].
        mass: mean mass m [kg].
        pressure: p [N/m^(D−1)].
        time: √(m/p) in 2D, √(m/(p d)) in 3D [s].
        inertial_time: I = ε̇_q · this; √(m/p) in 2D, d √(ρ/p) in 3D [s].
        force: p d^{D−1} [N].
    """

    diameter: float
    mass: float
    pressure: float
    time: float
    inertial_time: float
    force: float

    @classmethod
    def of(cls, packing: Packing, pressure: float) -> Self:
        """Scales of the grains of ``packing``; they need masses."""
        grains = packing.grains
        diameter = float(2 * grains.radius.mean())
        mass = float(require(grains.mass, "grain masses").mean())
        time_scale = float(np.sqrt(mass / (pressure * diameter ** (grains.dimension - 2))))
        inertial = time_scale
        if grains.dimension == 3:
            volume = float((4 / 3 * np.pi * grains.radius**3).mean())
            inertial = diameter * float(np.sqrt(mass / volume / pressure))
        return cls(
            diameter=diameter,
            mass=mass,
            pressure=pressure,
            time=time_scale,
            inertial_time=inertial,
            force=pressure * diameter ** (grains.dimension - 1),
        )
