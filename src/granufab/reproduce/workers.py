"""Several cases at once, each in a process of its own, with progress and a clean end."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from granufab.errors import GranufabError, NotConverged
from granufab.history import Run
from granufab.reproduce.case_folder import Progress, RunCase, run_into_folder
from granufab.simulate.settings import Case, Sample
from granufab.simulate.team import thread_count

__all__ = ["Job", "nearest_sample", "run_jobs"]

PATIENCE = 10.0  # seconds that a worker is given to stop by itself
Prepare = Callable[..., Any]
LARGEST_FRICTION = 5.0  # of a compaction; z_0 hardly falls beyond it


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A case and the folder it is run into.

    Attributes:
        case: what is run.
        folder: where its files go.
        shared: its starting sample is made once for all jobs of the same sample settings.
    """

    case: Case
    folder: Path
    shared: bool = False


def run_jobs(
    jobs: Sequence[Job],
    *,
    workers: int | None = None,
    progress: Progress | None = None,
    run_case: RunCase | None = None,
    prepare: Prepare | None = None,
) -> None:
    """Run every job, the longest first; each leaves its files in its folder.

    Args:
        jobs: what to run.
        workers: processes at a time; by default one per core, at most one per job. With one,
            the jobs run in this process, one after another.
        progress: called with a line about the running paths and the mean fraction.
        run_case: what simulates a case; it must be importable by the workers.
        prepare: what makes a shared sample, ``prepare(sample, *, progress)``;
            :func:`granufab.prepare` by default.
    Raises:
        GranufabError: a job failed; the message names its path, and the others were stopped.
        KeyboardInterrupt: interrupted; every worker has ended.
    """
    if workers is None:
        workers = min(os.cpu_count() or 1, len(jobs))
    samples = list(dict.fromkeys(job.case.sample for job in jobs if job.shared))
    names = [f"sample {number + 1}" for number in range(len(samples))]
    board = _Board([*names, *(job.case.name for job in jobs)], progress)
    tasks = _Tasks(samples=samples, jobs=sorted(jobs, key=_cost, reverse=True), board=board)
    if workers <= 1:
        _run_serial(tasks, run_case, prepare)
        return
    _run_parallel(tasks, workers, run_case, prepare)


def _cost(job: Job) -> float:
    """Rough relative time of a job: grains, steps, and contacts of a grain."""
    steps = sum(abs(s.strain) / (s.inertial_number or s.rate or 1.0) for s in job.case.path)
    return job.case.sample.grain_count * steps * (4 if job.case.sample.dimension == 3 else 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tasks:
    """Samples and jobs, and the board that shows them in this order."""

    samples: list[Sample]
    jobs: list[Job]
    board: _Board

    def place(self, job: Job) -> int:
        """Where a job stands on the board."""
        return self.board.names.index(job.case.name, len(self.samples))

    def ready(self, sample: Sample | None) -> list[Job]:
        """Jobs that can run once a sample is there; None: those that wait for none."""
        return [job for job in self.jobs if (job.case.sample if job.shared else None) == sample]


def _run_serial(tasks: _Tasks, run_case: RunCase | None, prepare: Prepare | None) -> None:
    made: dict[Sample, Any] = {}
    for index, sample in enumerate(tasks.samples):
        made[sample] = _make_sample(sample, partial(tasks.board.post, index), prepare)
        tasks.board.done(index)
    for job in tasks.jobs:
        index = tasks.place(job)
        start = made[job.case.sample] if job.shared else None
        _run_one(job, start, partial(tasks.board.post, index), run_case)
        tasks.board.done(index)


class _Board:
    """What each path is doing, as one line and one fraction."""

    def __init__(self, names: Sequence[str], progress: Progress | None) -> None:
        self.names = list(names)
        self.text = ["waiting"] * len(self.names)
        self.share = [0.0] * len(self.names)
        self.finished = [False] * len(self.names)
        self.progress = progress

    def done(self, index: int) -> None:
        """Count it as finished; news of it that arrives late is dropped."""
        self.post(index, "done", 1.0)
        self.finished[index] = True

    def post(self, index: int, text: str, share: float) -> None:
        if self.finished[index]:
            return
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


def _make_sample(sample: Sample, progress: Progress, prepare: Prepare | None) -> Any:
    """The sample, or where its z_0 is out of reach the nearest one that is not."""
    if prepare is None:
        from granufab.simulate import prepare as prepare_sample

        prepare = prepare_sample
    try:
        return prepare(sample, progress=progress)
    except NotConverged as error:
        nearest = nearest_sample(sample, error)
        if nearest is None:
            raise
    return prepare(nearest, progress=progress)


def _run_one(job: Job, start: Any, progress: Progress | None, run_case: RunCase | None) -> None:
    name = job.case.name
    try:
        run = _run_or_nearest(job, start, progress, run_case)
    except GranufabError as error:
        raise type(error)(f"path {name}: {error}") from None
    except Exception as error:
        raise GranufabError(f"path {name}: {type(error).__name__}: {error}") from error
    if run.summary.get("interrupted"):
        raise KeyboardInterrupt


def _run_or_nearest(
    job: Job, start: Any, progress: Progress | None, run_case: RunCase | None
) -> Run:
    """Run the case; where its z_0 is out of reach, start from the nearest sample that is not."""

    def run(case: Case) -> Run:
        return run_into_folder(
            case, job.folder, force=True, start=start, progress=progress, run_case=run_case
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
    tasks: _Tasks, workers: int, run_case: RunCase | None, prepare: Prepare | None
) -> None:
    context = multiprocessing.get_context("spawn")
    messages, sender = context.Pipe(duplex=False)
    stop = context.Event()
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        workers,
        mp_context=context,
        initializer=_start_worker,
        initargs=(sender, context.Lock(), stop, max(1, thread_count() // workers)),
    )
    futures: dict[Future[Any], int] = {}

    def submit(sample: Sample | None, start: Any) -> None:
        for job in tasks.ready(sample):
            place = tasks.place(job)
            futures[pool.submit(_work, job, start, place, run_case)] = place

    try:
        for place, sample in enumerate(tasks.samples):
            futures[pool.submit(_work_sample, sample, place, prepare)] = place
        submit(None, None)
        _follow(futures, messages, tasks, submit)
    except BaseException:
        stop.set()
        _end(pool, list(futures), others)
        raise
    pool.shutdown()


def _follow(
    futures: dict[Future[Any], int],
    messages: Connection,
    tasks: _Tasks,
    submit: Callable[[Sample | None, Any], None],
) -> None:
    """Wait for every task; the jobs of a sample are submitted when it is made."""
    pending = set(futures)
    while pending:
        known = set(futures)
        done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
        _drain(messages, tasks.board)
        for future in done:
            try:
                made = future.result()
            except BrokenProcessPool:
                raise GranufabError(
                    "a worker process ended abruptly: out of memory (use fewer grains), killed, "
                    'or started from a script without if __name__ == "__main__": (add it, or '
                    "give workers=1)"
                ) from None
            place = futures[future]
            tasks.board.done(place)
            if place < len(tasks.samples):
                submit(tasks.samples[place], made)
        pending |= set(futures) - known


def _drain(messages: Connection, board: _Board) -> None:
    while messages.poll():
        board.post(*messages.recv())


def _end(pool: ProcessPoolExecutor, futures: Sequence[Future[None]], others: set[Any]) -> None:
    pool.shutdown(wait=False, cancel_futures=True)
    wait(futures, timeout=PATIENCE)
    for process in set(multiprocessing.active_children()) - others:
        if not all(future.done() for future in futures):
            process.terminate()
        process.join(timeout=PATIENCE)


_channel: dict[str, Any] = {}  # of a worker process: where it reports, and the word to stop


def _start_worker(sender: Connection, turn: Any, stop: Any, threads: int) -> None:
    os.environ["GRANUFAB_THREADS"] = str(threads)  # the processors are shared by the workers
    # The parent decides when to stop: Ctrl-C reaches the whole group of processes.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _channel.update(sender=sender, turn=turn, stop=stop)


class _Stopped(KeyboardInterrupt):
    """The parent asked this worker to stop."""


def _work(job: Job, start: Any, index: int, run_case: RunCase | None) -> None:
    try:
        _run_one(job, start, _reporter(index), run_case)
    except KeyboardInterrupt:
        raise GranufabError(f"path {job.case.name}: stopped") from None


def _work_sample(sample: Sample, index: int, prepare: Prepare | None) -> Any:
    try:
        return _make_sample(sample, _reporter(index), prepare)
    except KeyboardInterrupt:
        raise GranufabError("sample: stopped") from None


def _reporter(index: int) -> Progress:
    """Tells the parent a few times a second, and learns from it when to stop.

    What is told has arrived when this task's result does: it is written at once, not by a thread.
    """
    last = [0.0]

    def tell(text: str, share: float) -> None:
        if _channel["stop"].is_set():
            raise _Stopped
        with _channel["turn"]:
            _channel["sender"].send((index, text, share))

    def report(text: str, share: float) -> None:
        now = time.monotonic()
        if now - last[0] >= 0.2:
            last[0] = now
            tell(text, share)

    tell("starting", 0.0)
    return report
