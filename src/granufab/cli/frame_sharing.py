"""Options of verbs that can share the frames of a run file among processes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from granufab.fabric.frame_map import FrameMap

__all__ = ["DaskWorkers", "Workers", "shared_frames"]

Workers = Annotated[
    int, typer.Option(metavar="N", help="Processes that share the frames of a run file.")
]
DaskWorkers = Annotated[
    str | None,
    typer.Option(metavar="local|ADDRESS", help="Share them on Dask workers (extra: sweep)."),
]


@contextmanager
def shared_frames(workers: int, dask: str | None) -> Iterator[FrameMap]:
    """The map over frames that the options ask for.

    Raises:
        InvalidSettings, MissingData: as :func:`granufab.campaign.frame_workers.frame_workers`.
    """
    if workers == 1 and dask is None:
        from granufab.fabric.frame_map import one_by_one

        yield one_by_one
        return
    from granufab.campaign.frame_workers import frame_workers

    with frame_workers(workers, dask) as each:
        yield each
