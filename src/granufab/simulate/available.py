"""What memory this process may still use, and why no more."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

__all__ = ["Room", "memory_available"]

PROC, CGROUP = Path("/proc"), Path("/sys/fs/cgroup")
_KIB = 1024
_LIMITS = (("RLIMIT_AS", "VmSize", "ulimit -v"), ("RLIMIT_DATA", "VmData", "ulimit -d"))


class Room(NamedTuple):
    """Memory or disk that can still be used.

    Attributes:
        size: [bytes].
        source: what sets it, in words.
    """

    size: int
    source: str


def memory_available() -> Room | None:
    """The least of what the machine has free and what limits leave this process.

    Free memory of the machine (``MemAvailable``, swap left out), of every control group that the
    process is in (containers, jobs of a cluster), and under its resource limits.

    Returns:
        None where the system does not tell.
    """
    rooms = [*_of_machine(), *_of_control_groups(), *_of_limits()]
    return min(rooms, default=None)


def _of_machine() -> Iterator[Room]:
    size = _entries(PROC / "meminfo").get("MemAvailable")
    if size is not None:
        yield Room(size, "free memory of this machine")
        return
    try:  # where there is no /proc: all there is
        size = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return
    yield Room(size, "memory of this machine")


def _of_control_groups() -> Iterator[Room]:
    """Of the group of the process and all above it; version 2, and version 1's memory groups."""
    for line in _text(PROC / "self" / "cgroup").splitlines():
        _, controllers, path = (*line.split(":", 2), "", "")[:3]
        if controllers and "memory" not in controllers.split(","):
            continue
        names = ("memory.limit_in_bytes", "memory.usage_in_bytes")
        root = CGROUP / "memory" if controllers else CGROUP
        if not controllers:
            names = ("memory.max", "memory.current")
        inner = Path(path.lstrip("/"))
        for folder in (root / inner, *(root / part for part in inner.parents)):
            limit, used = (_number(folder / name) for name in names)
            if limit is None or used is None:
                continue
            cached = _entries(folder / "memory.stat", unit=1).get("inactive_file", 0)
            yield Room(max(0, limit - used + cached), "limit of this job or container")


def _of_limits() -> Iterator[Room]:
    try:
        import resource
    except ImportError:  # not POSIX
        return
    used = _entries(PROC / "self" / "status")
    for name, entry, words in _LIMITS:
        limit = resource.getrlimit(getattr(resource, name))[0]
        if limit != resource.RLIM_INFINITY:
            yield Room(max(0, limit - used.get(entry, 0)), f"limit of this process ({words})")


def _entries(path: Path, unit: int = _KIB) -> dict[str, int]:
    """Numbers of a file of lines ``name: number``, in bytes."""
    words = (line.replace(":", " ").split() for line in _text(path).splitlines())
    return {w[0]: int(w[1]) * unit for w in words if len(w) > 1 and w[1].isdecimal()}


def _number(path: Path) -> int | None:
    text = _text(path).strip()
    return int(text) if text.isdecimal() else None  # "max": no limit


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
