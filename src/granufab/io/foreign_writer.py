"""A format that packings are written in for other programs, and how its files come about."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from granufab.errors import InvalidSettings
from granufab.io.summary import replacing
from granufab.packing import Packing

__all__ = ["ForeignWriter", "one_file"]


def one_file(path: Path) -> tuple[Path, ...]:
    """The path itself: a format of one file a state."""
    return (path,)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignWriter:
    """How packings become files of one format.

    Attributes:
        key: the word for ``--format``.
        name: in words, as messages show it.
        suffixes: of files, by which the format is chosen.
        fill: write states to temporary files, as many as ``files`` names.
        files: the files that belong to a path.
        series: whether one file holds several states.
        left_out: what the format has no place for.
    """

    key: str
    name: str
    suffixes: tuple[str, ...]
    fill: Callable[[Iterable[Packing], Sequence[Path]], None]
    files: Callable[[Path], tuple[Path, ...]] = one_file
    series: bool = False
    left_out: str = ""

    def save(
        self, states: Iterable[Packing], path: Path | str, *, force: bool = False
    ) -> tuple[Path, ...]:
        """Write states, whole or not at all.

        Args:
            states: one, or several where the format holds a series.
            path: of the file, or what the files' names begin with.
            force: replace existing files.
        Returns:
            The files written.
        Raises:
            InvalidSettings: a file exists, or cannot be written.
            MissingData: a state lacks what the format needs.
        """
        files = self.files(Path(path))
        for file in files:
            if file.is_dir():
                raise InvalidSettings(f"{file}: is a folder, expected a file name")
            if file.exists() and not force:
                raise InvalidSettings(f"{file}: exists already; use force to replace it")
        with ExitStack() as stack:
            self.fill(states, [stack.enter_context(replacing(file)) for file in files])
        return files
