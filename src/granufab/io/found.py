"""What a reader found in one frame of somebody else's data, before any rule is applied to it.

Readers only parse: they fill these records with the numbers as the file gives them and say which
conventions the format has. :mod:`granufab.io.assemble` makes a packing of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from granufab.packing import Array, IntArray

__all__ = ["FoundCell", "FoundContacts", "FoundFrame", "LazyFrames", "Source"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundCell:
    """A box as a file gives it.

    Attributes:
        matrix: lattice vectors as columns, shape (D, D).
        origin: lower corner, shape (D,).
        periodic: per axis.
        free: axes whose bounds only follow the grains, so they are neither a wall nor a
            lattice; none by default.
        followed: lattice vectors that follow the deformation, shape (D, D), where the program
            changes to an equivalent ``matrix`` now and then (flips a tilted box); default the
            matrix itself.
    """

    matrix: Array
    origin: Array
    periodic: tuple[bool, ...]
    free: tuple[bool, ...] = ()
    followed: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundContacts:
    """Pairs as a file lists them, doubles and walls included.

    Attributes:
        first, second: bodies in the file's own numbering, shape (listed,).
        wall: pairs with something that is not a grain, shape (listed,); None: unknown numbers
            are an error.
        normal: any direction along the line of contact, shape (listed, D), or None.
        point: where they touch, shape (listed, D), or None.
        gap: surface distance, < 0 in overlap, shape (listed,), or None.
        force: whole force, shape (listed, D), or None.
        normal_force: its normal part, shape (listed,), or None; used where ``force`` is None.
        tangential_force: its tangential part as a vector, shape (listed, D), or None.
        tangential_size: only its size (2D: signed along t = (−n_y, n_x)), shape (listed,).
        compression: sign of the normal force of a squeezed contact: of ``normal_force``, or of
            ``force``·``normal`` for the sense of ``normal`` that the format has; None: unknown,
            of ``normal_force`` the sign that it has on the whole.
        force_on: body that ``force`` acts on; None: unknown, the one for which the contacts
            push on the whole.
        normal_to: body that ``normal`` points to; None: unknown, taken from the positions.
        image: lattice shift of the second body's image, shape (listed, D), or None.
        part: which vertices, edges or faces of the two bodies touch, as numbers that are unique
            within a body, shape (listed, 2): a pair may touch at several of them, and is listed
            twice only where both are the same; None: a pair touches once.
        place: file and frame of the list, for messages; default the frame's.
    """

    first: IntArray
    second: IntArray
    wall: NDArray[np.bool_] | None = None
    normal: Array | None = None
    point: Array | None = None
    gap: Array | None = None
    force: Array | None = None
    normal_force: Array | None = None
    tangential_force: Array | None = None
    tangential_size: Array | None = None
    compression: Literal[1, -1] | None = 1
    force_on: Literal["first", "second"] | None = "second"
    normal_to: Literal["first", "second"] | None = "second"
    image: IntArray | None = None
    part: IntArray | None = None
    place: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundFrame:
    """One state as a file gives it.

    Attributes:
        place: file and frame, for messages.
        position: centres of all bodies, shape (body_count, 2 or 3).
        radius: shape (body_count,), or None.
        number: of the bodies, unique, shape (body_count,); None: in the order of the file.
        wall: bodies that are no grains, shape (body_count,), or None.
        mass, velocity, spin: as in :class:`granufab.packing.Grains`, for all bodies, or None.
        dimension: 2 or 3 where the format tells it.
        cell: the box, or None.
        contacts: the list, or None where the source has none.
        round: False where bodies are not disks or spheres: branches then need no gap.
        time: or None.
        step: number of the time step, or None.
    """

    place: str
    position: Array
    radius: Array | None = None
    number: IntArray | None = None
    wall: NDArray[np.bool_] | None = None
    mass: Array | None = None
    velocity: Array | None = None
    spin: Array | None = None
    dimension: int | None = None
    cell: FoundCell | None = None
    contacts: FoundContacts | None = None
    round: bool = True
    time: float | None = None
    step: int | None = None


class Source(Protocol):
    """An opened file, or several that belong together: frames are parsed when asked for.

    ``unknown`` names columns that the reader did not understand; ``notes`` says what else a
    user should know of how the source was read.
    """

    @property
    def unknown(self) -> Sequence[str]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> FoundFrame: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class LazyFrames:
    """A :class:`Source` from a function that parses the frame of a number.

    Attributes:
        count: frames.
        parse: frame of an index from 0 to count − 1.
        unknown: columns that were not understood.
        notes: what a user should know.
    """

    count: int
    parse: Callable[[int], FoundFrame]
    unknown: Sequence[str] = ()
    notes: Sequence[str] = ()

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int, /) -> FoundFrame:
        place = index + self.count if index < 0 else index
        if not 0 <= place < self.count:
            raise IndexError(f"frame {index}, allowed: 0..{self.count - 1}")
        return self.parse(place)
