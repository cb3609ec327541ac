"""The state from which a run starts: a frame of a run file, or of another program's data.

A frame of an own run file starts a run as it is. A foreign state, also one that was imported into a
run file, gets masses from the density where it has none, the pressure of its contact forces where
the case gives none, and overlaps of soft grains are relaxed (:func:`granufab.simulate.relax`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from granufab.errors import CorruptFile, GranufabError, InvalidSettings, MissingData
from granufab.history import Run
from granufab.io import ForeignFrames, read, read_column_map
from granufab.io.foreign_run import SKIPS
from granufab.packing import Packing
from granufab.simulate.settings import Case, Reading, parse_case

__all__ = ["Start", "find_start", "with_start_size"]

Progress = Callable[[str, float], None]
SAME_PRESSURE = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """A starting state and what was done to it.

    Attributes:
        case: with dimension, grain count, diameter and pressure of the state.
        packing: the state.
        summary: plain data: files, frame, notes of the reading, pressure and where it comes from,
            ``relaxed`` with the values before and after.
    """

    case: Case
    packing: Packing
    summary: dict[str, Any]

    @property
    def lines(self) -> list[str]:
        """What was done, for a person."""
        return list(self.summary["notes"])


def find_start(case: Case, folder: Path, progress: Progress | None = None) -> Start:
    """Read the state that ``sample.file`` names and make it ready.

    Args:
        case: with ``sample.file``.
        folder: to which the run will be written; it must not hold that file.
        progress: called while overlaps are relaxed.
    Raises:
        InvalidSettings: the state does not fit the case, or is the file to be written.
        MissingData: it lacks what a simulation needs, or there is no such file.
        GranufabError: as of :func:`granufab.read`.
    """
    sample = case.sample
    files = _files(case)
    if not files:
        raise InvalidSettings('sample.file names no file; give file = "run.h5"')
    for file in files:
        if Path(file).resolve() == (folder / "run.h5").resolve():
            raise InvalidSettings(
                f"sample.file {file}: is the file to be written; give another --out"
            )
    run = _open(files, sample.read)
    packing = _frame(run, files[0], sample.frame)
    case = _for_dimension(case, packing, files[0])
    summary: dict[str, Any] = {"files": list(files), "frame": sample.frame, "notes": []}
    if isinstance(run.frames, ForeignFrames):
        read_lines = run.frames.summary.lines()
        summary["notes"] += [line for line in read_lines if not line.startswith("strain:")]
    foreign = _is_foreign(run)
    if foreign:
        packing = _with_mass(packing, case.sample.density, summary)
    own = run.settings.get("sample", {}) if not foreign else {}
    case = _for_pressure(case, packing, own.get("pressure"), summary)
    if foreign:
        packing = _made_hard(case, packing, summary, progress)
    return Start(case=case, packing=packing, summary=summary)


def with_start_size(case: Case) -> Case:
    """A case with dimension, grain count and mean diameter of the state that it starts from.

    Raises:
        InvalidSettings: the state does not fit the case.
        GranufabError: as of :func:`granufab.read`.
    """
    files = _files(case)
    if not files:
        return case
    packing = _frame(_open(files, case.sample.read), files[0], case.sample.frame)
    return _for_dimension(case, packing, files[0])


def _files(case: Case) -> tuple[str, ...]:
    file = case.sample.file
    return (file,) if isinstance(file, str) else tuple(file or ())


def _open(files: tuple[str, ...], reading: Reading) -> Run:
    given = {
        name: value
        for name, value in reading.model_dump().items()
        if value not in (None, False) and name != "columns"
    }
    if reading.columns is not None:
        given["columns"] = read_column_map(reading.columns)
    try:
        return read(*files, **given)
    except GranufabError as error:
        raise type(error)(f"sample.file {error}") from None


def _is_foreign(run: Run) -> bool:
    """Whether another program made the states, imported into a run file or not."""
    return isinstance(run.frames, ForeignFrames) or "format" in run.settings


def _are_round(run: Run) -> bool:
    if isinstance(run.frames, ForeignFrames):
        return run.frames.summary.round_grains
    return bool(run.summary.get("round_grains", True))


def _frame(run: Run, file: str, index: int) -> Packing:
    count = len(run.frames)
    if count == 0:
        raise MissingData(f"sample.file {file}: holds no frame to start from")
    if not -count <= index < count:
        raise InvalidSettings(
            f"sample.frame is {index}, {file} holds {count} frames (0..{count - 1}, or -1)"
        )
    try:
        packing = run.frames[index].packing
    except (CorruptFile, MissingData) as error:
        text = str(error).replace(SKIPS, "; choose another sample.frame")
        raise type(error)(f"sample.file {text}") from None
    if not _are_round(run):
        raise InvalidSettings(
            f"sample.file {file}: its grains are not disks or spheres; a run takes round grains"
        )
    return packing


def _for_dimension(case: Case, packing: Packing, file: str) -> Case:
    """The case with the dimension, grain count and mean diameter of the state."""
    sample = case.sample
    if "dimension" in sample.model_fields_set and packing.dimension != sample.dimension:
        raise InvalidSettings(
            f"sample.file {file}: holds a {packing.dimension}D state, "
            f"sample.dimension is {sample.dimension}"
        )
    return _updated(
        case,
        dimension=packing.dimension,
        grain_count=packing.grains.count,
        diameter=float(2 * packing.grains.radius.mean()),
    )


def _updated(case: Case, **values: Any) -> Case:
    """The case with other values of its sample, checked again; what was given stays given."""
    sample = case.sample.model_copy(update=values)
    plain = case.model_dump() | {"sample": sample.model_dump(exclude_unset=True)}
    return parse_case(plain)


def _with_mass(packing: Packing, density: float, summary: dict[str, Any]) -> Packing:
    if packing.grains.mass is not None:
        return packing
    from granufab.simulate.sample import grain_mass

    summary["notes"].append(f"masses: from sample.density = {density:g}")
    mass = grain_mass(packing.grains.radius, density, packing.dimension)
    return replace(packing, grains=replace(packing.grains, mass=mass))


def _for_pressure(case: Case, packing: Packing, own: float | None, summary: dict[str, Any]) -> Case:
    """The case with the pressure that it gives, else that of the run, of the forces, or 1."""
    from granufab.simulate import pressure_of

    found = pressure_of(packing)
    if "pressure" in case.sample.model_fields_set:
        pressure, source = case.sample.pressure, "sample.pressure"
    elif own is not None:
        pressure, source = own, "the run that made the state"
    elif found is not None:
        pressure, source = found, "the mean contact stress of the state"
    else:
        pressure, source = case.sample.pressure, "the default: the state has no forces"
    summary |= {"pressure": pressure, "pressure_from": source, "contact_pressure": found}
    summary["notes"].append(f"pressure: {pressure:.6g}, {source}")
    return _updated(case, pressure=pressure)


def _made_hard(
    case: Case, packing: Packing, summary: dict[str, Any], progress: Progress | None
) -> Packing:
    """The state, relaxed unless its overlaps are small and its forces carry the pressure."""
    from granufab.simulate import HARD, overlaps, relax

    pressure, found = case.sample.pressure, summary["contact_pressure"]
    carried = found is not None and abs(found / pressure - 1) < SAME_PRESSURE
    summary["relaxed"] = None
    if carried and overlaps(packing) < HARD:
        summary["notes"].append(
            f"overlaps: up to {overlaps(packing):.1e} d, started as it is, at rest"
        )
        grains = replace(packing.grains, velocity=None, spin=None)
        cell = None if packing.cell is None else replace(packing.cell, rate=None)
        return replace(packing, grains=grains, cell=cell)
    relaxed = relax(
        packing,
        friction=case.material.friction,
        wall_friction=case.material.wall_friction,
        pressure=pressure,
        progress=progress,
    )
    plain = asdict(replace(relaxed, packing=None))  # type: ignore[arg-type]
    del plain["packing"]
    summary["relaxed"] = plain
    summary["notes"].append(relaxed.text)
    return relaxed.packing
