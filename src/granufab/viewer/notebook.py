"""Runs in a notebook: the saved page of the viewer inside an output cell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from granufab.errors import InvalidSettings
from granufab.history import Run
from granufab.io import read
from granufab.viewer.export import MOST, SavedPage, save_page, saved_page
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["Shown", "view"]

Viewable = Run | Path | str
_SANDBOX = "allow-scripts allow-downloads"
"""The page may run its own scripts and save pictures; it is of no origin, so it reaches nothing."""


class Shown:
    """A page of the viewer that a notebook shows.

    Args:
        page: with its data inside.
        height: of the cell [CSS pixels].
    """

    def __init__(self, page: SavedPage, height: int) -> None:
        self.page, self.height = page, height

    def save(self, path: Path | str, *, force: bool = False) -> Path:
        """Write the page to an HTML file that opens from disk.

        Args:
            path: of the file.
            force: replace one that exists.
        Returns:
            The path.
        Raises:
            InvalidSettings: the file exists, or cannot be written there.
        """
        save_page(self.page, path, force=force)
        return Path(path)

    def _repr_html_(self) -> str:
        text = self.page.content.decode().replace("&", "&amp;").replace('"', "&quot;")
        return (
            f'<iframe sandbox="{_SANDBOX}" width="100%" height="{self.height}" '
            f'title="granufab" style="border: 0" srcdoc="{text}"></iframe>'
        )

    def __repr__(self) -> str:
        size = len(self.page.content) / 1e6
        return "\n".join([f"page of the viewer, {size:.1f} MB: save(path) writes it", *self.lines])

    @property
    def lines(self) -> tuple[str, ...]:
        """In words, what the page holds, what was thinned and how exact it is."""
        return self.page.lines


def view(
    runs: Viewable | Sequence[Viewable],
    *,
    frames: slice | None = None,
    height: int = 760,
    most: str | float = MOST,
) -> Shown:
    """Look at runs in a notebook: the page of ``granufab view`` with its data inside.

    Args:
        runs: a run, a path of anything that :func:`granufab.read` reads, or several of them.
        frames: the part of each run's frames that is kept, such as ``slice(0, None, 2)``.
        height: of the page in the notebook [CSS pixels].
        most: largest size of the page, in bytes or in words; frames above it are left out evenly.
    Returns:
        What a notebook shows; its ``save(path)`` writes the page to a file.
    Raises:
        MissingData: a run has no frames, or the extra ``view`` is not installed.
        InvalidSettings: no runs, no such frames, or the page cannot be so small.
        Others: as :func:`granufab.read`.
    """
    several = [runs] if isinstance(runs, Run | Path | str) else list(runs)
    if not several:
        raise InvalidSettings("view needs a run or a path, got an empty list")
    viewed = [_viewed(one) for one in several]
    return Shown(saved_page(viewed, frames=frames or slice(None), most=most), height)


def _viewed(one: Viewable) -> ViewedRun:
    if isinstance(one, Run):
        return ViewedRun(one.name, [], lambda: one, run=one)
    if not isinstance(one, Path | str):
        raise InvalidSettings(f"view takes runs and paths, got a {type(one).__name__}")
    return ViewedRun(str(one), [], lambda: read(one))
