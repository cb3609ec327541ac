"""Damage a file many times: a reader gives the right frames or one error, never anything else.

An attempt may take 10 s and 4 times the bytes of the files that are read, or twice what the
undamaged ones take. Memory is what Python and numpy allocate; what HDF5 allocates in C cannot be
traced, only the resident set of the process is watched for it.
"""

from __future__ import annotations

import faulthandler
import random
import re
import signal
import sys
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from granufab.errors import (
    CorruptFile,
    GranufabError,
    InvalidSettings,
    MissingData,
    UnknownFormat,
)
from granufab.history import Run

__all__ = [
    "Attempts",
    "State",
    "check_error",
    "check_mutations",
    "check_truncations",
    "same_states",
    "states",
]

State = list[np.ndarray]

LONGEST = 10.0
"""Seconds of an attempt."""
SMALL = 64 * 1024
"""Bytes that any attempt may take: a message, an index of a few frames."""
TRACED_EVERY = 10
"""Tracing allocations takes most of the time, so only one attempt of so many is traced."""
RESIDENT = 64 * 2**20
"""Bytes by which all attempts together may raise the resident set of the process."""

PLACE = re.compile(
    r"\b(line|byte|row|frame|step|body|grain|contact|interaction|item) \d"
    r"|\bt = [-\d]|\b\d+ bytes\b|\bheader\b"
    r"|\b[A-Z]\w*/\w+|\b(column|array|dataset|value of) \w+"
)
"""Where in the file: a number of something, a dataset of HDF5, a named column or array."""
REMEDY = re.compile(
    r"\b(give|install|unpack|save|dump|write) |--\w|\bread(_\w+)? |known:|columns: "
    r"|\bno frame of this data has grains"
)
"""What to do, for what is missing or of no known format."""


class TooLongError(BaseException):
    """Not an Exception, so that no reader catches it."""


def states(run: Run) -> tuple[list[State], GranufabError | None]:
    """Arrays of the frames up to the first that cannot be read, and why it cannot."""
    seen: list[State] = []
    for index in range(len(run.frames)):
        try:
            packing = run.frames[index].packing
        except GranufabError as error:
            return seen, error
        arrays = [packing.grains.position, packing.grains.radius]
        if packing.contacts is not None:
            arrays += [packing.contacts.pair, packing.contacts.normal]
            arrays += [] if packing.contacts.force is None else [packing.contacts.force]
        seen.append(arrays)
    return seen, None


@contextmanager
def _limited(what: str) -> Iterator[None]:
    """Fail after 10 s; where not even that comes through (in C), say where and end the tests."""

    def stop(*_: object) -> None:
        raise TooLongError(f"{what}: longer than {LONGEST:g} s")

    faulthandler.dump_traceback_later(3 * LONGEST, exit=True, file=sys.__stderr__ or sys.stderr)
    timer = hasattr(signal, "setitimer")
    before = signal.signal(signal.SIGALRM, stop) if timer else None
    started = time.perf_counter()
    try:
        if timer:
            signal.setitimer(signal.ITIMER_REAL, LONGEST)
        yield
    finally:
        if timer:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        faulthandler.cancel_dump_traceback_later()
    took = time.perf_counter() - started
    assert took <= LONGEST, f"{what}: {took:.1f} s"


def _resident() -> int:
    """Largest resident set of the process so far [bytes], 0 where the system does not tell."""
    with suppress(ImportError):
        import resource

        unit = 1 if sys.platform == "darwin" else 1024
        return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return 0


def check_error(error: GranufabError, names: Sequence[str], what: str) -> None:
    """One line that names a file and, if that is damaged, the place, else what to do."""
    text = str(error)
    named = [name for name in names if name in text]
    assert "\n" not in text and named, f"{what}: {text!r}"
    told = text
    for name in sorted(named, key=len, reverse=True):
        told = re.sub(rf"(\S*/)?{re.escape(name)}", "", told)
    missing = isinstance(error, MissingData | UnknownFormat | InvalidSettings)
    pattern = REMEDY if missing else PLACE
    assert missing or isinstance(error, CorruptFile), f"{what}: {error!r}"
    assert pattern.search(told), f"{what}: no place in {text!r}"


class Attempts:
    """Read files of one folder again and again, within time and memory.

    Args:
        folder: of the files.
        read: opens them.
    """

    def __init__(self, folder: Path, read: Callable[[], Run]) -> None:
        self.folder, self.read, self.count = folder, read, 0
        self.error: GranufabError | None = None
        self.wanted, error = states(read())
        assert error is None and self.wanted
        tracemalloc.start()
        try:
            states(read())
            self.usual = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        self._resident = _resident()

    def limit(self) -> int:
        """Bytes that an attempt may take."""
        size = sum(one.stat().st_size for one in self.folder.rglob("*") if one.is_file())
        return max(4 * size, 2 * self.usual) + SMALL

    def attempt(self, what: str, *, traced: bool | None = None) -> list[State]:
        """Frames that could be read; what could not must be told by one good error.

        Args:
            what: was done to the files.
            traced: whether memory is checked; default every tenth time.
        """
        self.count += 1
        trace = self.count % TRACED_EVERY == 1 if traced is None else traced
        if trace:
            tracemalloc.start()
        try:
            with _limited(what), warnings.catch_warnings():
                warnings.simplefilter("error")  # they would be further lines
                try:
                    seen, error = states(self.read())
                except GranufabError as raised:
                    seen, error = [], raised
            peak = tracemalloc.get_traced_memory()[1] if trace else 0
        finally:
            tracemalloc.stop()
        assert peak <= self.limit(), f"{what}: {peak} bytes, allowed {self.limit()}"
        self.error = error
        if error is not None:
            names = [one.name for one in (self.folder, *self.folder.rglob("*"))]
            check_error(error, names, what)
        return seen

    def check_resident(self) -> None:
        """What all attempts took outside of Python."""
        grown = _resident() - self._resident
        assert grown <= RESIDENT, f"{self.folder}: the process has grown by {grown} bytes"


def same_states(got: Sequence[State], right: Sequence[State]) -> bool:
    """Whether all frames hold the same numbers, to the last bit."""
    return len(got) == len(right) and all(map(_same, got, right))


def _same(got: State, right: State) -> bool:
    return len(got) == len(right) and all(map(np.array_equal, got, right))


def _fewer(got: State, right: State) -> bool:
    """Whether every row of a state is one of another."""
    rows = [{row.tobytes() for row in one} for one in right]
    return len(got) == len(right) and all(
        row.tobytes() in known for one, known in zip(got, rows, strict=True) for row in one
    )


def check_truncations(
    path: Path,
    read: Callable[[], Run],
    *,
    count: int = 200,
    seed: int = 0,
    counted: bool = True,
) -> int:
    """Cut a file at random places: the frames read must be the first ones of the whole file.

    Args:
        path: the file, restored afterwards.
        read: opens it, with the files that complete it, from the same folder.
        count: of cuts.
        seed: of the places.
        counted: whether the file tells how many rows it has; where it does not, a cut between
            two lines cannot be seen, and the last frame may lack rows.
    Returns:
        How often some frames, but not all, were read.
    """
    whole, attempts, partial = path.read_bytes(), Attempts(path.parent, read), 0
    wanted = attempts.wanted
    try:
        for cut in random.Random(seed).choices(range(len(whole)), k=count):
            path.write_bytes(whole[:cut])
            what = f"{path.name} cut at byte {cut} of {len(whole)}"
            seen = attempts.attempt(what)
            assert len(seen) <= len(wanted)
            between = not counted and whole[cut - 1 : cut] == b"\n"
            for k, (got, right) in enumerate(zip(seen, wanted, strict=False)):
                fewer = between and k == len(seen) - 1 and _fewer(got, right)
                assert fewer or _same(got, right), f"{what}: other data"
            partial += 0 < len(seen) < len(wanted)
    finally:
        path.write_bytes(whole)
    attempts.check_resident()
    return partial


def check_mutations(path: Path, read: Callable[[], Run], *, count: int = 200, seed: int = 1) -> int:
    """Change single bytes of a file: it is read, or refused with one line.

    Args:
        path: the file, restored afterwards.
        read: opens it, with the files that complete it, from the same folder.
        count: of changes.
        seed: of places and values.
    Returns:
        How often nothing could be read.
    """
    whole, attempts, refused = path.read_bytes(), Attempts(path.parent, read), 0
    chance = random.Random(seed)
    try:
        for _ in range(count):
            place, value = chance.randrange(len(whole)), chance.randrange(256)
            path.write_bytes(whole[:place] + bytes([value]) + whole[place + 1 :])
            refused += not attempts.attempt(f"{path.name} byte {place} set to {value}")
    finally:
        path.write_bytes(whole)
    attempts.check_resident()
    return refused
