"""What simulator, readers, measures and figures share: grains, contacts, cell, packing.

All records are frozen and validated once. Arrays are float64, C-contiguous and read-only;
change a record with :func:`dataclasses.replace`. What a source lacks is ``None``.

Conventions: the normal n points from grain i to grain j, the branch is r_j − r_i (minimum
image), the force acts on j and −f on i, so compression gives f·n > 0.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeGuard, TypeVar

import numpy as np
from numpy.typing import NDArray

from granufab.errors import InvalidPacking, MissingData

__all__ = ["Array", "Cell", "Contacts", "Grains", "IntArray", "Packing", "WallContacts", "require"]

Array = NDArray[np.float64]
"""Numbers, of any shape."""
IntArray = NDArray[np.int64]
"""Whole numbers, of any shape."""
T = TypeVar("T")


def require(value: T | None, what: str, remedy: str = "") -> T:
    """Return ``value``, or raise :class:`MissingData` naming what is missing.

    Args:
        value: a field that its source may lack.
        what: the quantity in words ("contact forces").
        remedy: how the user can supply it.
    Raises:
        MissingData: ``value`` is None.
    """
    if value is None:
        raise MissingData(f"{what} are not in this data" + (f"; {remedy}" if remedy else ""))
    return value


def _is_frozen(value: object, dtype: type) -> TypeGuard[NDArray]:
    """Whether an array owns its numbers and nobody writes them, so that it needs no copy."""
    if not isinstance(value, np.ndarray) or value.base is not None:
        return False
    flags = value.flags
    return value.dtype == dtype and flags.c_contiguous and flags.owndata and not flags.writeable


def _frozen(value: object, name: str, shape: tuple[int, ...], dtype: type = np.float64) -> NDArray:
    try:
        array = value if _is_frozen(value, dtype) else np.array(value, dtype, order="C", copy=True)
    except (TypeError, ValueError) as error:
        raise InvalidPacking(f"{name} is not numeric: {error}") from None
    if array.size == 0 and 0 in shape:
        array = array.reshape(shape)
    if array.shape != shape:
        raise InvalidPacking(f"{name} has shape {array.shape}, expected {shape}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        where = int(np.argwhere(~np.isfinite(array.reshape(len(array), -1)).all(axis=1))[0, 0])
        raise InvalidPacking(f"{name} of item {where} is not finite")
    array.flags.writeable = False
    return array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grains:
    """Disks (D = 2) or spheres (D = 3).

    Attributes:
        position: centres [m], shape (grain_count, D); not wrapped into the cell.
        radius: [m], shape (grain_count,).
        mass: [kg], shape (grain_count,), or None.
        velocity: [m/s], shape (grain_count, D); in a deforming cell the fluctuation
            c = v − L·r; or None.
        spin: [rad/s], shape (grain_count, 1) in 2D, (grain_count, 3) in 3D, or None.
        number: identity of each grain over time, shape (grain_count,); defaults to 0, 1, 2…
    """

    position: Array
    radius: Array
    mass: Array | None = None
    velocity: Array | None = None
    spin: Array | None = None
    number: IntArray | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.position)
        if len(shape) != 2 or shape[1] not in (2, 3):
            raise InvalidPacking(f"position has shape {shape}, expected (grain_count, 2 or 3)")
        count, dimension = shape
        if count == 0:
            raise InvalidPacking("a packing needs at least one grain, got 0")
        spins = 1 if dimension == 2 else 3
        put = object.__setattr__
        put(self, "position", _frozen(self.position, "position", (count, dimension)))
        put(self, "radius", _frozen(self.radius, "radius", (count,)))
        for name, shape_ in (
            ("mass", (count,)),
            ("velocity", (count, dimension)),
            ("spin", (count, spins)),
        ):
            if getattr(self, name) is not None:
                put(self, name, _frozen(getattr(self, name), name, shape_))
        number = np.arange(count) if self.number is None else self.number
        put(self, "number", _frozen(number, "number", (count,), np.int64))
        for name in ("radius", "mass"):
            value = getattr(self, name)
            if value is not None and not (value > 0).all():
                where = int(np.argmin(value))
                raise InvalidPacking(f"{name} of grain {where} is {value[where]}, must be > 0")

    @property
    def count(self) -> int:
        """Number of grains."""
        return len(self.radius)

    @property
    def dimension(self) -> int:
        """2 for disks, 3 for spheres."""
        return self.position.shape[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contacts:
    """Pairs of neighbouring grains, force-bearing or not (see ``fabric.criterion``).

    Attributes:
        pair: grain indices i, j, shape (contact_count, 2).
        normal: unit vector from i to j [-], shape (contact_count, D).
        branch: r_j − r_i [m], shape (contact_count, D), or None.
        gap: surface distance, < 0 in overlap [m], shape (contact_count,), or None.
        force: on grain j [N] (2D: per length), shape (contact_count, D), or None.
        image: integer lattice shift of j's image, shape (contact_count, D), or None.
    """

    pair: IntArray
    normal: Array
    branch: Array | None = None
    gap: Array | None = None
    force: Array | None = None
    image: IntArray | None = None

    def __post_init__(self) -> None:
        count = len(self.pair)
        shape = np.shape(self.normal)
        dimension = shape[1] if len(shape) == 2 else 0
        if dimension not in (2, 3):
            raise InvalidPacking(f"normal has shape {shape}, expected (contact_count, 2 or 3)")
        put = object.__setattr__
        put(self, "pair", _frozen(self.pair, "pair", (count, 2), np.int64))
        put(self, "normal", _frozen(self.normal, "normal", (count, dimension)))
        for name, shape_, dtype in (
            ("branch", (count, dimension), np.float64),
            ("gap", (count,), np.float64),
            ("force", (count, dimension), np.float64),
            ("image", (count, dimension), np.int64),
        ):
            if getattr(self, name) is not None:
                put(self, name, _frozen(getattr(self, name), name, shape_, dtype))
        length = np.linalg.norm(self.normal, axis=1)
        if count and (np.abs(length - 1.0) > 1e-6).any():
            where = int(np.argmax(np.abs(length - 1.0)))
            raise InvalidPacking(f"normal of contact {where} has length {length[where]:.6g}, not 1")

    @property
    def count(self) -> int:
        """Number of pairs listed."""
        return len(self.pair)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.normal.shape[1]

    def select(self, keep: NDArray[np.bool_]) -> Contacts:
        """The contacts where ``keep`` (shape (contact_count,)) is true."""
        if np.all(keep):
            return self
        chosen = {}
        for field in fields(self):
            value = getattr(self, field.name)
            chosen[field.name] = None if value is None else value[keep]
            if value is not None:  # nobody else holds the new array, so it needs no copy
                chosen[field.name].flags.writeable = False
        return Contacts(**chosen)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WallContacts:
    """Contacts between grains and the flat faces of a cell with walls.

    Attributes:
        grain: grain index, shape (contact_count,).
        wall: 2·axis + side (side 0 at the lower face, 1 at the upper), shape (contact_count,).
        normal: unit vector from the grain into the wall [-], shape (contact_count, D).
        gap: [m], shape (contact_count,).
        force: on the wall [N], shape (contact_count, D).
    """

    grain: IntArray
    wall: IntArray
    normal: Array
    gap: Array
    force: Array

    def __post_init__(self) -> None:
        count = len(self.grain)
        dimension = np.shape(self.normal)[1]
        put = object.__setattr__
        put(self, "grain", _frozen(self.grain, "grain", (count,), np.int64))
        put(self, "wall", _frozen(self.wall, "wall", (count,), np.int64))
        put(self, "normal", _frozen(self.normal, "normal", (count, dimension)))
        put(self, "gap", _frozen(self.gap, "gap", (count,)))
        put(self, "force", _frozen(self.force, "force", (count, dimension)))

    @property
    def count(self) -> int:
        """Number of grain–wall pairs listed."""
        return len(self.grain)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cell:
    """The domain: a lattice cell, a box with walls, or a mixture, axis by axis.

    Attributes:
        matrix: lattice vectors as columns [m], shape (D, D).
        periodic: per axis; a non-periodic axis is bounded by two flat walls.
        origin: lower corner [m], shape (D,).
        rate: velocity gradient L, > 0 expands [1/s], shape (D, D).
    """

    matrix: Array
    periodic: tuple[bool, ...] = ()
    origin: Array | None = None
    rate: Array | None = None

    def __post_init__(self) -> None:
        dimension = len(self.matrix)
        put = object.__setattr__
        put(self, "matrix", _frozen(self.matrix, "cell matrix", (dimension, dimension)))
        put(self, "periodic", tuple(bool(p) for p in self.periodic) or (True,) * dimension)
        origin = np.zeros(dimension) if self.origin is None else self.origin
        put(self, "origin", _frozen(origin, "cell origin", (dimension,)))
        rate = np.zeros((dimension, dimension)) if self.rate is None else self.rate
        put(self, "rate", _frozen(rate, "cell rate", (dimension, dimension)))
        if len(self.periodic) != dimension:
            raise InvalidPacking(f"periodic has {len(self.periodic)} entries, expected {dimension}")
        if not np.linalg.det(self.matrix) > 0:
            raise InvalidPacking(
                f"cell matrix has determinant {np.linalg.det(self.matrix):.6g}, must be > 0"
            )
        walls = [k for k in range(dimension) if not self.periodic[k]]
        for k in walls:
            off = np.delete(self.matrix[k], k).tolist() + np.delete(self.matrix[:, k], k).tolist()
            if np.any(off):
                raise InvalidPacking(f"axis {k} has walls, its lattice vector must not be tilted")

    @property
    def volume(self) -> float:
        """Area (2D) or volume (3D) of the cell [m^D]."""
        return float(np.linalg.det(self.matrix))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.matrix)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Packing:
    """One state: grains, their contacts, the cell, and where the data came from.

    Attributes:
        grains: the grains.
        contacts: grain–grain pairs, or None where the source has no list.
        cell: the domain, or None for an unbounded cloud.
        wall_contacts: grain–wall pairs, or None.
        time: [s], or None.
        source: the file or recipe this state came from.
    """

    grains: Grains
    contacts: Contacts | None = None
    cell: Cell | None = None
    wall_contacts: WallContacts | None = None
    time: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        dimension = self.grains.dimension
        if self.contacts is not None:
            if self.contacts.dimension != dimension:
                raise InvalidPacking(
                    f"contacts are {self.contacts.dimension}D, grains are {dimension}D"
                )
            _check_pairs(self.contacts.pair, self.grains.count)
        if self.cell is not None and self.cell.dimension != dimension:
            raise InvalidPacking(f"cell is {self.cell.dimension}D, grains are {dimension}D")

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.grains.dimension


def _check_pairs(pair: IntArray, grain_count: int) -> None:
    wrong = (pair < 0) | (pair >= grain_count)
    if wrong.any():
        contact, side = (int(k) for k in np.argwhere(wrong)[0])
        raise InvalidPacking(
            f"contact {contact} joins grain {pair[contact, side]}, but there are "
            f"{grain_count} grains (0..{grain_count - 1})"
        )
