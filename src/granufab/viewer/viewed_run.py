"""A run that is looked at: reopened when its files grow, its frames read one at a time."""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import RLock
from typing import Any

from granufab.errors import GranufabError, IncompleteFile, InvalidSettings
from granufab.fabric.frame_series import with_series
from granufab.history import Frame, Run
from granufab.io.run_reader import RunFileFrames
from granufab.viewer.choice import Choice

__all__ = ["FramePlace", "ViewedRun"]

_FRAMES_KEPT = 4


@dataclass(frozen=True, slots=True)
class FramePlace:
    """Where a frame lies on the path: its number in the data, strains and stage."""

    number: int
    eps_q: float
    eps_q_total: float
    stage: int


class ViewedRun:
    """A run, and what was read of it. All methods can be called from several threads.

    Args:
        name: that the page shows and messages use.
        files: whose change means that there is something new.
        open_again: opens the files as they are now.
        run: as it was opened first; default opened now.
    """

    def __init__(
        self,
        name: str,
        files: Sequence[Path],
        open_again: Callable[[], Run],
        run: Run | None = None,
    ) -> None:
        self.name, self.files = name, tuple(files)
        self._open, self._lock = open_again, RLock()
        self._stamp = self._stamped()
        self._run = open_again() if run is None else run
        self._complete: Run | None = None
        self._kept: OrderedDict[int, Frame] = OrderedDict()
        self._places: list[FramePlace] = []
        self.revision = 0
        self.generation = 0
        self.problem: str | None = None

    def refresh(self) -> int:
        """Reopen the files where they have changed; returns the revision.

        What cannot be read just now leaves the run as it was, and ``problem`` says why.
        """
        with self._lock:
            stamp = self._stamped()
            if stamp == self._stamp:
                return self.revision
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", IncompleteFile)
                    run = self._open()
                    grown = self._continues(run)
            except (GranufabError, OSError) as error:
                self.problem = " ".join(str(error).split())
                return self.revision
            self._stamp, self._run, self._complete, self.problem = stamp, run, None, None
            self.revision += 1
            if not grown:
                self.generation += 1
                self._kept.clear()
                self._places.clear()
            return self.revision

    @property
    def run(self) -> Run:
        """The run as it was opened last."""
        with self._lock:
            return self._run

    @property
    def finished(self) -> bool:
        """Whether the run says of itself that it has ended; foreign data never do."""
        return bool(self.run.summary)

    def complete(self) -> Run:
        """The run with a series: its own, or that of its frames, each measured once."""
        with self._lock:
            if self._complete is None:
                self._complete = with_series(self._run) if len(self._run.frames) else self._run
            return self._complete

    def frame(self, place: int) -> Frame:
        """A frame by its place, 0 the first.

        Raises:
            InvalidSettings: there is no such frame.
        """
        with self._lock:
            if place in self._kept:
                self._kept.move_to_end(place)
                return self._kept[place]
            count = len(self._run.frames)
            if not 0 <= place < count:
                held = f"holds frames 0..{count - 1}" if count else "holds no frames yet"
                raise InvalidSettings(f"frame {place}: {self.name} {held}")
            found = self._kept[place] = self._run.frames[place]
            while len(self._kept) > _FRAMES_KEPT:
                self._kept.popitem(last=False)
            return found

    def places(self) -> list[FramePlace]:
        """Where every frame lies on the path; each is read once for it."""
        with self._lock:
            frames: Any = self._run.frames
            numbers = getattr(frames, "numbers", None)
            for place in range(len(self._places), len(frames)):
                frame = frames[place]
                number = place if numbers is None else numbers[place]
                self._places.append(FramePlace(number, frame.eps_q, frame.eps_q_total, frame.stage))
            return list(self._places)

    def choice(self, criterion: str | None, z_definition: str | None) -> Choice:
        """Criterion and definition of z, by default those of ``granufab measure``.

        Raises:
            InvalidSettings: an unknown criterion or definition.
            MissingData: the run has no frames.
        """
        with self._lock:
            return Choice.of(self._run, criterion, z_definition)

    def _continues(self, run: Run) -> bool:
        """Whether the run is the former one with more frames: its kept states still stand."""
        before, now = self._run.frames, run.frames
        if not isinstance(before, RunFileFrames) or not isinstance(now, RunFileFrames):
            return False
        return now.created == before.created and len(now) >= len(before)

    def _stamped(self) -> tuple[Any, ...]:
        """Size and time of change of every file; of a folder, of what lies in it."""
        found: list[Any] = []
        for path in self.files:
            inside = sorted(path.iterdir()) if path.is_dir() else [path]
            for file in inside:
                try:
                    status = file.stat()
                except OSError:
                    found.append((str(file), None))
                else:
                    found.append((str(file), status.st_size, status.st_mtime_ns))
        return tuple(found)
