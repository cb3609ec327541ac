"""Threads that run one kernel together (:mod:`granufab.kernels.team`)."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings
from granufab.kernels.team import COUNTERS, GIVE_UP
from granufab.packing import IntArray

__all__ = ["Team", "core_count", "thread_count"]


def thread_count() -> int:
    """Threads of a run: GRANUFAB_THREADS, else the processors this process may use.

    Teams wait actively, so the default is 1 where a waiting thread cannot give its processor
    away (not POSIX) and at most what a container is allowed.

    Raises:
        InvalidSettings: GRANUFAB_THREADS is not a positive integer.
    """
    given = os.environ.get("GRANUFAB_THREADS")
    if not given:
        return core_count() if os.name == "posix" else 1
    if not given.isdecimal() or int(given) < 1:
        raise InvalidSettings(f"GRANUFAB_THREADS is {given!r}, must be an integer ≥ 1")
    return int(given)


def core_count() -> int:
    """Processors that this process may use: of the machine, its affinity, its container."""
    usable = getattr(os, "sched_getaffinity", None)
    count = len(usable(0)) if usable else os.cpu_count() or 1
    return max(1, min(count, _quota()))


def _quota() -> int:
    """Processors that the control group of this process may use, rounded up."""
    try:
        allowed, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()
        return -(-int(allowed) // int(period))
    except (OSError, ValueError):  # no such file, or no limit ("max")
        return sys.maxsize


class Team:
    """Members that run a kernel side by side; the calling thread is one of them.

    Attributes:
        counters: of their barrier; another array after one of them failed.

    Args:
        most: members at most.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.counters: IntArray = np.zeros(COUNTERS, np.int64)
        self._pool: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the threads, which are made again when needed."""
        return {**self.__dict__, "_pool": None, "counters": np.zeros(COUNTERS, np.int64)}

    def ready(self) -> IntArray:
        """The counters of the next run; a fork gets its own, and threads of its own."""
        self._forget_fork()
        return self.counters

    def _forget_fork(self) -> None:
        if self._process != os.getpid():
            self._process, self._pool = os.getpid(), None
            self.counters = np.zeros(COUNTERS, np.int64)

    def run(self, kernel: Callable[..., Any], arguments: tuple[Any, ...], members: int) -> Any:
        """Call ``kernel(*arguments, member, members)`` for every member; the first one's result.

        If one fails the others end, and the next run starts afresh.

        Args:
            kernel: gives up the interpreter lock.
            arguments: hold ``counters``, as :meth:`ready` returned them.
            members: how many.
        """
        if members == 1:
            return kernel(*arguments, 0, 1)
        others: list[Future[Any]] = []
        try:
            others += [self._submit(kernel, *arguments, k, members) for k in range(1, members)]
            found = kernel(*arguments, 0, members)
            for other in others:
                other.result()
        except BaseException:
            self.counters[GIVE_UP] = 1
            wait(others)
            self.counters = np.zeros(COUNTERS, np.int64)
            raise
        return found

    def _submit(self, kernel: Callable[..., Any], *arguments: Any) -> Future[Any]:
        self._forget_fork()
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.most - 1, thread_name_prefix="granufab")
        return self._pool.submit(kernel, *arguments)
