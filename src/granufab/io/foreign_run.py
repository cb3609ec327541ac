"""A foreign source as a run: frames assembled when asked for, with strain where it is known.

Strain comes from the cell matrix where it deforms, F = H H₀⁻¹ and the logarithm of F Fᵀ/2, else
from the user's strain per frame, else it is unknown (NaN). ε_q is its part along the contraction
axis, against the extension axis, as in the program's own runs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import numpy as np

from granufab.errors import CorruptFile, MissingData
from granufab.fabric.stress import stress_tensor
from granufab.history import Frame, Run, series_dataset
from granufab.io.assemble import assemble
from granufab.io.found import FoundCell, FoundFrame, Source
from granufab.io.given_files import told_by_system
from granufab.io.grain_order import in_order
from granufab.io.import_summary import ImportSummary
from granufab.io.read_options import ReadOptions
from granufab.packing import Array, IntArray, Packing

__all__ = ["ForeignFrames", "foreign_run"]

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

    Args:
        source: the opened files.
        options: what the user adds.
        summary: filled while frames are read.
    """

    def __init__(self, source: Source, options: ReadOptions, summary: ImportSummary) -> None:
        self._source, self._options, self.summary = source, options, summary
        self._begun: FoundFrame | None = None
        self._start: FoundCell | None = None
        self._counted: set[int] = set()
        self._order: IntArray | None = None
        self._latest: tuple[int, Frame] | None = None
        self._skip = self._leading_empty()
        self._path: _Path | None = None

    def _leading_empty(self) -> int:
        """Empty frames at the beginning: dumps often start before the first insertion."""
        for index in range(len(self._source)):
            found = self._source[index]
            if len(found.position):
                self.summary.empty_frames += index
                self._begun, self._start = found, found.cell
                return index
        raise MissingData(f"{self.summary.files[0]}: no frame of this data has grains")

    def __len__(self) -> int:
        return len(self._source) - self._skip

    @overload
    def __getitem__(self, index: int, /) -> Frame: ...
    @overload
    def __getitem__(self, index: slice, /) -> list[Frame]: ...
    def __getitem__(self, index: int | slice, /) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        place = index + len(self) if index < 0 else index
        if not 0 <= place < len(self):
            raise IndexError(f"frame {index}, allowed: 0..{len(self) - 1}")
        if self._latest is None or self._latest[0] != place:
            self._latest = None  # before the next is read: one frame in memory, not two
            found = self._found(place)
            self._latest = (place, self._frame(self._packing(found, place), found.cell, place))
        return self._latest[1]

    def _packing(self, found: FoundFrame, place: int) -> Packing:
        """The state, its grains in the order of the first frame read; counted once."""
        again = place in self._counted
        summary = ImportSummary(format=self.summary.format) if again else self.summary
        packing = assemble(found, self._options, summary)
        self._counted.add(place)
        if self._order is None:
            self._order = packing.grains.number
        return packing if self._order is None else in_order(packing, self._order)

    def _found(self, place: int) -> FoundFrame:
        """A frame as the source gives it; what the beginning parsed already is used once."""
        begun, self._begun = self._begun, None
        if begun is not None and place == 0:
            return begun
        with told_by_system(Path(self.summary.files[0])):
            return self._source[place + self._skip]

    def _frame(self, packing: Packing, cell: FoundCell | None, place: int) -> Frame:
        path = self._strained(packing)
        strain, eps_q = _strain(path, packing, cell, place, self._options.strain)
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
        for index in range(len(self._source) - 1, self._skip, -1):
            with suppress(CorruptFile):
                return self._source[index].cell
        return self._start

    def _strained(self, packing: Packing) -> _Path:
        """The path, found once from the first and the last cell."""
        if self._path is None:
            self._path = _path_of(self._start, self._last_cell, packing, self._options)
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
            values, vectors = np.linalg.eigh(strain)
            contraction, extension = vectors[:, -1], vectors[:, 0]
            del values
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
    path: _Path, packing: Packing, cell: FoundCell | None, place: int, per_frame: float | None
) -> tuple[Array, float]:
    dimension = packing.dimension
    lattice = _lattice(cell, dimension)
    if path.start is not None and lattice is not None:
        now = _held(lattice, path.start, path.free)
        strain = logarithmic_strain(path.start, now)
        two = path.direction @ strain @ path.direction - path.extension @ strain @ path.extension
        return strain, float(two)
    unknown = np.full((dimension, dimension), np.nan)
    return unknown, float("nan") if per_frame is None else place * per_frame


def _stress(packing: Packing) -> Array:
    try:
        return stress_tensor(packing)
    except MissingData:
        return np.full((packing.dimension, packing.dimension), np.nan)
