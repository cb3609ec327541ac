"""A case run into its folder: run.h5, settings.toml, series.csv, summary.json."""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from granufab.errors import BrokenState, GranufabError, InvalidSettings, NotConverged
from granufab.history import Run
from granufab.io import (
    Checkpoint,
    RunFileWriter,
    RunLock,
    describe,
    read,
    write_json,
    write_series,
    write_text,
)
from granufab.reproduce.checkpoints import (
    CHECKPOINT,
    Checkpoints,
    first_difference,
    forget_checkpoints,
    held_checkpoint,
)
from granufab.reproduce.preflight import check_fits
from granufab.reproduce.start_state import find_start
from granufab.simulate.settings import Case, load_case, parse_case, to_toml

__all__ = ["RUN_FILES", "Progress", "RunCase", "check_writable", "read_run", "run_into_folder"]

RUN_FILES = ("run.h5", "settings.toml", "series.csv", "summary.json")
"""What a run leaves in its folder."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction that is done, 0..1."""

RunCase = Callable[..., Run]
"""``run_case(case, *, record, progress, start=…, kept=…) -> Run``."""


def run_into_folder(
    case: Case,
    folder: Path | str,
    *,
    force: bool = False,
    resume: bool = False,
    elsewhere: bool = False,
    max_walltime: float = math.inf,
    start: Any = None,
    progress: Progress | None = None,
    run_case: RunCase | None = None,
) -> Run:
    """Run a case and leave ``run.h5 settings.toml series.csv summary.json`` in a folder.

    The run file grows frame by frame while the case runs, so an interrupted run can be read, and
    checkpoints (``record.checkpoint_seconds``, ``record.checkpoint_strain``) let it go on later
    with the same bits as if it had not been interrupted.
    With ``sample.file`` the path starts from a state of a run file or of another program's data
    (:func:`granufab.reproduce.start_state.find_start`); the settings written beside the results
    hold its dimension, grain count and pressure, the summary what was done to it (``start``).

    Args:
        case: what to simulate.
        folder: made if missing; an earlier run in it is replaced only with ``force``.
        force: replace the four files where they exist.
        resume: go on from the last checkpoint of the same case; without one start afresh; a run
            that is finished is returned as it is.
        elsewhere: resume also with another processor or version, whose bits may differ.
        max_walltime: end with a checkpoint after this time [s].
        start: a sample made before (:func:`granufab.prepare`), instead of preparing one.
        progress: called a few times a second.
        run_case: what simulates; :func:`granufab.simulate.run_case` by default. Another one gets
            no ``kept`` and leaves no checkpoints.
    Returns:
        The run, as recorded.
    Raises:
        InvalidSettings: the folder holds a run already, another process uses it, it cannot be
            written, or memory or disk do not suffice; nothing was computed or touched.
        GranufabError: ``sample.file`` cannot be read, or does not fit the case.
    """
    folder = Path(folder)
    deadline = time.monotonic() + max_walltime
    check_writable(folder)
    with RunLock(folder):
        job = _Job(case, folder, deadline, progress, run_case)
        if resume and run_case is None:
            found = _finished(folder, case)
            if found is not None:
                return found
            held = held_checkpoint(folder, case, job.engine, elsewhere=elsewhere)
            if held is not None and (folder / "run.h5").exists():
                return job.go_on(held)
        if not resume or _run_of_another(folder, case):
            _check_empty(folder, force=force)
        return job.begin(start)


class _Job:
    """One run of a case into its folder."""

    def __init__(
        self,
        case: Case,
        folder: Path,
        deadline: float,
        progress: Progress | None,
        run_case: RunCase | None,
    ) -> None:
        self.given, self.folder, self.deadline = case, folder, deadline
        self.keeps, self.simulate = run_case is None, run_case or _simulator()
        self._told = progress

    @cached_property
    def engine(self) -> dict[str, str]:
        """What made the bits of this run."""
        from granufab.simulate.engine_path import engine_path

        return engine_path()

    def begin(self, start: Any) -> Run:
        """From the beginning; what an earlier run left is removed."""
        case, summary = self.given, None
        if start is None and case.sample.file is not None:
            found = find_start(case, self.folder, self.tell)
            case, start, summary = found.case, found.packing, found.summary
        check_fits(case, self.folder, prepared=start is not None)
        for name in RUN_FILES:
            (self.folder / name).unlink(missing_ok=True)
        forget_checkpoints(self.folder)
        write_text(to_toml(case), self.folder / "settings.toml")
        settings = case.model_dump(mode="json")
        writer = RunFileWriter(self.folder / "run.h5", settings=settings, force=True)
        notes = {
            "case": self.given.model_dump(mode="json"),
            "resolved": settings,
            "start": summary,
            "engine": self.engine if self.keeps else {},
            "sample": {},
        }
        return self._run(case, writer, notes, None, {} if start is None else {"start": start})

    def go_on(self, held: Checkpoint) -> Run:
        """From a checkpoint."""
        frames, rows = held.notes["frames"], held.notes["rows"]
        case = parse_case(held.notes["resolved"], where=str(self.folder / CHECKPOINT))
        check_fits(case, self.folder, prepared=True, frames=frames)
        writer = RunFileWriter.continued(self.folder / "run.h5", frames=frames, rows=rows)
        notes = {**held.notes, "engine": self.engine, "resumed": held.notes.get("resumed", 0) + 1}
        notes["warnings"] = [*notes.get("warnings", []), *([held.warning] if held.warning else [])]
        return self._run(case, writer, notes, held.arrays, {})

    def tell(self, text: str, fraction: float) -> None:
        """Pass the news on; while no state can be kept yet, end at the deadline."""
        if self._told is not None:
            self._told(text, fraction)
        if time.monotonic() >= self.deadline:
            raise KeyboardInterrupt

    def _run(
        self,
        case: Case,
        writer: RunFileWriter,
        notes: dict[str, Any],
        state: Mapping[str, Any] | None,
        given: dict[str, Any],
    ) -> Run:
        checkpoints = Checkpoints(
            folder=self.folder,
            writer=writer,
            notes=notes,
            seconds=case.record.checkpoint_seconds,
            strain=case.record.checkpoint_strain,
            deadline=self.deadline,
        )
        if self.keeps:
            from granufab.simulate import Kept

            path = self.folder / "run.h5"
            given["kept"] = Kept(
                keeper=checkpoints, recorded=lambda: read(path), state=state, sample=notes["sample"]
            )
        try:
            with writer:
                run = self.simulate(case, record=writer, progress=self.tell, **given)
                run = replace(run, summary=_with_notes(run.summary, notes, checkpoints))
                writer.close(None if run.summary.get("interrupted") else run.summary)
        except BaseException as error:
            if writer.frame_count == 0:  # nothing worth keeping: a rerun needs no force
                for name in ("run.h5", "settings.toml"):
                    (self.folder / name).unlink(missing_ok=True)
            elif isinstance(error, BrokenState | NotConverged):
                held = f"{writer.frame_count} good frames before it are in {writer.path}"
                raise type(error)(f"{error}; {held}") from None
            raise
        return _left(case, self.folder, run)


def _with_notes(
    summary: Mapping[str, Any], notes: Mapping[str, Any], checkpoints: Checkpoints
) -> dict[str, Any]:
    """The summary with what there is to say of start, engine and interruptions."""
    told = {**summary, "engine": notes["engine"], "resumed": notes.get("resumed", 0)}
    told["warnings"] = [*notes.get("warnings", []), *summary.get("warnings", [])]
    if notes["start"] is not None:
        told["start"] = notes["start"]
    if checkpoints.timed_out:
        told["stopped_by"] = "max_walltime"
    return told


def _left(case: Case, folder: Path, run: Run) -> Run:
    """Write series and summary; a run that is done needs its checkpoints no more."""
    write_series(run.series, folder / "series.csv", case.name)
    write_json(_summary(case, run), folder / "summary.json")
    if not run.summary.get("interrupted"):
        forget_checkpoints(folder)
    return run


def _check_empty(folder: Path, *, force: bool) -> None:
    held = [name for name in RUN_FILES if (folder / name).exists()]
    if held and not force:
        on = ", --resume to go on with it" if (folder / CHECKPOINT).exists() else ""
        raise InvalidSettings(
            f"{folder}: holds {held[0]} already; nothing was changed; "
            f"choose another folder{on}, or --force to replace it"
        )


def _finished(folder: Path, case: Case) -> Run | None:
    """The run of this case that is finished in the folder, or None.

    Raises:
        InvalidSettings: a run of another case is finished there.
    """
    if not all((folder / name).exists() for name in RUN_FILES):
        return None
    if not describe(folder / "run.h5")["finished"]:
        return None
    run = read(folder / "run.h5")
    difference = _run_of_another(folder, case)
    if difference:
        raise InvalidSettings(
            f"{folder}: a run with other settings is finished there: {difference}; "
            "choose another folder, or --force without --resume to replace it"
        )
    return run


def _run_of_another(folder: Path, case: Case) -> str:
    """How the settings of the run in the folder differ from the case; empty if they do not."""
    path = folder / "settings.toml"
    if not path.exists():
        return ""
    held = load_case(path).model_dump(mode="json")
    given = case.model_dump(mode="json")
    if case.sample.file is not None:  # these follow from the state it starts from
        for name in ("grain_count", "dimension", "diameter", "pressure"):
            if name not in case.sample.model_fields_set:
                given["sample"][name] = held["sample"][name]
        given["sample"]["grain_count"] = held["sample"]["grain_count"]
        given["sample"]["diameter"] = held["sample"]["diameter"]
    return first_difference(held, given)


def _simulator() -> RunCase:
    from granufab.simulate import run_case  # compiles kernels: only where something is simulated

    return run_case


def _summary(case: Case, run: Run) -> dict[str, Any]:
    from granufab.version import VERSION

    return {
        "granufab": VERSION,
        "name": case.name,
        "z_definition": case.record.z_definition,
        **run.summary,
    }


def check_writable(folder: Path) -> None:
    """Make ``folder`` and prove that a file can be written in it.

    Raises:
        InvalidSettings: it cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder, prefix=".granufab-")
        os.close(handle)
        Path(name).unlink()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InvalidSettings(f"{folder}: cannot be written ({reason})") from None


def read_run(folder: Path) -> Run:
    """The run that :func:`run_into_folder` left in ``folder``.

    Raises:
        GranufabError: there is none, or it is damaged.
    """
    path = folder / "run.h5"
    if not path.exists():
        raise GranufabError(f"{path}: the run left no run file")
    return read(path)
