"""Run a campaign: expand it, see what is done, run the rest, gather."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from granufab.campaign.case_work import Task
from granufab.campaign.dask_pool import check_dask, run_dask
from granufab.campaign.expansion import Member, expand
from granufab.campaign.folder import CampaignFolder, seconds_of_run, state_of_folder
from granufab.campaign.identity import digest_of
from granufab.campaign.ledger import UNWANTED, Ledger, Row, read_table
from granufab.campaign.local_pool import run_local
from granufab.campaign.manifest import write_manifest
from granufab.campaign.results import gather
from granufab.campaign.settings import Sweep, load_sweep
from granufab.errors import InvalidSettings, MissingData
from granufab.io import RunLock, write_dataset, write_json
from granufab.reproduce.case_folder import RunCase, check_writable
from granufab.simulate.team import core_count
from granufab.version import VERSION

__all__ = ["plan_workers", "prepare_manifest", "run_campaign"]

Shown = Callable[[Ledger], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Campaign:
    sweep: Sweep
    place: CampaignFolder
    members: list[Member]
    ledger: Ledger


def run_campaign(
    sweep: Sweep | Path | str,
    folder: Path | str,
    *,
    dask: str | None = None,
    workers: int | None = None,
    threads: int | None = None,
    retry: bool = False,
    gather_only: bool = False,
    progress: Shown | None = None,
    run_case: RunCase | None = None,
) -> dict[str, Any]:
    """Run every case of a campaign that is not done, then gather the results.

    The folder holds ``cases.csv`` (state of each case), ``cases/ID`` (what ``granufab run``
    leaves), ``results.nc``, ``summary.json`` and ``campaign.json``. The same call again goes on
    where an interrupted campaign stopped. In a script, call it below
    ``if __name__ == "__main__":``, since the workers are processes.

    Args:
        sweep: the campaign, or its file.
        folder: of the campaign.
        dask: None for processes of this machine; "local", "slurm", "pbs", "sge" or an address.
        workers: cases at a time; default as many as the cores allow.
        threads: of each case; workers × threads is at most the cores of this machine.
        retry: run failed cases again.
        gather_only: run nothing: look at the folders of the cases and gather.
        progress: called with the ledger after each change; may raise KeyboardInterrupt to stop.
        run_case: what simulates a case; importable by the workers.
    Returns:
        The summary, as ``summary.json`` holds it.
    Raises:
        InvalidSettings: the campaign, one of its cases or an option is bad, or another process
            runs it; nothing was run.
        MissingData: an extra is not installed; nothing was run.
    """
    sweep, members = _expanded(sweep)
    crew = plan_workers(len(members), workers, threads, limited=dask in (None, "local"))
    if dask is not None:
        check_dask(dask)
    began = time.monotonic()
    check_writable(Path(folder))
    with RunLock(folder):
        campaign = _open(sweep, members, Path(folder), retry)
        campaign.ledger.write()
        campaign.ledger.shown = progress
        interrupted = not gather_only and not _run(campaign, dask, crew, run_case)
        how = {"where": dask or "processes", "workers": crew[0], "threads": crew[1]}
        return _conclude(campaign, interrupted, time.monotonic() - began, how)


def _run(
    campaign: _Campaign, dask: str | None, crew: tuple[int, int], run_case: RunCase | None
) -> bool:
    """Run what is not done; False where it was interrupted."""
    ledger = campaign.ledger
    tasks = _tasks(campaign, crew[1])
    try:
        if dask is None:
            run_local(tasks, ledger, workers=crew[0], run_case=run_case)
        else:
            run_dask(tasks, ledger, where=dask, workers=crew[0], run_case=run_case)
    except KeyboardInterrupt:
        return False
    finally:
        ledger.shown = None
        ledger.stop()
        ledger.write()
    return True


def prepare_manifest(
    sweep: Sweep | Path | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    threads: int | None = None,
    retry: bool = False,
) -> dict[str, Any]:
    """Write the manifest and the scripts of a campaign instead of running it; gather what is done.

    Args:
        sweep: the campaign, or its file.
        folder: of the campaign.
        workers: processes of the script for one machine.
        threads: of each case.
        retry: run failed cases again.
    Returns:
        The summary, as ``summary.json`` holds it.
    Raises:
        InvalidSettings: the campaign or one of its cases is bad.
    """
    sweep, members = _expanded(sweep)
    workers, threads = plan_workers(len(members), workers, threads, limited=False)
    check_writable(Path(folder))
    with RunLock(folder):
        campaign = _open(sweep, members, Path(folder), retry)
        done = {row.id for row in campaign.ledger.in_state("done")}
        crew = {"threads": threads, "workers": workers}
        write_manifest(campaign.place, campaign.members, done, name=sweep.name, **crew)
        campaign.ledger.write()
        return _conclude(campaign, False, 0.0, {"where": "manifest", **crew})


def plan_workers(
    cases: int, workers: int | None, threads: int | None, *, limited: bool = True
) -> tuple[int, int]:
    """Workers and threads of each, so that no core has two things to do.

    Args:
        cases: how many there are.
        workers: wanted, or None.
        threads: of each case, or None for what the workers leave.
        limited: refuse more than this machine has; the cores of a cluster are its own affair.
    Raises:
        InvalidSettings: workers × threads is more than the cores of this machine.
    """
    cores = core_count()
    for name, value in (("workers", workers), ("threads", threads)):
        if value is not None and value < 1:
            raise InvalidSettings(f"{name} is {value}, must be ≥ 1")
    if workers is None:
        workers = max(1, min(cases, cores // (threads or 1)))
    if threads is None:
        threads = max(1, cores // workers) if limited else 1
    if limited and workers * threads > cores:
        raise InvalidSettings(
            f"{workers} workers of {threads} threads need {workers * threads} cores, this machine "
            f"has {cores}; give fewer workers or threads"
        )
    return workers, threads


def _expanded(sweep: Sweep | Path | str) -> tuple[Sweep, list[Member]]:
    """The campaign and its cases, all validated."""
    if isinstance(sweep, Sweep):
        return sweep, expand(sweep)
    loaded = load_sweep(sweep)
    return loaded, expand(loaded, where=str(sweep))


def _open(sweep: Sweep, members: Sequence[Member], folder: Path, retry: bool) -> _Campaign:
    """See what the folder holds already."""
    place = CampaignFolder(folder)
    earlier = {digest_of(row.id): row for row in read_table(place.table)}
    members = [_as_before(member, earlier) for member in members]
    rows = {m.id: _row(place, m, earlier.pop(m.digest, None), retry) for m in members}
    unwanted = [replace(row, reason=UNWANTED) for row in earlier.values()]
    place.write_notes(sweep.name, sweep.names(), members)
    ledger = Ledger(path=place.table, names=tuple(sweep.names()), rows=rows, unwanted=unwanted)
    return _Campaign(sweep=sweep, place=place, members=members, ledger=ledger)


def _as_before(member: Member, earlier: dict[str, Row]) -> Member:
    """The member under the id that a case of the same settings had before."""
    row = earlier.get(member.digest)
    if row is None or row.id == member.id:
        return member
    return replace(member, id=row.id, case=member.case.model_copy(update={"name": row.id}))


def _row(place: CampaignFolder, member: Member, earlier: Row | None, retry: bool) -> Row:
    folder = place.case(member.id)
    state, reason = state_of_folder(folder, member.digest)
    failed_before = earlier is not None and earlier.state == "failed"
    if state != "done" and earlier is not None and failed_before:
        state, reason = "failed", reason or earlier.reason
    if state == "failed" and retry:
        _forget_job(folder)
        state, reason = state_of_folder(folder, member.digest)
    seconds = 0.0 if earlier is None else earlier.seconds
    return Row(
        id=member.id,
        parameters=member.parameters,
        seed=member.seed,
        state=state,
        reason=reason,
        seconds=seconds_of_run(folder) if state == "done" and not seconds else seconds,
    )


def _forget_job(folder: Path) -> None:
    for name in ("job.code", "job.log"):
        (folder / name).unlink(missing_ok=True)


def _tasks(campaign: _Campaign, threads: int) -> list[Task]:
    wanted = {row.id for row in campaign.ledger.in_state("waiting", "interrupted")}
    tasks = []
    for member in campaign.members:
        if member.id in wanted:
            folder = campaign.place.case(member.id).resolve()
            _forget_job(folder)
            tasks.append(
                Task(
                    id=member.id,
                    case=member.case,
                    folder=folder,
                    start=Path.cwd(),
                    threads=threads,
                )
            )
    return tasks


def _conclude(
    campaign: _Campaign, interrupted: bool, seconds: float, how: dict[str, Any]
) -> dict[str, Any]:
    """Gather what is done and leave the summary."""
    ledger, place = campaign.ledger, campaign.place
    results = None
    if not interrupted and ledger.count()["done"]:
        try:
            write_dataset(gather(place.path), place.results)
            results = place.results.name
        except MissingData:  # cases that were taken away in the meantime
            results = None
    summary = {
        "granufab": VERSION,
        "name": campaign.sweep.name,
        **how,
        "cases": len(ledger.rows),
        **ledger.count(),
        "failures": {row.id: row.reason for row in ledger.in_state("failed")},
        "unwanted": [row.id for row in ledger.unwanted],
        "stopped": interrupted,
        "seconds": seconds,
        "seconds_of_cases": sum(row.seconds for row in ledger.rows.values()),
        "results": results,
    }
    write_json(summary, place.summary)
    return summary
