"""From what a file says to a packing: one set of rules for all formats.

Walls are left out and counted; pairs listed twice are kept once; branches are the minimum image
by the cell matrix, never stored shifts; normals point from i to j and forces act on j,
compression positive, whatever the format's habit; flat data in three columns become 2D.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError, InvalidPacking, InvalidSettings, MissingData
from granufab.fabric.criterion import select_contacts
from granufab.fabric.rattlers import backbone
from granufab.io.cell_of_frame import cell_of
from granufab.io.distinct_bodies import check_distinct
from granufab.io.found import FoundContacts, FoundFrame
from granufab.io.import_summary import ImportSummary
from granufab.io.nearest_image import nearest_images
from granufab.io.read_options import ReadOptions
from granufab.packing import Array, Cell, Contacts, Grains, IntArray, Packing

__all__ = ["assemble"]

FLAT = 1e-9
"""Largest spread of a coordinate, in radii, of data that are called flat."""


def assemble(found: FoundFrame, options: ReadOptions, summary: ImportSummary) -> Packing:
    """Apply the rules to one frame.

    Args:
        found: as the file gives it.
        options: what the user adds.
        summary: counts and conventions are added to it.
    Raises:
        CorruptFile: numbers contradict each other; names the place.
        MissingData: something needed is neither in the file nor given.
        InvalidSettings: an option does not fit the data.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused
            return _assembled(found, options, summary)
    except (InvalidSettings, MissingData, CorruptFile):
        raise
    except GranufabError as error:
        raise CorruptFile(f"{found.place}: {error}") from None


def _assembled(found: FoundFrame, options: ReadOptions, summary: ImportSummary) -> Packing:
    axes = _axes(found, options, summary)
    keep = _kept_bodies(found, options, summary)
    number = np.arange(len(keep)) if found.number is None else np.asarray(found.number, np.int64)
    check_distinct(found)
    position = np.asarray(found.position, float)[keep][:, axes]
    if len(position) == 0:
        raise MissingData(f"{found.place}: this frame has no grains")
    grains = Grains(
        position=position,
        radius=_radius(found, options)[keep],
        mass=_rows(found.mass, keep),
        velocity=_columns(found.velocity, keep, axes),
        spin=_spin(found.spin, keep, len(axes)),
        number=number[keep],
    )
    cell = cell_of(found, options, axes, grains)
    contacts = None
    if found.contacts is not None:
        listed = _Listed(found, number, keep, axes)
        try:
            contacts = _contacts(listed, grains, cell, options, summary)
        except InvalidPacking as error:
            raise CorruptFile(f"{listed.place}: {error}") from None
    summary.round_grains = found.round
    summary.grains, summary.frames_read = grains.count, summary.frames_read + 1
    summary.contacts = None if contacts is None else contacts.count
    packing = Packing(
        grains=grains, contacts=contacts, cell=cell, time=found.time, source=found.place
    )
    if contacts is not None:
        rule = "listed" if contacts.force is None else "force"
        pair = select_contacts(packing, rule).pair
        summary.rattlers = int((~backbone(pair, grains.count)).sum())
    return packing


@dataclass(frozen=True, slots=True)
class _Listed:
    """A found frame with the numbering and the columns that were chosen."""

    found: FoundFrame
    number: IntArray
    keep: NDArray[np.bool_]
    axes: list[int]

    @property
    def place(self) -> str:
        """Where the contacts are listed, for messages."""
        contacts = self.found.contacts
        return (contacts.place if contacts is not None else "") or self.found.place


def _axes(found: FoundFrame, options: ReadOptions, summary: ImportSummary) -> list[int]:
    """The columns that hold coordinates: two of three where the data are flat."""
    columns = np.shape(found.position)[1]
    wanted = options.dimension or found.dimension
    if columns == 2:
        if wanted == 3:
            raise InvalidSettings(f"dimension is 3, but {found.place} has two coordinates a body")
        return [0, 1]
    size = 1.0 if found.radius is None or len(found.radius) == 0 else float(np.max(found.radius))
    spread = np.ptp(np.asarray(found.position, float), axis=0) if len(found.position) else [1] * 3
    flat = [k for k in range(3) if spread[k] <= FLAT * size]
    if wanted == 3 or (wanted is None and (len(flat) != 1 or len(found.position) < 4)):
        return [0, 1, 2]
    normal = flat[-1] if flat else 2
    if options.dimension == 2:
        _check_layer(found, normal)
    summary.conventions["dimension"] = f"2, in the plane of {'xyz'.replace('xyz'[normal], '')}"
    return [k for k in range(3) if k != normal]


def _check_layer(found: FoundFrame, normal: int) -> None:
    """Refuse to call grains disks that lie above each other."""
    if found.radius is None or len(found.position) == 0:
        return
    bodies = slice(None) if found.wall is None else ~found.wall
    place = np.asarray(found.position, float)[bodies, normal]
    thick = 2 * np.max(np.asarray(found.radius, float)[bodies], initial=0.0)
    if len(place) and np.ptp(place) > thick:
        raise InvalidSettings(
            f"dimension is 2, but the grains of {found.place} spread over {np.ptp(place):.3g} "
            f"along {'xyz'[normal]}, more than a diameter"
        )


def _kept_bodies(
    found: FoundFrame, options: ReadOptions, summary: ImportSummary
) -> NDArray[np.bool_]:
    count = len(found.position)
    if found.wall is None or options.walls:
        return np.ones(count, bool)
    summary.walls_dropped += int(found.wall.sum())
    return ~found.wall


def _radius(found: FoundFrame, options: ReadOptions) -> Array:
    count = len(found.position)
    if options.radius is not None:
        return np.full(count, options.radius)
    if found.radius is None:
        raise MissingData(f"{found.place}: radii are not in this data; give --radius")
    return np.asarray(found.radius, float)


def _rows(value: Array | None, keep: NDArray[np.bool_]) -> Array | None:
    return None if value is None else np.asarray(value, float)[keep]


def _columns(value: Array | None, keep: NDArray[np.bool_], axes: list[int]) -> Array | None:
    return None if value is None else np.asarray(value, float)[keep][:, axes]


def _spin(value: Array | None, keep: NDArray[np.bool_], dimension: int) -> Array | None:
    if value is None:
        return None
    spin = np.asarray(value, float)[keep]
    return spin[:, -1:] if dimension == 2 else spin


def _contacts(
    listed: _Listed, grains: Grains, cell: Cell | None, options: ReadOptions, summary: ImportSummary
) -> Contacts:
    raw: FoundContacts = listed.found.contacts  # type: ignore[assignment]
    pair, rows = _kept_pairs(listed, raw, summary)
    branch, image = _branches(grains, cell, pair)
    part = None if raw.part is None else np.asarray(raw.part, np.int64)[rows]
    once = _first_of_each(pair, image, part)
    summary.duplicates_dropped += len(pair) - len(once)
    if len(once) < len(pair):
        pair, rows, branch, image = pair[once], rows[once], branch[once], image[once]
    normal = _normals(listed, raw, rows, branch, summary)
    force = _forces(listed, raw, rows, normal, summary)
    gap = None if raw.gap is None else np.asarray(raw.gap, float)[rows]
    if gap is None and listed.found.round:
        gap = np.linalg.norm(branch, axis=1) - grains.radius[pair].sum(axis=1)
    _tell_apart(gap, grains, summary)
    return Contacts(
        pair=_own(pair), normal=_own(normal), branch=_own(branch), gap=_own(gap),
        force=_own(force), image=None if cell is None else _own(image),
    )  # fmt: skip


def _tell_apart(gap: Array | None, grains: Grains, summary: ImportSummary) -> None:
    """Say where the list holds more than contacts, or too large a cutoff was used to make it."""
    if gap is None or len(gap) == 0:
        return
    apart = float(np.mean(gap > 1e-3 * grains.radius.mean()))
    if apart > 0.01:
        summary.conventions["listed pairs"] = (
            f"{100 * apart:.0f} % do not touch: the criterion gap or force leaves them out"
        )


def _own(array: Any) -> Any:
    """An array that nobody else holds, handed over without a copy."""
    if array is not None:
        array = np.ascontiguousarray(array)
        array.flags.writeable = False
    return array


def _kept_pairs(
    listed: _Listed, raw: FoundContacts, summary: ImportSummary
) -> tuple[IntArray, IntArray]:
    """Pairs of two different grains, and their rows in the list."""
    first, second = _index(listed, raw.first), _index(listed, raw.second)
    unknown = (first < 0) | (second < 0)
    wall = np.zeros(len(first), bool) if raw.wall is None else np.asarray(raw.wall, bool).copy()
    bad = unknown & ~wall
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        missing = raw.first[row] if first[row] < 0 else raw.second[row]
        raise CorruptFile(
            f"{listed.place}: contact {row} joins body {int(missing)}, which is not among "
            f"the {len(listed.number)} bodies ({listed.number.min()}..{listed.number.max()})"
        )
    grain = listed.keep
    wall |= ~grain[np.maximum(first, 0)] | ~grain[np.maximum(second, 0)]
    itself = ~wall & (first == second)
    summary.wall_contacts_dropped += int(wall.sum())
    summary.self_contacts_dropped += int(itself.sum())
    rows = np.flatnonzero(~wall & ~itself)
    place = np.cumsum(grain) - 1
    return np.stack([place[first[rows]], place[second[rows]]], axis=1), rows


def _index(listed: _Listed, wanted: IntArray) -> IntArray:
    """Rows of the bodies with these numbers, −1 where there is none."""
    wanted = np.asarray(wanted, np.int64)
    order = np.argsort(listed.number, kind="stable")
    ranked = listed.number[order]
    spot = np.minimum(np.searchsorted(ranked, wanted), len(ranked) - 1)
    return np.where(ranked[spot] == wanted, order[spot], -1)


def _branches(grains: Grains, cell: Cell | None, pair: IntArray) -> tuple[Array, IntArray]:
    """Minimum-image branches by the cell matrix, and the lattice shifts that they take."""
    branch = grains.position[pair[:, 1]] - grains.position[pair[:, 0]]
    if cell is None:
        return branch, np.zeros(branch.shape, np.int64)
    return nearest_images(branch, cell.matrix, cell.periodic)


def _normals(
    listed: _Listed, raw: FoundContacts, rows: IntArray, branch: Array, summary: ImportSummary
) -> Array:
    """Unit vectors from i to j: the listed ones where there are any."""
    length = np.linalg.norm(branch, axis=1)
    if raw.normal is None:
        if not (length > 0).all():
            where = int(np.argmin(length))
            raise CorruptFile(
                f"{listed.place}: the grains of contact {int(rows[where])} have one centre"
            )
        summary.conventions["normals"] = "along the branches"
        return branch / length[:, None]
    normal = np.asarray(raw.normal, float)[rows][:, listed.axes]
    size = np.linalg.norm(normal, axis=1)
    if not (size > 0).all() or not np.isfinite(size).all():
        where = int(np.argmin(np.where(np.isfinite(size), size, -1)))
        raise CorruptFile(
            f"{listed.place}: the normal of contact {int(rows[where])} has no direction"
        )
    normal = normal / size[:, None]
    along = np.einsum("ci,ci->c", normal, branch)
    if raw.normal_to is None:
        flip = along < 0
        text = "listed, turned to point from i to j"
    else:
        flip = np.full(len(normal), raw.normal_to == "first")
        against = float(np.mean(np.where(flip, -along, along) < 0)) if len(along) else 0.0
        if against > 0.5:
            flip = ~flip
        text = f"listed, pointing to the {'second' if not flip.all() else 'first'} grain"
        if 0.01 < against <= 0.5:
            text += f" ({100 * against:.0f} % point the other way)"
    summary.conventions["normals"] = text
    return np.where(flip[:, None], -normal, normal)


def _forces(
    listed: _Listed, raw: FoundContacts, rows: IntArray, normal: Array, summary: ImportSummary
) -> Array | None:
    """Forces on j with f·n > 0 in compression, or None."""
    if raw.force is not None:
        force = np.asarray(raw.force, float)[rows][:, listed.axes]
        force = -force if raw.force_on == "first" else force
        force = force * (raw.compression or 1)
        if raw.force_on is None:
            force = _pushing(force, normal, summary)
    elif raw.normal_force is not None:
        size = np.asarray(raw.normal_force, float)[rows]
        force = (raw.compression or _squeezed(size)) * size[:, None] * normal
        force = force + _tangential(listed, raw, rows, normal, summary)
    else:
        return None
    along = np.einsum("ci,ci->c", force, normal)
    pull = float(np.mean(along < 0)) if len(along) else 0.0
    summary.conventions["forces"] = "compression positive after reading" + (
        f"; {100 * pull:.1f} % of the contacts pull" if pull > 0 else ""
    )
    return force


def _pushing(force: Array, normal: Array, summary: ImportSummary) -> Array:
    """Forces of unknown sense in the one in which the contacts push on the whole."""
    pull = float(np.einsum("ci,ci->", force, normal)) < 0
    body = "first" if pull else "second"
    summary.conventions["sense of forces"] = f"on the {body} grain, as the contacts push on it"
    return -force if pull else force


def _squeezed(along: Array) -> int:
    """Sign of the normal forces on the whole: that of compression where nothing else tells."""
    return -1 if float(np.sum(along)) < 0 else 1


def _tangential(
    listed: _Listed, raw: FoundContacts, rows: IntArray, normal: Array, summary: ImportSummary
) -> Array:
    if raw.tangential_force is not None:
        force = np.asarray(raw.tangential_force, float)[rows][:, listed.axes]
        return -force if raw.force_on == "first" else force
    if raw.tangential_size is None:
        summary.conventions["tangential forces"] = "not in this data, taken as zero"
        return np.zeros_like(normal)
    size = np.asarray(raw.tangential_size, float)[rows]
    if normal.shape[1] == 2:
        return size[:, None] * np.column_stack([-normal[:, 1], normal[:, 0]])
    summary.conventions["tangential forces"] = "known in size only, left out"
    return np.zeros_like(normal)


def _first_of_each(pair: IntArray, image: IntArray, part: IntArray | None) -> IntArray:
    """Rows of the first listing of every pair through every image, at every two parts."""
    low, high = pair.min(axis=1), pair.max(axis=1)
    order = np.lexsort((high, low))
    same = (np.diff(low[order]) == 0) & (np.diff(high[order]) == 0)
    if not same.any():
        return np.arange(len(pair))
    swap = (pair[:, 0] > pair[:, 1])[:, None]
    keys = [np.stack([low, high], axis=1), np.where(swap, -image, image)]
    if part is not None:
        keys.append(np.where(swap, part[:, ::-1], part))
    _, first = np.unique(np.concatenate(keys, axis=1), axis=0, return_index=True)
    return np.sort(first)
