"""Several cases at once, each in a process of its own, with progress and a clean end."""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import time
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granufab.errors import GranufabError, NotConverged
from granufab.history import Run
from granufab.reproduce.case_folder import Progress, RunCase, run_into_folder
from granufab.simulate.settings import Case, Sample

__all__ = ["Job", "nearest_sample", "run_jobs"]

PATIENCE = 10.0  # seconds that a worker is given to stop by itself
LARGEST_FRICTION = 5.0  # of a compaction; z_0 hardly falls beyond it


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A case, the folder it is run into, and the sample it starts from if that is made already."""

    case: Case
    folder: Path
    start: Any = None


def run_jobs(
    jobs: Sequence[Job],
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    run_case: RunCase | None = None,
) -> None:
    """Run every job; each leaves its files in its folder.

    Args:
        jobs: what to run.
        workers: processes at a time; by default one per core, at most one per job. With one,
            the jobs run in this process, one after another.
        progress: called with a line about the running paths and the mean fraction.
        run_case: what simulates a case; it must be importable by the workers.
    Raises:
        GranufabError: a job failed; the message names its path, and the others were stopped.
        KeyboardInterrupt: interrupted; every worker has ended.
    """
    if workers is None:
        workers = min(os.cpu_count() or 1, len(jobs))
    board = _Board([job.case.name for job in jobs], progress)
    if workers <= 1:
        for index, job in enumerate(jobs):
            _run_one(job, lambda text, share, i=index: board.post(i, text, share), run_case)
            board.post(index, "done", 1.0)
        return
    context = multiprocessing.get_context("spawn")
    _run_parallel(jobs, workers, board, run_case, context)


class _Board:
    """What each path is doing, as one line and one fraction."""

    def __init__(self, names: Sequence[str], progress: Progress | None) -> None:
        self.names = list(names)
        self.text = ["waiting"] * len(self.names)
        self.share = [0.0] * len(self.names)
        self.progress = progress

    def post(self, index: int, text: str, share: float) -> None:
        self.text[index] = text
        self.share[index] = min(max(share, 0.0), 1.0)
        if self.progress is None:
            return
        busy = [
            f"{name}: {text}"
            for name, text, share in zip(self.names, self.text, self.share, strict=True)
            if text != "waiting" and share < 1.0
        ]
        self.progress(" · ".join(busy) or "done", sum(self.share) / len(self.share))


def _run_one(job: Job, progress: Progress | None, run_case: RunCase | None) -> None:
    name = job.case.name
    try:
        run = _run_or_nearest(job, progress, run_case)
    except GranufabError as error:
        raise type(error)(f"path {name}: {error}") from None
    except Exception as error:
        raise GranufabError(f"path {name}: {type(error).__name__}: {error}") from error
    if run.summary.get("interrupted"):
        raise KeyboardInterrupt


def _run_or_nearest(job: Job, progress: Progress | None, run_case: RunCase | None) -> Run:
    """Run the case; where its z_0 is out of reach, start from the nearest sample that is not."""

    def run(case: Case) -> Run:
        return run_into_folder(
            case, job.folder, force=True, start=job.start, progress=progress, run_case=run_case
        )

    try:
        return run(job.case)
    except NotConverged as error:
        nearest = nearest_sample(job.case.sample, error)
        if nearest is None:
            raise
    return run(job.case.model_copy(update={"sample": nearest}))


def nearest_sample(sample: Sample, error: NotConverged) -> Sample | None:
    """The extreme sample on the wanted side, if ``error`` says that z_0 is out of reach.

    Compaction without friction gives the largest z_0, with friction 5 very nearly the smallest.
    """
    if sample.coordination is None or "sample.coordination" not in str(error):
        return None
    loose = sample.coordination < sample.dimension + 1.5
    friction = LARGEST_FRICTION if loose else 0.0
    return sample.model_copy(update={"coordination": None, "friction": friction})


def _run_parallel(
    jobs: Sequence[Job],
    workers: int,
    board: _Board,
    run_case: RunCase | None,
    context: Any,
) -> None:
    messages, stop = context.Queue(), context.Event()
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=_start_worker, initargs=(messages, stop)
    )
    futures: list[Future[None]] = []
    try:
        for index, job in enumerate(jobs):
            futures.append(pool.submit(_work, job, index, run_case))
        _follow(futures, messages, board)
    except BaseException:
        stop.set()
        _end(pool, futures, others)
        raise
    pool.shutdown()


def _follow(futures: Sequence[Future[None]], messages: Any, board: _Board) -> None:
    pending = set(futures)
    while pending:
        done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
        _drain(messages, board)
        for future in done:
            try:
                future.result()
            except BrokenProcessPool:
                raise GranufabError(
                    "a worker process ended abruptly: out of memory (use fewer grains), killed, "
                    'or started from a script without if __name__ == "__main__": (add it, or '
                    "give workers=1)"
                ) from None
            index = futures.index(future)
            board.post(index, "done", 1.0)


def _drain(messages: Any, board: _Board) -> None:
    while True:
        try:
            index, text, share = messages.get_nowait()
        except queue.Empty:
            return
        board.post(index, text, share)


def _end(pool: ProcessPoolExecutor, futures: Sequence[Future[None]], others: set[Any]) -> None:
    pool.shutdown(wait=False, cancel_futures=True)
    wait(futures, timeout=PATIENCE)
    for process in set(multiprocessing.active_children()) - others:
        if not all(future.done() for future in futures):
            process.terminate()
        process.join(timeout=PATIENCE)


_channel: dict[str, Any] = {}  # of a worker process: where it reports, and the word to stop


def _start_worker(messages: Any, stop: Any) -> None:
    # The parent decides when to stop: Ctrl-C reaches the whole group of processes.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    messages.cancel_join_thread()
    _channel.update(messages=messages, stop=stop)


class _Stopped(KeyboardInterrupt):
    """The parent asked this worker to stop."""


def _work(job: Job, index: int, run_case: RunCase | None) -> None:
    last = [0.0]

    def report(text: str, share: float) -> None:
        now = time.monotonic()
        if now - last[0] < 0.2:
            return
        last[0] = now
        if _channel["stop"].is_set():
            raise _Stopped
        _channel["messages"].put((index, text, share))

    report("starting", 0.0)
    try:
        _run_one(job, report, run_case)
    except KeyboardInterrupt:
        raise GranufabError(f"path {job.case.name}: stopped") from None
