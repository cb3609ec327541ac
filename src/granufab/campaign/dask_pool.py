"""Workers of Dask: on this machine, at an address, or as jobs of a cluster's queue."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from granufab.campaign.case_work import Outcome, Task, do_task, tell_now_and_then
from granufab.campaign.ledger import Ledger
from granufab.campaign.local_pool import MOST_DEATHS, PATIENCE
from granufab.errors import GranufabError, InvalidSettings, MissingData
from granufab.reproduce.case_folder import RunCase

__all__ = ["QUEUES", "check_dask", "dask_client", "run_dask"]

QUEUES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "sge": "SGECluster"}
"""Queues of clusters and their classes in dask-jobqueue."""

POLL = 0.2
SECONDS_BETWEEN_NEWS = 1.0
CONNECT = "20s"


def check_dask(where: str) -> None:
    """Refuse at once what cannot work: a missing package, an address without a port.

    Raises:
        MissingData: the extra is not installed.
        InvalidSettings: neither local, a queue, nor an address.
    """
    _need("distributed")
    if where in QUEUES:
        _need("dask_jobqueue")
    elif where != "local" and ":" not in where:
        allowed = ", ".join(("local", *QUEUES))
        raise InvalidSettings(
            f"--dask {where}: allowed {allowed}, or an address such as tcp://host:8786"
        )


def run_dask(
    tasks: Sequence[Task],
    ledger: Ledger,
    *,
    where: str,
    workers: int,
    run_case: RunCase | None = None,
) -> None:
    """Run every task on Dask workers that see the campaign's folder.

    Args:
        tasks: what to run.
        ledger: told what happens; stops the campaign by KeyboardInterrupt.
        where: local, slurm, pbs, sge, or the address of a scheduler.
        workers: processes (local), or jobs of the queue; no matter at an address.
        run_case: what simulates; importable by the workers.
    Raises:
        MissingData: the extra ``sweep`` is not installed.
        InvalidSettings: the scheduler cannot be reached, or the queue refuses.
        KeyboardInterrupt: stopped.
    """
    check_dask(where)
    if not tasks:
        return
    with dask_client(where, workers, tasks[0].threads) as client:
        _Campaign(client, tasks, ledger).follow(run_case)


def _need(package: str) -> Any:
    try:
        return import_module(package)
    except ImportError:
        raise MissingData(
            f"sweeps on Dask need the package {package.replace('_', '-')}; install granufab[sweep]"
        ) from None


@contextmanager
def dask_client(where: str, workers: int, threads: int) -> Iterator[Any]:
    """A client of Dask workers; those that it starts end with the block.

    Args:
        where: local, a queue, or the address of a scheduler.
        workers: processes (local), or jobs of the queue.
        threads: processors of a job.
    Raises:
        MissingData: the extra ``sweep`` is not installed.
        InvalidSettings: the scheduler cannot be reached, or the queue refuses.
    """
    distributed = _need("distributed")
    with ExitStack() as stack:
        try:
            target: Any = where
            if where == "local":
                target = _local_cluster(distributed, workers)
            elif where in QUEUES:
                target = getattr(_need("dask_jobqueue"), QUEUES[where])(cores=threads, processes=1)
                target.scale(jobs=workers)
            if not isinstance(target, str):
                stack.enter_context(target)
            client = distributed.Client(target, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError, RuntimeError, TypeError) as error:
            said = " ".join(str(error).split())
            raise InvalidSettings(
                f"--dask {where}: cannot be reached or started ({said})"
            ) from None
        yield stack.enter_context(client)


def _local_cluster(distributed: Any, workers: int) -> Any:
    """Processes of one thread each, seen by this machine only, without a limit of their own."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        memory_limit=0,
        silence_logs=50,
    )


class _Campaign:
    """Futures of a campaign, and the news that workers send."""

    def __init__(self, client: Any, tasks: Sequence[Task], ledger: Ledger) -> None:
        self.client, self.ledger = client, ledger
        self.tasks = {task.id: task for task in tasks}
        self.topic = f"granufab-{uuid4().hex}"
        self.news: SimpleQueue[tuple[str, str, float]] = SimpleQueue()
        self.stop = _need("distributed").Event(self.topic, client=client)
        self.futures: dict[Any, str] = {}

    def follow(self, run_case: RunCase | None) -> None:
        """Submit every task and wait for all."""
        self.client.subscribe_topic(self.topic, lambda event: self.news.put(event[1]))
        try:
            for task in self.tasks.values():
                self._submit(task, run_case)
            while self.futures:
                self._settle(run_case)
                self.ledger.tick()
        except BaseException:
            self._wind_up()
            raise
        finally:
            with suppress(Exception):
                self.client.unsubscribe_topic(self.topic)

    def _submit(self, task: Task, run_case: RunCase | None) -> None:
        future = self.client.submit(
            _on_worker,
            task,
            self.topic,
            run_case,
            key=f"{task.id}-{uuid4().hex[:6]}",
            pure=False,
        )
        self.futures[future] = task.id

    def _settle(self, run_case: RunCase | None) -> None:
        """Wait a moment; note what ended, and send back what was stopped on its way."""
        for future in self._finished(POLL):
            name = self.futures.pop(future)
            outcome = self._outcome(future)
            if outcome is not None:
                self.ledger.ended(name, outcome)
            if outcome is None or outcome.state == "interrupted":
                again = self.ledger.worker_died(name, MOST_DEATHS)
                if again:
                    self._submit(self.tasks[name], run_case)

    def _finished(self, seconds: float) -> list[Any]:
        """Futures that have ended, after a moment where there are none."""
        self._hear()
        ended = [future for future in self.futures if future.done()]
        if ended:
            return ended
        if self.client.status not in ("running", "connecting", "newly-created"):
            raise GranufabError(
                "the connection to the Dask scheduler is lost; the same command continues"
            )
        time.sleep(seconds)
        return []

    def _hear(self) -> None:
        with suppress(Empty):
            while True:
                name, text, share = self.news.get_nowait()
                row = self.ledger.rows.get(name)
                if row is not None and row.state == "waiting" and name in self.futures.values():
                    self.ledger.started(name)
                self.ledger.told(name, text, share)

    def _outcome(self, future: Any) -> Outcome | None:
        """What a worker said; None where it died too often, or its task was lost."""
        distributed = _need("distributed")
        if future.status == "finished":
            return future.result()
        error = future.exception() if future.status == "error" else None
        if error is None or isinstance(error, distributed.KilledWorker):
            return None
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(state="failed", reason=said)

    def _wind_up(self) -> None:
        """Ask the workers to end their step; take back what has not begun."""
        shown, self.ledger.shown = self.ledger.shown, None
        try:
            self.stop.set()
            running = {r.id for r in self.ledger.in_state("running")}
            idle = [future for future, name in self.futures.items() if name not in running]
            self.client.cancel(idle)
            busy = [future for future, name in self.futures.items() if name in running]
            deadline = time.monotonic() + PATIENCE
            while time.monotonic() < deadline and not all(future.done() for future in busy):
                time.sleep(POLL)
            for future in busy:
                if future.status == "finished":
                    self.ledger.ended(self.futures[future], future.result())
        finally:
            self.ledger.shown = shown


def _on_worker(task: Task, topic: str, run_case: RunCase | None) -> Outcome:
    """Run a task on a Dask worker: tell news by its log of events, stop at the common event."""
    distributed = _need("distributed")
    worker = distributed.get_worker()
    stop = distributed.Event(topic, client=distributed.get_client())

    def tell(text: str, share: float) -> None:
        worker.log_event(topic, (task.id, text, share))
        if stop.is_set():
            raise KeyboardInterrupt

    try:
        tell(f"on process {os.getpid()}", 0.0)
    except KeyboardInterrupt:
        return Outcome(state="interrupted")
    return do_task(task, tell_now_and_then(tell, SECONDS_BETWEEN_NEWS), run_case)
