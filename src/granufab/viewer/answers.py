"""What the page can ask for, without any web: parameters as text in, bytes out, cached."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from threading import RLock
from typing import Any

from granufab.errors import InvalidSettings
from granufab.viewer.cache import ByteCache
from granufab.viewer.choice import Choice
from granufab.viewer.frame_data import frame_buffer
from granufab.viewer.run_data import fit_data, overview, series_data
from granufab.viewer.state_data import criterion_data, interval_data, state_data
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["Answers"]

Query = Mapping[str, str]
HELD_BYTES = 256 * 2**20
_LIMITS = {"bins": (3, 360), "bootstrap": (0, 1000)}


class Answers:
    """The answers about some runs; docs/viewer.md lists them.

    Args:
        runs: what is looked at, of which there is at least one.
    """

    def __init__(self, runs: Sequence[ViewedRun]) -> None:
        self.runs = tuple(runs)
        self._cache = ByteCache(HELD_BYTES)
        self._busy = [RLock() for _ in runs]

    def listed(self, query: Query) -> bytes:
        """Every run with its revision: what the page asks again and again."""
        runs = [
            {
                "run": index,
                "name": one.name,
                "revision": one.refresh(),
                "generation": one.generation,
                "finished": one.finished,
                "problem": one.problem,
            }
            for index, one in enumerate(self.runs)
        ]
        return _json({"runs": runs})

    def overview(self, run: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.run_data.overview`."""
        return self._of_run("overview", run, (), overview)

    def series(self, run: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.run_data.series_data`."""
        return self._of_run("series", run, (), series_data)

    def fit(self, query: Query) -> bytes:
        """:func:`~granufab.viewer.run_data.fit_data` of all runs, or of those in ``runs=0,2``."""
        chosen = _places(query.get("runs"), len(self.runs))
        for index in chosen:
            self.runs[index].refresh()
        method, definition = query.get("method", "critical"), query.get("z_definition")
        state = tuple((index, self.runs[index].revision) for index in chosen)
        several = [self.runs[index] for index in chosen]
        return self._cache.get(
            ("fit", state, method, definition), lambda: _json(fit_data(several, method, definition))
        )

    def packing(self, run: int, frame: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.frame_data.frame_buffer`."""

        def make(viewed: ViewedRun, choice: Choice) -> bytes:
            before = viewed.frame(frame - 1) if frame > 0 else None
            state = viewed.frame(frame)
            return frame_buffer(state, choice, before=before, header={"run": run, "frame": frame})

        return self._of_frame("packing", run, frame, query, (), make)

    def state(self, run: int, frame: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.state_data.state_data`."""
        bins = _whole(query, "bins", 36)

        def make(viewed: ViewedRun, choice: Choice) -> bytes:
            place = {"run": run, "frame": frame}
            return _json(place | state_data(viewed.run, viewed.frame(frame), choice, bins=bins))

        return self._of_frame("state", run, frame, query, (bins,), make)

    def interval(self, run: int, frame: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.state_data.interval_data`, from the frame before."""
        bins = _whole(query, "bins", 18)

        def make(viewed: ViewedRun, choice: Choice) -> bytes:
            place = {"run": run, "frame": frame}
            after = viewed.frame(frame)
            if frame == 0:
                return _json(place | {"missing": "there is no frame before"})
            return _json(place | interval_data(viewed.frame(frame - 1), after, choice, bins=bins))

        return self._of_frame("interval", run, frame, query, (bins,), make)

    def criterion(self, run: int, frame: int, query: Query) -> bytes:
        """:func:`~granufab.viewer.state_data.criterion_data`."""
        resamples = _whole(query, "bootstrap", 0)

        def make(viewed: ViewedRun, choice: Choice) -> bytes:
            viewed.frame(frame)
            found = criterion_data(viewed.run, frame, choice, bootstrap=resamples)
            return _json({"run": run, "frame": frame} | found)

        return self._of_frame("criterion", run, frame, query, (resamples,), make)

    def _of_run(
        self, name: str, run: int, rest: tuple[Any, ...], make: Callable[[ViewedRun], Any]
    ) -> bytes:
        viewed = self._run(run)
        with self._busy[run]:
            key = (name, run, viewed.refresh(), viewed.problem, rest)
            return self._cache.get(key, lambda: _json(make(viewed)))

    def _of_frame(
        self,
        name: str,
        run: int,
        frame: int,
        query: Query,
        rest: tuple[Any, ...],
        make: Callable[[ViewedRun, Choice], bytes],
    ) -> bytes:
        """Frames that were read stay what they are while the run grows: no revision in the key."""
        viewed = self._run(run)
        with self._busy[run]:
            viewed.refresh()
            viewed.frame(frame)
            choice = viewed.choice(query.get("criterion"), query.get("z_definition"))
            key = (name, run, frame, viewed.generation, choice, rest)
            return self._cache.get(key, lambda: make(viewed, choice))

    def _run(self, run: int) -> ViewedRun:
        if not 0 <= run < len(self.runs):
            raise InvalidSettings(f"run {run}: there are runs 0..{len(self.runs) - 1}")
        return self.runs[run]


def _json(data: Any) -> bytes:
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode()


def _whole(query: Query, name: str, default: int) -> int:
    text = query.get(name)
    if text is None:
        return default
    low, high = _LIMITS[name]
    if not (text.isascii() and text.isdigit()) or not low <= int(text[:9]) <= high:
        raise InvalidSettings(f"{name} is {text[:40]!r}, must be a whole number of {low}..{high}")
    return int(text)


def _places(text: str | None, count: int) -> list[int]:
    if text is None:
        return list(range(count))
    words = text.split(",")
    if not all(word.isascii() and word.isdigit() and int(word[:9]) < count for word in words):
        raise InvalidSettings(f"runs is {text[:40]!r}, must be numbers of 0..{count - 1}")
    return sorted({int(word) for word in words})
