"""A path through strain: the frames and the series that a run leaves.

:class:`Run` is what :func:`granufab.run` returns and what :func:`granufab.read` gives back from
a run file, so measures and figures need not know which of the two they hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from granufab.errors import MissingData
from granufab.packing import Array, Packing

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "SERIES_UNITS",
    "Frame",
    "FrameSource",
    "Recorder",
    "Run",
    "StepStatistics",
    "frame_before",
    "packing_of",
    "series_dataset",
]

SERIES_UNITS: dict[str, tuple[str, str]] = {
    "eps_q": ("-", "deviatoric strain, running"),
    "eps_q_total": ("-", "deviatoric strain, accumulated"),
    "z": ("-", "coordination number, all grains"),
    "z_backbone": ("-", "coordination number without rattlers"),
    "z_mechanical": ("-", "mechanical coordination number"),
    "rattler_fraction": ("-", "fraction of rattlers"),
    "a": ("-", "fabric anisotropy"),
    "a_signed": ("-", "signed fabric anisotropy"),
    "theta_c": ("degree", "major direction of the fabric"),
    "q_over_p": ("-", "stress ratio, from the principal stresses, unsigned"),
    "phi": ("-", "solid fraction"),
    "p": ("stress", "mean stress"),
    "residual": ("-", "largest solver residual since the last row"),
    "sweeps": ("-", "mean sweeps per step since the last row"),
    "overlap": ("mean diameter", "worst overlap since the last row"),
    "inertial_number": ("-", "inertial number"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StepStatistics:
    """How well the steps since the last record were solved.

    Attributes:
        steps: number of steps.
        nonconverged: steps that ended above the tolerance.
        sweeps: mean sweeps per step.
        residual: largest residual [-].
        residual_contact: largest single contact's share of it [-].
        violation: worst max(0, −ũ_n)·h / d [-].
        overlap: worst overlap [mean diameters].
        kinetic_ratio: kinetic energy / (p V) [-].
        pressure_error: worst |p − wanted| / wanted on the stress-driven components [-].
        contact_updates: local solves done.
        seconds: wall time [s].
    """

    steps: int = 0
    nonconverged: int = 0
    sweeps: float = 0.0
    residual: float = 0.0
    residual_contact: float = 0.0
    violation: float = 0.0
    overlap: float = 0.0
    kinetic_ratio: float = 0.0
    pressure_error: float = 0.0
    contact_updates: int = 0
    seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """A recorded state on a path.

    Attributes:
        packing: the state; its contacts are all pairs within the recording reach.
        eps_q: running deviatoric strain along the first stage's direction [-].
        eps_q_total: ∫|dε_q| [-].
        strain: accumulated logarithmic strain tensor, compression positive, shape (D, D).
        stage: index of the stage on the path.
        stress: contact stress, compression positive [N/m^(D−1)], shape (D, D).
        inertial_number: I of the imposed rate [-].
        direction: contraction axis of the first stage, unit vector, shape (D,).
        statistics: of the steps since the previous record.
        remap: accumulated integer lattice change of a sheared cell, shape (D, D).
        extension: extension axis of the first stage, unit vector, shape (D,), where a 3D loading
            drives the axes across ``direction`` differently (simple shear, true triaxial).
    """

    packing: Packing
    eps_q: float
    eps_q_total: float
    strain: Array
    stage: int
    stress: Array
    inertial_number: float
    direction: Array
    statistics: StepStatistics = StepStatistics()
    remap: Array | None = None
    extension: Array | None = None


def packing_of(state: Frame | Packing) -> Packing:
    """The packing of a frame, or the packing itself."""
    return state.packing if isinstance(state, Frame) else state


class FrameSource(Protocol):
    """A lazy sequence of frames."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[Frame]: ...

    def __getitem__(self, index: int, /) -> Frame: ...


@runtime_checkable
class Recorder(Protocol):
    """What :func:`granufab.run` calls while it runs; ``series`` rows are more frequent."""

    def frame(self, frame: Frame) -> None:
        """Receive a complete state."""
        ...

    def row(self, row: Mapping[str, float]) -> None:
        """Receive one row of the series (keys: :data:`SERIES_UNITS` and ``path``)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Frames, series and summary of one path.

    Attributes:
        series_source: the series, or what makes it when it is first asked for.
        frames: recorded states, lazy where they lie in a file.
        settings: resolved settings as plain data.
        summary: solver figures and reached values as plain data.
        name: the path's name.
    """

    series_source: xr.Dataset | Callable[[], xr.Dataset]
    frames: FrameSource | Sequence[Frame]
    settings: Mapping[str, Any] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    name: str = "run"

    @cached_property
    def series(self) -> xr.Dataset:
        """Dataset over dimension ``record``; variables as :data:`SERIES_UNITS`."""
        source = self.series_source
        return source() if callable(source) else source

    @cached_property
    def dimension(self) -> int:
        """2 or 3.

        Raises:
            MissingData: there are no frames.
        """
        for frame in self.frames:
            return frame.packing.dimension
        raise MissingData(f"run {self.name!r} has no recorded frames")

    def packings(self) -> Iterator[Packing]:
        """The states alone, one after another."""
        for frame in self.frames:
            packing = frame.packing
            del frame  # before the next one is read
            yield packing


def frame_before(frames: FrameSource | Sequence[Frame], end: int, strain: float) -> Frame | None:
    """The latest frame of the same stage at least ``strain`` (in ∫|dε_q|) before frame ``end``.

    Args:
        frames: recorded states.
        end: index, may be negative.
        strain: |Δε_q| between the two.
    """
    last = frames[end]
    index = end if end >= 0 else len(frames) + end
    for earlier in range(index - 1, -1, -1):
        frame = frames[earlier]
        if frame.stage != last.stage:
            return None
        if frame.eps_q_total <= last.eps_q_total - strain * (1 - 1e-9):
            return frame
    return None


def series_dataset(
    rows: Sequence[Mapping[str, float]], attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Rows of a series as a Dataset with units and definitions.

    Args:
        rows: mappings with the keys of :data:`SERIES_UNITS` (others are kept without units).
        attributes: criterion, z_definition and other provenance.
    """

    import xarray as xr  # slow to import: only where a Dataset is made

    names = list(rows[0]) if rows else list(SERIES_UNITS)
    data = {}
    for name in names:
        if name == "path":
            continue
        unit, text = SERIES_UNITS.get(name, ("-", name))
        values = np.array([row[name] for row in rows], dtype=float)
        data[name] = ("record", values, {"units": unit, "long_name": text})
    return xr.Dataset(data, attrs=dict(attributes))
