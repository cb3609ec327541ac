"""One function for every frame of a run, in order: here one after the other.

:func:`granufab.campaign.frame_workers` gives a map that does the same in several processes.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Protocol, TypeVar

from granufab.history import Frame, FrameSource

__all__ = ["FrameMap", "do_frame", "one_by_one"]

T = TypeVar("T")


class FrameMap(Protocol):
    """Gives the results of a function for every frame, in the order of the frames."""

    def __call__(
        self, function: Callable[[Frame], T], frames: FrameSource | Sequence[Frame], /
    ) -> Iterator[T]:
        """Results, each made when it is asked for or a little before."""
        ...


def one_by_one(
    function: Callable[[Frame], T], frames: FrameSource | Sequence[Frame], /
) -> Iterator[T]:
    """Read a frame, give the result, forget the frame."""
    for frame in frames:
        result = function(frame)
        del frame  # before the next one is read
        yield result


def do_frame(task: bytes, index: int) -> Any:
    """In a worker: the result for one frame; here, so that a worker imports little.

    Args:
        task: function and source of frames, pickled by the process that started this one.
        index: of the frame.
    """
    function, frames = pickle.loads(task)
    return function(frames[index])
