"""A foreign format: how its files are recognised and opened."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from granufab.io.found import Source
from granufab.io.read_options import ReadOptions

__all__ = ["ForeignFormat"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignFormat:
    """A format of another program.

    Attributes:
        key: the word for ``--format``.
        name: in words, as messages show it.
        matches: whether a file or folder is of this format, or a part of it that another file
            completes, from its path and first bytes (none for a folder).
        open: open files that belong together, in the order given; parses no frame yet beyond
            what finding them takes. Raises MissingData where a part is missing, and says which.
        byte_order_mark: whether its text may begin with one, as spreadsheets write it.
        completed_by: keys of formats whose files, given before or after one of this, belong to
            it.
    """

    key: str
    name: str
    matches: Callable[[Path, bytes], bool]
    open: Callable[[Sequence[Path], ReadOptions], Source]
    completed_by: tuple[str, ...] = ()
    byte_order_mark: bool = False
