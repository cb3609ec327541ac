"""The frames of a run as compressed blocks, each made once however often they are thinned."""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from granufab.errors import InvalidSettings
from granufab.io.summary import plain
from granufab.viewer.run_data import overview, series_data
from granufab.viewer.saved_frame import saved_changes, saved_frame
from granufab.viewer.saved_rules import saved_rules
from granufab.viewer.saved_states import saved_states
from granufab.viewer.single_page import data_block
from granufab.viewer.state_data import interval_data
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["SavedRun", "compressed"]

_LEVEL = 9


def compressed(data: bytes) -> bytes:
    """gzip, the same bytes every time."""
    return gzip.compress(data, _LEVEL, mtime=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """A frame's blocks but for its changes, compressed, and the name of its grains' block."""

    frame: bytes
    states: bytes
    grains: str
    quantised: dict[str, Any]


class SavedRun:
    """A run that is put into a page.

    Args:
        index: its place among the runs of the page.
        viewed: the run.
        frames: the part of its frames that is wanted.
    Raises:
        InvalidSettings: there is no such frame.
        MissingData: the run has no frames.
    """

    def __init__(self, index: int, viewed: ViewedRun, frames: slice) -> None:
        self.viewed, self.index = viewed, index
        own = viewed.choice(None, None)
        self.wanted = _chosen(viewed, frames)
        self.rules = saved_rules(own, viewed.frame(self.wanted[0]))
        self._made: dict[int, _Parts] = {}
        self._grains: dict[str, bytes] = {}

    @property
    def name(self) -> str:
        """The last three parts of its path: what tells runs apart, without where they lie."""
        return "/".join(self.viewed.name.replace("\\", "/").split("/")[-3:])

    def blocks(self, places: Sequence[int]) -> Iterator[list[bytes]]:
        """The blocks of the page for each of these frames; grains that are new, with the first."""
        known: set[str] = set()
        for row, place in enumerate(places):
            parts = self._parts(place)
            end = f"{self.index}-{row}"
            found = [
                data_block(f"frame-{end}", parts.frame),
                data_block(f"states-{end}", parts.states),
                data_block(
                    f"changes-{end}", self._changes(place, places[row - 1] if row else None)
                ),
            ]
            if parts.grains not in known:
                known.add(parts.grains)
                name = f"grains-{self.index}-{parts.grains}"
                found.append(data_block(name, self._grains[parts.grains]))
            yield found

    def contents(self, places: Sequence[int]) -> dict[str, Any]:
        """What the page asks first: the run as listed, its overview and its series."""
        whole = overview(self.viewed)
        frames = {
            name: [values[place] for place in places] for name, values in whole["frames"].items()
        }
        own = {"name": self.name, "frames": frames, "frame_count": len(places), "problem": None}
        listed = {
            "run": self.index, "name": self.name, "revision": 0, "generation": 0,
            "finished": True, "problem": None,
        }  # fmt: skip
        return {
            "listed": listed,
            "overview": {**whole, **own, "revision": 0, "generation": 0},
            "series": series_data(self.viewed),
        }

    def quantised(self, places: Sequence[int]) -> dict[str, float]:
        """The widest steps over these frames: positions and gaps [mean diameters], forces."""
        found: dict[str, float] = {}
        for place in places:
            for name, step in self._parts(place).quantised.items():
                found[name] = max(step, found.get(name, 0.0))
        return found

    def _parts(self, place: int) -> _Parts:
        if place not in self._made:
            frame = self.viewed.frame(place)
            saved = saved_frame(frame, self.rules)
            grains = saved.grain_block()
            name = hashlib.sha256(grains).hexdigest()[:16]
            if name not in self._grains:
                self._grains[name] = compressed(grains)
            self._made[place] = _Parts(
                frame=compressed(saved.block(name)),
                states=compressed(saved_states(self.viewed.run, frame, self.rules)),
                grains=name,
                quantised=_in_diameters(saved.header),
            )
        return self._made[place]

    def _changes(self, place: int, before: int | None) -> bytes:
        """Contacts gained and lost since the kept frame before."""
        after, rule = self.viewed.frame(place), self.rules[0]
        earlier = None if before is None else self.viewed.frame(before)
        interval: dict[str, Any] = {"missing": "there is no frame before"}
        if earlier is not None:
            interval = interval_data(earlier, after, rule.choice)
        return compressed(saved_changes(after, rule, earlier, interval))


def _chosen(viewed: ViewedRun, frames: slice) -> list[int]:
    """Places of the frames that a slice means, in their order."""
    count = len(viewed.run.frames)
    if frames.step is not None and frames.step < 1:
        raise InvalidSettings(f"frames in steps of {frames.step}: the step must be 1 or more")
    chosen = list(range(count))[frames]
    if not chosen:
        ends = ":".join("" if end is None else str(end) for end in (frames.start, frames.stop))
        raise InvalidSettings(f"frames {ends}: {viewed.name} holds frames 0..{count - 1}")
    return chosen


def _in_diameters(header: dict[str, Any]) -> dict[str, float]:
    diameter = 2 * header["mean_radius"]
    steps = header["quantised"]
    found = {"position": max(plain(steps["position"])) / diameter}
    gaps = [steps[name] for name in ("listed_gap", "near_gap") if name in steps]
    if gaps:
        found["gap"] = max(gaps) / diameter
    if steps.get("force"):
        found["force"] = steps["force"]
    return found
