"""Worker processes on this machine; one that dies costs its case one more try.

A process pool of the standard library ends with its first dead worker, and takes the others'
unfinished work along; here each worker is a process with a pipe of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from granufab.campaign.case_work import Outcome, Task, do_task, tell_now_and_then
from granufab.campaign.ledger import Ledger
from granufab.reproduce.case_folder import RunCase

__all__ = ["MOST_DEATHS", "run_local"]

MOST_DEATHS = 3
"""A case with which so many workers died has failed."""

PATIENCE = 60.0  # seconds in which a worker ends its step and writes its checkpoint
POLL = 0.2


@dataclass(slots=True)
class _Worker:
    process: Any
    pipe: Connection
    task: Task | None = None


def run_local(
    tasks: Sequence[Task], ledger: Ledger, *, workers: int, run_case: RunCase | None = None
) -> None:
    """Run every task in worker processes, in the order given.

    Args:
        tasks: what to run.
        ledger: told what happens; stops the campaign by KeyboardInterrupt.
        workers: processes at a time.
        run_case: what simulates; importable by the workers.
    Raises:
        KeyboardInterrupt: stopped; every worker has ended, each case with its checkpoint.
    """
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    waiting = deque(tasks)
    crew: list[_Worker] = []
    try:
        while waiting or any(worker.task for worker in crew):
            while len(crew) < min(workers, len(waiting) + sum(1 for w in crew if w.task)):
                crew.append(_hire(context, stop, run_case))
            for worker in crew:
                if worker.task is None and waiting:
                    _give(worker, waiting.popleft(), ledger)
            ready = set(wait([worker.pipe for worker in crew], timeout=POLL))
            for worker in [w for w in crew if w.pipe in ready]:
                if not _listen(worker, ledger, waiting):
                    crew.remove(worker)
            ledger.tick()
    except BaseException:
        stop.set()
        _wind_up(crew, ledger)
        raise
    finally:
        _dismiss(crew)


def _hire(context: Any, stop: Any, run_case: RunCase | None) -> _Worker:
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, stop, run_case), daemon=True)
    process.start()
    there.close()
    return _Worker(process, here)


def _give(worker: _Worker, task: Task, ledger: Ledger) -> None:
    worker.task = task
    try:
        worker.pipe.send(task)
    except OSError:  # it died while idle; _listen finds the closed pipe
        return
    ledger.started(task.id)


def _listen(worker: _Worker, ledger: Ledger, waiting: deque[Task]) -> bool:
    """Hear what a worker says; False where it is dead."""
    try:
        while worker.pipe.poll():
            _hear(worker, worker.pipe.recv(), ledger, waiting)
    except (EOFError, OSError):
        worker.process.join(PATIENCE)
        if worker.task is not None and ledger.worker_died(worker.task.id, MOST_DEATHS):
            waiting.append(worker.task)
        worker.pipe.close()
        return False
    return True


def _hear(worker: _Worker, message: Any, ledger: Ledger, waiting: deque[Task]) -> None:
    task = worker.task
    if task is None:
        return
    if not isinstance(message, Outcome):
        ledger.told(task.id, *message)
        return
    worker.task = None
    ledger.ended(task.id, message)
    if message.state == "interrupted" and ledger.worker_died(task.id, MOST_DEATHS):
        waiting.append(task)  # that worker alone was asked to end


def _wind_up(crew: Sequence[_Worker], ledger: Ledger) -> None:
    """Let the workers end their step and write their checkpoints; note what they say."""
    shown, ledger.shown = ledger.shown, None
    deadline = time.monotonic() + PATIENCE
    try:
        while any(w.task for w in crew) and time.monotonic() < deadline:
            busy = [worker for worker in crew if worker.task is not None]
            ready = set(wait([worker.pipe for worker in busy], timeout=POLL))
            for worker in [w for w in busy if w.pipe in ready]:
                _last_words(worker, ledger)
    finally:
        ledger.shown = shown


def _last_words(worker: _Worker, ledger: Ledger) -> None:
    task = worker.task
    try:
        message = worker.pipe.recv()
    except (EOFError, OSError):
        worker.task = None
        return
    if task is not None and isinstance(message, Outcome):
        worker.task = None
        ledger.ended(task.id, message)


def _dismiss(crew: Sequence[_Worker]) -> None:
    """End the workers; the pipes' end is their sign."""
    for worker in crew:
        if worker.task is not None:
            worker.process.terminate()
        worker.pipe.close()
    for worker in crew:
        worker.process.join(5.0)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


class _Asked:
    to_end = False


def _serve(pipe: Connection, stop: Any, run_case: RunCase | None) -> None:
    """The life of a worker: take a task, run it, say how it ended."""
    # The parent decides when to stop: Ctrl-C reaches the whole group of processes.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _ask_to_end)
    os.environ.setdefault("GRANUFAB_THREADS", "1")

    def tell(text: str, share: float) -> None:
        if _Asked.to_end or stop.is_set():
            raise KeyboardInterrupt
        try:
            pipe.send((text, share))
        except OSError:  # the parent is gone
            raise KeyboardInterrupt from None

    try:
        while not _Asked.to_end:
            task = pipe.recv()
            tell("starting", 0.0)
            pipe.send(do_task(task, tell_now_and_then(tell, POLL), run_case))
    except (EOFError, OSError, KeyboardInterrupt):
        return


def _ask_to_end(number: int, frame: object) -> None:
    if _Asked.to_end:
        raise KeyboardInterrupt
    _Asked.to_end = True
