"""A case run into its folder: run.h5, settings.toml, series.csv, summary.json."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from granufab.errors import GranufabError, InvalidSettings
from granufab.history import Run
from granufab.io import RunFileWriter, read, write_json, write_series, write_text
from granufab.reproduce.start_state import find_start
from granufab.simulate.settings import Case, to_toml

__all__ = ["RUN_FILES", "Progress", "RunCase", "check_writable", "read_run", "run_into_folder"]

RUN_FILES = ("run.h5", "settings.toml", "series.csv", "summary.json")
"""What a run leaves in its folder."""

Progress = Callable[[str, float], None]
"""Called with what is being done and the fraction that is done, 0..1."""

RunCase = Callable[..., Run]
"""``run_case(case, *, record, progress, start=…) -> Run``."""


def run_into_folder(
    case: Case,
    folder: Path | str,
    *,
    force: bool = False,
    start: Any = None,
    progress: Progress | None = None,
    run_case: RunCase | None = None,
) -> Run:
    """Run a case and leave ``run.h5 settings.toml series.csv summary.json`` in a folder.

    The run file grows frame by frame while the case runs, so an interrupted run can be read.
    With ``sample.file`` the path starts from a state of a run file or of another program's data
    (:func:`granufab.reproduce.start_state.find_start`); the settings written beside the results
    hold its dimension, grain count and pressure, the summary what was done to it (``start``).

    Args:
        case: what to simulate.
        folder: made if missing; an earlier run in it is replaced only with ``force``.
        force: replace the four files where they exist.
        start: a sample made before (:func:`granufab.prepare`), instead of preparing one.
        progress: called a few times a second.
        run_case: what simulates; :func:`granufab.simulate.run_case` by default.
    Returns:
        The run, as simulated.
    Raises:
        InvalidSettings: the folder holds a run already, or cannot be written; nothing was
            computed or touched.
        GranufabError: ``sample.file`` cannot be read, or does not fit the case.
    """
    folder = Path(folder)
    held = [name for name in RUN_FILES if (folder / name).exists()]
    if held and not force:
        raise InvalidSettings(
            f"{folder}: holds {held[0]} already; nothing was changed; "
            "choose another folder, or --force to replace it"
        )
    check_writable(folder)
    found = None
    if start is None and case.sample.file is not None:
        found = find_start(case, folder, progress)
        case, start = found.case, found.packing
    simulate = run_case or _simulator()
    given = {} if start is None else {"start": start}
    for name in held:
        (folder / name).unlink()
    write_text(to_toml(case), folder / "settings.toml")
    settings = case.model_dump(mode="json")
    recorder = RunFileWriter(folder / "run.h5", settings=settings, force=True)
    try:
        with recorder:
            run = simulate(case, record=recorder, progress=progress, **given)
            if found is not None:
                run = replace(run, summary={**run.summary, "start": found.summary})
            recorder.close(None if run.summary.get("interrupted") else run.summary)
    except BaseException:
        if recorder.frame_count == 0:  # nothing worth keeping: a rerun needs no force
            for name in ("run.h5", "settings.toml"):
                (folder / name).unlink(missing_ok=True)
        raise
    write_series(run.series, folder / "series.csv", case.name)
    write_json(_summary(case, run), folder / "summary.json")
    return run


def _simulator() -> RunCase:
    from granufab.simulate import run_case  # compiles kernels: only where something is simulated

    return run_case


def _summary(case: Case, run: Run) -> dict[str, Any]:
    import granufab

    return {
        "granufab": granufab.__version__,
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
