"""What a user adds to data that do not say it themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from granufab.errors import InvalidSettings
from granufab.io.found import FoundCell

__all__ = ["ReadOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Options of :func:`granufab.read` for foreign data.

    Attributes:
        dimension: 2 or 3; default from the file, else from the positions.
        cell: edge lengths of a box that starts at the smallest coordinates' corner, or six numbers
            (lower corner, edges) in 3D and four in 2D; default from the file.
        periodic: axes, for example "xy"; "" for none; default from the file.
        columns: names or 1-based numbers of columns, by what they hold, as a TOML file's
            sections give them.
        radius: of every grain, where the file has none.
        walls: False drops bodies and contacts of walls; True keeps bodies as grains.
        friction: coefficient between grains, where the file does not tell it.
        strain: deviatoric strain ε_q from one frame to the next, where no cell deforms.
        axis: contraction axis of a' and ε_q, "x", "y", "z" or components "0,1,0".
        frames: those that are read, "A:B" or "A:B:STEP" as Python counts: from 0, without B,
            from the end where negative; default all.
        skip_damaged: True leaves out frames that cannot be read, and the summary lists them with
            the reasons. The default stops at the first one: a series with a gap has other
            strains, rates and averages, which should not happen unseen.
    """

    dimension: int | None = None
    cell: tuple[float, ...] | None = None
    periodic: str | None = None
    columns: Mapping[str, Mapping[str, str | int]] = field(default_factory=dict)
    radius: float | None = None
    walls: bool = False
    friction: float | None = None
    strain: float | None = None
    axis: str | None = None
    frames: str | None = None
    skip_damaged: bool = False

    def __post_init__(self) -> None:
        if self.dimension not in (None, 2, 3):
            raise InvalidSettings(f"dimension is {self.dimension!r}, allowed: 2 or 3")
        if self.cell is not None and len(self.cell) not in (2, 3, 4, 6):
            raise InvalidSettings(
                f"cell has {len(self.cell)} numbers, allowed: edges (2 or 3), or lower corner and "
                "edges (4 or 6)"
            )
        if self.cell is not None:
            edges = self.cell[-len(self.cell) // 2 :] if len(self.cell) > 3 else self.cell
            if not np.isfinite(self.cell).all() or min(edges) <= 0:
                numbers = ",".join(f"{number:g}" for number in self.cell)
                raise InvalidSettings(f"cell is {numbers}, its edges must be finite and > 0")
        if self.periodic is not None and set(self.periodic) - set("xyz"):
            raise InvalidSettings(f"periodic is {self.periodic!r}, allowed: axes of xyz, or none")
        if self.radius is not None and not 0 < self.radius < np.inf:
            raise InvalidSettings(f"radius is {self.radius!r}, must be finite and > 0")
        if self.friction is not None and not 0 <= self.friction < np.inf:
            raise InvalidSettings(f"friction is {self.friction!r}, must be finite and ≥ 0")
        if self.strain is not None and not np.isfinite(self.strain):
            raise InvalidSettings(f"strain is {self.strain!r}, must be finite")
        self.direction(3)
        self.frame_slice()

    def frame_slice(self) -> slice:
        """The part of the series that ``frames`` chooses.

        Raises:
            InvalidSettings: it is no part, or runs backwards.
        """
        if self.frames is None:
            return slice(None)
        words = self.frames.split(":")
        try:
            ends = [int(word) if word.strip() else None for word in words]
        except ValueError:
            ends = []
        step = ends[2] if len(ends) == 3 else None
        if len(ends) not in (2, 3) or (step is not None and step < 1):
            raise InvalidSettings(
                f"frames is {self.frames!r}, allowed: A:B or A:B:STEP, such as 10:20 or ::5"
            )
        return slice(*ends)

    def direction(self, dimension: int) -> np.ndarray | None:
        """Unit vector of ``axis``, or None.

        Raises:
            InvalidSettings: it is no axis and no vector of this dimension.
        """
        if self.axis is None:
            return None
        names = "xyz"
        if self.axis in names and len(self.axis) == 1:
            place = names.index(self.axis)
            if place >= dimension:
                raise InvalidSettings(f"axis is {self.axis!r}, 2D data have x and y")
            return np.eye(dimension)[place]
        try:
            vector = np.array([float(part) for part in self.axis.split(",")])
        except ValueError:
            vector = np.zeros(0)
        known = len(vector) in (2, 3) and np.isfinite(vector).all()
        vector = np.append(vector, 0.0)[:dimension] if known else np.zeros(1)
        if not np.linalg.norm(vector) > 0:
            raise InvalidSettings(
                f"axis is {self.axis!r}, allowed: x, y, z or components such as 0,1,0"
            )
        return vector / np.linalg.norm(vector)

    def repeats(self, axes: str) -> tuple[bool, ...] | None:
        """Whether each of the axes is periodic, or None where the user does not tell.

        Args:
            axes: names of the axes of the data.
        Raises:
            InvalidSettings: a periodic axis is none of the data's.
        """
        if self.periodic is None:
            return None
        if set(self.periodic) - set(axes):
            raise InvalidSettings(f"periodic is {self.periodic!r}, the axes of the data are {axes}")
        return tuple(name in self.periodic for name in axes)

    def box(self, axes: str, lowest: np.ndarray) -> FoundCell | None:
        """The cell that the user gives, with the corner at ``lowest`` where none is given.

        Args:
            axes: names of the axes of the data.
            lowest: lower corner, shape (D,).
        Raises:
            InvalidSettings: the numbers are for another dimension.
        """
        if self.cell is None:
            return None
        dimension = len(axes)
        given = np.array(self.cell, float)
        if len(given) not in (dimension, 2 * dimension):
            raise InvalidSettings(
                f"cell has {len(given)} numbers, a {dimension}D one needs {dimension} edges, or "
                f"lower corner and edges"
            )
        origin = given[:dimension] if len(given) == 2 * dimension else lowest
        matrix = np.diag(given[-dimension:])
        periodic = self.repeats(axes) or (True,) * dimension
        return FoundCell(matrix=matrix, origin=origin, periodic=periodic)
