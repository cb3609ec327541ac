"""Frames of a run in several processes, on this machine or on Dask; results in order, same bits.

A worker opens the run file itself and reads the frames that it is given; only results travel. No
more frames are under way than a few for each worker, so a run file may be larger than memory.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from granufab.campaign.dask_pool import check_dask, dask_client
from granufab.errors import GranufabError, InvalidSettings
from granufab.fabric.frame_map import FrameMap, do_frame, one_by_one
from granufab.history import Frame, FrameSource

__all__ = ["frame_workers"]

T = TypeVar("T")
Frames = FrameSource | Sequence[Frame]
Submit = Callable[..., Any]

AHEAD = 2
"""Frames under way for each worker."""
LARGEST = 1_000_000
"""Bytes of a source of frames that is sent along with every task."""
DASK_AHEAD = 64
"""Frames under way on workers whose number is not known."""


@contextmanager
def frame_workers(workers: int = 1, dask: str | None = None) -> Iterator[FrameMap]:
    """A map over frames for ``each`` of :func:`~granufab.fabric.measure_run` and ``balance_run``.

    Args:
        workers: processes; 1 works in this one.
        dask: ``local`` for ``workers`` Dask processes on this machine, or the address of a
            scheduler, whose workers must see the run file under the same path.
    Raises:
        InvalidSettings: ``workers`` is below 1, or the scheduler cannot be reached.
        MissingData: the extra ``sweep`` is not installed.
    """
    if workers < 1:
        raise InvalidSettings(f"--workers {workers}: must be at least 1")
    if dask is not None:
        check_dask(dask)
        with dask_client(dask, workers, 1) as client:
            ahead = AHEAD * workers if dask == "local" else DASK_AHEAD
            yield _map_of(lambda *task: client.submit(*task, pure=False), ahead)
    elif workers == 1:
        yield one_by_one
    else:
        pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
        try:
            yield _map_of(_submit_to(pool), AHEAD * workers)
        finally:
            pool.shutdown(cancel_futures=True)


def _submit_to(pool: Executor) -> Submit:
    return pool.submit


def _map_of(submit: Submit, ahead: int) -> FrameMap:
    def each(function: Callable[[Frame], T], frames: Frames, /) -> Iterator[T]:
        task = _task(function, frames)
        waiting: deque[Any] = deque()
        try:
            for index in range(len(frames)):
                waiting.append(submit(do_frame, task, index))
                if len(waiting) >= ahead:
                    yield _result(waiting.popleft())
            while waiting:
                yield _result(waiting.popleft())
        finally:
            for future in waiting:
                future.cancel()

    return each


def _task(function: Callable[[Frame], Any], frames: Frames) -> bytes:
    """The function and the source of the frames, as they are sent.

    Raises:
        InvalidSettings: the frames do not lie in a file that a worker can open.
    """
    try:
        task = pickle.dumps((function, frames))
    except (TypeError, AttributeError, pickle.PicklingError):
        task = b""
    if not 0 < len(task) <= LARGEST:
        raise InvalidSettings(
            "several workers need a run file, which each of them opens; these frames lie in memory "
            "or in another program's files: granufab import makes a run file of them"
        )
    return task


def _result(future: Any) -> Any:
    try:
        return future.result()
    except BrokenProcessPool:
        raise GranufabError(
            f"a worker process ended unexpectedly, perhaps for lack of memory (this one is "
            f"{os.getpid()}); take fewer --workers"
        ) from None
