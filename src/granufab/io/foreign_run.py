"""A foreign source as a run: frames assembled when asked for, with strain where it is known.

Strain comes from the cell matrix where it deforms, F = H H₀⁻¹ and the logarithm of F Fᵀ/2, else
from the user's strain per frame, else it is unknown (NaN). ε_q is its part along the contraction
axis, against the extension axis, as in the program's own runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np

from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.fabric.stress import stress_tensor
from granufab.history import Frame, Run, series_dataset
from granufab.io.assemble import assemble
from granufab.io.found import FoundCell, FoundFrame, Source
from granufab.io.given_files import told_by_system
from granufab.io.grain_order import in_order
from granufab.io.import_summary import ImportSummary
from granufab.io.read_options import ReadOptions
from granufab.packing import Array, IntArray, Packing

__all__ = ["SKIPS", "ForeignFrames", "foreign_run"]

SKIPS = "; skip_damaged (--skip-damaged) reads the other frames"
"""What the message of a damaged frame ends with where the others can be read."""
UNDEFORMED = 1e-9
"""Largest change of an edge, as a share of the cell, of a cell that does not deform."""


def foreign_run(name: str, files: Sequence[Path], source: Source, options: ReadOptions) -> Run:
    """Open a source as a run; ``run.frames.summary`` fills as its frames are read.

    Args:
        name: of the format, in words.
        files: that the source reads.
        source: the opened files.
        options: what the user adds.
    Raises:
        MissingData: the source holds no frame with grains.
        CorruptFile: the first frame is damaged, or with ``skip_damaged`` all are.
        InvalidSettings: none of the frames is chosen.
    """
    summary = ImportSummary(
        format=name,
        files=tuple(str(file) for file in files),
        frames=len(source),
        unknown_columns=tuple(source.unknown),
        notes=tuple(source.notes),
    )
    frames = ForeignFrames(source, options, summary)
    first = frames[0].packing
    criterion = "gap:0.0"
    if first.contacts is not None:
        criterion = "listed" if first.contacts.force is None else "force"
    settings: dict[str, object] = {
        "record": {"criterion": criterion},
        "sample": {"dimension": first.dimension},
        "format": name,
    }
    if options.friction is not None:
        settings["material"] = {"friction": options.friction}
    return Run(
        series_source=series_dataset([], {"criterion": criterion}),
        frames=frames,
        settings=settings,
        name=Path(files[0]).stem,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """How the series is strained: the first cell, the two axes, which source says so."""

    start: Array | None
    direction: Array
    extension: Array
    known: str
    free: tuple[int, ...] = ()


class ForeignFrames(Sequence[Frame]):
    """The frames of a source that hold grains; each is parsed when it is asked for.

    Frames have the numbers of the data, from 0 for the first that holds grains. A chosen part of
    them (``frames``) and what is left after damaged ones (``skip_damaged``) are counted on from 0
    again, and :attr:`numbers` tells which they are. Whether a frame is damaged shows when it is
    read, so with ``skip_damaged`` a loop over the frames reads each of them once, while their
    count and negative indices read on to the end first.

    Args:
        source: the opened files.
        options: what the user adds.
        summary: filled while frames are read.
    Raises:
        MissingData: no frame has grains.
        InvalidSettings: none of the frames is chosen.
        CorruptFile: the first frame is damaged.
    """

    def __init__(self, source: Source, options: ReadOptions, summary: ImportSummary) -> None:
        self._source, self._options, self.summary = source, options, summary
        self._begun: FoundFrame | None = None
        self._start: tuple[int, FoundCell | None] | None = None
        self._counted: set[int] = set()
        self._order: IntArray | None = None
        self._latest: tuple[int, Frame] | None = None
        self._empty = self._leading_empty()
        self._wanted = self._chosen(len(source) - self._empty)
        self._untried = iter(self._wanted if options.skip_damaged else ())
        self._good = [] if options.skip_damaged else list(self._wanted)
        self._path: _Path | None = None

    def _leading_empty(self) -> int:
        """Empty frames at the beginning: dumps often start before the first insertion."""
        for index in range(len(self._source)):
            try:
                found = self._source[index]
            except CorruptFile as error:
                if self._options.skip_damaged:
                    return index
                raise self._naming_the_option(error) from None
            if len(found.position):
                self.summary.empty_frames += index
                self._begun = found
                return index
        raise MissingData(f"{self.summary.files[0]}: no frame of this data has grains")

    def _chosen(self, count: int) -> range:
        wanted = range(count)[self._options.frame_slice()]
        if not wanted:
            raise InvalidSettings(
                f"frames {self._options.frames!r}: {self.summary.files[0]} holds frames "
                f"0..{count - 1}"
            )
        if wanted.start:
            self._begun = None
        return wanted

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers that the frames have in the data; reads on to the end where it must."""
        self._seek(None)
        return tuple(self._good)

    def number(self, place: int) -> int:
        """The number in the data of the frame at a place ≥ 0, which has been read."""
        return self._good[place]

    def __len__(self) -> int:
        self._seek(None)
        return len(self._good)

    def __iter__(self) -> Iterator[Frame]:
        place = 0
        while self._seek(place):
            yield self[place]
            place += 1

    @overload
    def __getitem__(self, index: int, /) -> Frame: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Frame]: ...
    def __getitem__(self, index: int | slice, /) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        place = index + len(self) if index < 0 else index
        if place < 0 or not self._seek(place):
            raise IndexError(f"frame {index}, allowed: 0..{len(self) - 1}")
        return self._read(self._good[place])

    def _seek(self, place: int | None) -> bool:
        """Whether there is a frame at that place, after trying frames up to it (None: all)."""
        while place is None or place >= len(self._good):
            number = next(self._untried, None)
            if number is None:
                break
            try:
                self._read(number)
            except (CorruptFile, MissingData) as error:
                if isinstance(error, MissingData) and not self._good:
                    raise  # what the first frame lacks is no damage
                self.summary.skipped_frames.append({"frame": number, "reason": str(error)})
            else:
                self._good.append(number)
        if not self._good and self.summary.skipped_frames:
            raise CorruptFile(
                f"{self.summary.files[0]}: all {len(self._wanted)} frames are damaged; the first: "
                f"{self.summary.skipped_frames[0]['reason']}"
            )
        return place is not None and place < len(self._good)

    def _read(self, number: int) -> Frame:
        """The frame of a number; the latest one is kept."""
        if self._latest is None or self._latest[0] != number:
            self._latest = None  # before the next is read: one frame in memory, not two
            try:
                found = self._found(number)
                packing = self._packing(found, number)
            except (CorruptFile, MissingData) as error:
                raise self._naming_the_option(error) from None
            if self._start is None:
                self._start = number, found.cell
            self._latest = (number, self._frame(packing, found.cell, number))
        return self._latest[1]

    def _naming_the_option(self, error: CorruptFile | MissingData) -> CorruptFile | MissingData:
        """The error of one frame, with what reads the others."""
        all_alike = isinstance(error, MissingData) and self._start is None
        if self._options.skip_damaged or len(self._source) < 2 or all_alike:
            return error
        return type(error)(f"{error}{SKIPS}")

    def _packing(self, found: FoundFrame, number: int) -> Packing:
        """The state, its grains in the order of the first frame read; counted once."""
        again = number in self._counted
        counts = ImportSummary(format=self.summary.format)
        packing = assemble(found, self._options, counts)
        if not again:  # not before: a damaged frame counts nothing
            self.summary.add(counts)
        self._counted.add(number)
        if self._order is None:
            self._order = packing.grains.number
        return packing if self._order is None else in_order(packing, self._order)

    def _found(self, number: int) -> FoundFrame:
        """A frame as the source gives it; what the beginning parsed already is used once."""
        begun, self._begun = self._begun, None
        if begun is not None and number == 0:
            return begun
        with told_by_system(Path(self.summary.files[0])):
            return self._source[number + self._empty]

    def _frame(self, packing: Packing, cell: FoundCell | None, number: int) -> Frame:
        assert self._start is not None
        path = self._strained(packing)
        since = number - self._start[0]
        strain, eps_q = _strain(path, packing, cell, since, self._options.strain)
        return Frame(
            packing=packing,
            eps_q=eps_q,
            eps_q_total=abs(eps_q),
            strain=strain,
            stage=0,
            stress=_stress(packing),
            inertial_number=float("nan"),
            direction=path.direction,
            extension=path.extension if packing.dimension == 3 else None,
        )

    def _last_cell(self) -> FoundCell | None:
        """Of the last frame that is no corrupt one: it tells whether the cell deforms."""
        assert self._start is not None
        for number in reversed(self._wanted):
            if number <= self._start[0]:
                break
            with suppress(CorruptFile):
                return self._source[number + self._empty].cell
        return self._start[1]

    def _strained(self, packing: Packing) -> _Path:
        """The path, found once from the first and the last cell."""
        if self._path is None:
            start = None if self._start is None else self._start[1]
            self._path = _path_of(start, self._last_cell, packing, self._options)
            self.summary.conventions["strain"] = self._path.known
        return self._path


def _path_of(
    first: FoundCell | None,
    last: Callable[[], FoundCell | None],
    packing: Packing,
    options: ReadOptions,
) -> _Path:
    dimension = packing.dimension
    given = options.direction(dimension)
    start, free = _lattice(first, dimension), _free_axes(first, dimension)
    end = None if options.strain is not None or start is None else _lattice(last(), dimension)
    if start is not None and end is not None:
        strain = logarithmic_strain(start, _held(end, start, free))
        if np.abs(strain).max() > UNDEFORMED:
            _, vectors = np.linalg.eigh(strain)
            contraction, extension = vectors[:, -1], vectors[:, 0]
            if given is not None:
                contraction, extension = given, _across(given)
            return _Path(start, contraction, extension, "from the cell matrix", free)
    direction = given if given is not None else np.eye(dimension)[-1]
    known = "unknown; give --strain (per frame)" if options.strain is None else "given"
    return _Path(None, direction, _across(direction), known)


def _lattice(cell: FoundCell | None, dimension: int) -> Array | None:
    """The lattice that followed the deformation."""
    if cell is None:
        return None
    matrix = cell.matrix if cell.followed is None else cell.followed
    lattice = np.array(matrix, float)[:dimension, :dimension]
    sound = np.isfinite(lattice).all() and np.linalg.det(lattice) > 0
    return lattice if sound else None  # a damaged last frame is refused when it is asked for


def _free_axes(cell: FoundCell | None, dimension: int) -> tuple[int, ...]:
    """Axes whose bounds follow the grains: their change is no strain."""
    free = () if cell is None else cell.free
    return tuple(k for k in range(dimension) if free and free[k])


def _held(now: Array, start: Array, free: tuple[int, ...]) -> Array:
    """A lattice with the edges of the free axes as they were at the start."""
    held = now.copy()
    for k in free:
        held[k, k] = start[k, k]
    return held


def logarithmic_strain(start: Array, now: Array) -> Array:
    """ln of the left stretch of F = H H₀⁻¹, contraction positive [-], shape (D, D).

    Args:
        start, now: cell matrices with lattice vectors as columns [m], shape (D, D).
    """
    directions, stretches, _ = np.linalg.svd(now @ np.linalg.inv(start))
    return -(directions * np.log(stretches)) @ directions.T


def _across(direction: Array) -> Array:
    """A unit vector perpendicular to ``direction``, along an axis where possible."""
    axis = np.eye(len(direction))[np.argmin(np.abs(direction))]
    across = axis - (axis @ direction) * direction
    return across / np.linalg.norm(across)


def _strain(
    path: _Path, packing: Packing, cell: FoundCell | None, since: int, per_frame: float | None
) -> tuple[Array, float]:
    dimension = packing.dimension
    lattice = _lattice(cell, dimension)
    if path.start is not None and lattice is not None:
        now = _held(lattice, path.start, path.free)
        strain = logarithmic_strain(path.start, now)
        two = path.direction @ strain @ path.direction - path.extension @ strain @ path.extension
        return strain, float(two)
    unknown = np.full((dimension, dimension), np.nan)
    return unknown, float("nan") if per_frame is None else since * per_frame


def _stress(packing: Packing) -> Array:
    try:
        return stress_tensor(packing)
    except MissingData:
        return np.full((packing.dimension, packing.dimension), np.nan)
