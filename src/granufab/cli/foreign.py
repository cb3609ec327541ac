"""Opening what a user names: run files as they are, other programs' files with their options.

Every verb that reads states takes the same options by :func:`foreign_options` and opens its files
by :func:`open_runs`, so that foreign data behave like own runs everywhere.
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from granufab.errors import InvalidSettings

if TYPE_CHECKING:
    from granufab.history import Run

__all__ = [
    "ForeignOptions",
    "Opened",
    "foreign_options",
    "frame_numbers",
    "frame_place",
    "open_run",
    "open_runs",
    "print_summaries",
]

_PANEL = "Data of other programs (docs/formats.md)"


def _option(help: str, metavar: str | None = None, *names: str, **rules: Any) -> Any:
    return typer.Option(*names, help=help, metavar=metavar, rich_help_panel=_PANEL, **rules)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignOptions:
    """What a user adds to files that do not say it themselves; see ``granufab.io.ReadOptions``."""

    format: Annotated[str | None, _option("Key of the format; default by the content.", "KEY")] = (
        None
    )
    dimension: Annotated[int | None, _option("2 or 3.", "2|3", "--dimension")] = None
    cell: Annotated[
        str | None, _option("Edges of the box, or lower corner and edges.", "Lx,Ly[,Lz]")
    ] = None
    periodic: Annotated[str | None, _option('Periodic axes; "" for none.', "xyz")] = None
    columns: Annotated[Path | None, _option("What the columns of a table hold.", "FILE.toml")] = (
        None
    )
    radius: Annotated[float | None, _option("Of every grain.", "R")] = None
    friction: Annotated[float | None, _option("Between grains.", "MU")] = None
    strain: Annotated[float | None, _option("ε_q from a frame to the next.", "STEP")] = None
    axis: Annotated[str | None, _option("Contraction axis of a'.", "x|y|z|a,b,c")] = None
    walls: Annotated[bool, _option("Keep bodies of walls as grains.", None, "--walls")] = False
    frames: Annotated[
        str | None, _option("Part of the series, as Python counts slices.", "A:B[:STEP]")
    ] = None
    skip_damaged: Annotated[
        bool, _option("Leave out frames that cannot be read, and list them.", None,
                      "--skip-damaged")
    ] = False  # fmt: skip

    def keywords(self) -> dict[str, Any]:
        """Keywords of :func:`granufab.read`, what was not given left out.

        Raises:
            InvalidSettings: a value cannot be read.
            MissingData: there is no such file of columns.
        """
        from granufab.io import read_column_map

        given = {field.name: getattr(self, field.name) for field in fields(self)}
        chosen = {name: value for name, value in given.items() if value not in (None, False)}
        if self.cell is not None:
            chosen["cell"] = _numbers("--cell", self.cell)
        if self.columns is not None:
            chosen["columns"] = read_column_map(self.columns)
        return chosen

    def plain(self) -> dict[str, Any]:
        """What was given as plain data, as the section ``sample.read`` of a case holds it."""
        chosen = {name: value for name, value in self.keywords().items() if name != "columns"}
        return chosen if self.columns is None else {**chosen, "columns": str(self.columns)}


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise InvalidSettings(f"{option} {text!r}: give numbers with commas between") from None


def foreign_options(
    command: Callable[..., None], only: Collection[str] | None = None
) -> Callable[..., None]:
    """Give a verb the options of :class:`ForeignOptions`; it receives them as ``foreign``.

    Args:
        command: the verb.
        only: names of the options that it takes; default all.
    """
    hints = get_type_hints(ForeignOptions, include_extras=True)
    hints = {name: hint for name, hint in hints.items() if only is None or name in only}
    added = [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default,
            annotation=hints[field.name],
        )
        for field in fields(ForeignOptions)
        if field.name in hints
    ]  # fmt: skip
    own_hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=own_hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "foreign"
    ]
    clash = {parameter.name for parameter in own} & set(hints)
    added = [parameter for parameter in added if parameter.name not in clash]

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        shared = {name: given[name] for name in hints}
        rest = {name: value for name, value in given.items() if name not in hints or name in clash}
        command(**rest, foreign=ForeignOptions(**shared))

    parameters = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own] + added
    with_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters}
    return with_options


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Opened:
    """An opened run and the files it was opened from, as the user named them.

    Attributes:
        files: one run file, or foreign files that belong together.
        run: its frames are read when asked for.
        skips: damaged frames are left out.
        foreign: it is another program's data.
    """

    files: tuple[Path, ...]
    run: Run
    skips: bool = False
    foreign: bool = False

    @property
    def name(self) -> str:
        """The first file: what messages and output call the run."""
        return str(self.files[0])

    @property
    def summary(self) -> Any:
        """The import summary of foreign data, or None."""
        return getattr(self.run.frames, "summary", None)

    def skipped(self) -> dict[str, Any]:
        """The JSON entry of damaged frames, where the user let them be skipped."""
        frames = self.summary.skipped_frames if self.summary is not None else []
        return {"skipped_frames": list(frames)} if self.skips else {}


def open_runs(
    files: Sequence[Path], options: ForeignOptions, *, own: Sequence[str] = ()
) -> list[Opened]:
    """Open files: run files and folders one by one, consecutive foreign files of a format as one.

    Args:
        files: as the user named them, in that order.
        options: for those that are not run files.
        own: options that the verb has for run files too.
    Raises:
        InvalidSettings: options of foreign data for run files alone, or a bad value.
        Others: as :func:`granufab.read`.
    """
    from granufab.io import read

    keywords = options.keywords()
    groups = _groups(files, keywords)
    vain = [name for name in keywords if name not in own]
    if vain and not any(foreign for _, foreign in groups):
        name = f"--{vain[0].replace('_', '-')}"
        raise InvalidSettings(f"{name} is for other programs' data, {files[0]} is a run file")
    return [
        Opened(
            files=tuple(group),
            run=read(*group, **(keywords if foreign else {})),
            skips=foreign and options.skip_damaged,
            foreign=foreign,
        )
        for group, foreign in groups
    ]


def frame_numbers(run: Run) -> tuple[int, ...]:
    """Numbers of the frames in their files, which are their places where none is left out."""
    numbers = getattr(run.frames, "numbers", None)
    return tuple(range(len(run.frames))) if numbers is None else numbers


def frame_place(run: Run, name: str, frame: int) -> int:
    """Place of the frame of a number, or from the end where it is negative.

    Raises:
        InvalidSettings: the run has no such frame.
    """
    numbers = frame_numbers(run)
    if frame in numbers:
        return numbers.index(frame)
    if -len(numbers) <= frame < 0:
        return frame + len(numbers)
    held = f"{numbers[0]}..{numbers[-1]}" if numbers else "none"
    if len(numbers) > 1 and len(numbers) <= numbers[-1] - numbers[0]:
        held += f", {len(numbers)} of them"
    raise InvalidSettings(f"--frame {frame}: {name} holds frames {held}")


def open_run(files: Sequence[Path], options: ForeignOptions) -> Opened:
    """Open files that are one run.

    Raises:
        InvalidSettings: they are several.
    """
    opened = open_runs(files, options)
    if len(opened) > 1:
        raise InvalidSettings(
            f"{opened[1].name}: this verb takes one run, got {len(opened)}; give them one by one"
        )
    return opened[0]


def _groups(files: Sequence[Path], keywords: dict[str, Any]) -> list[tuple[list[Path], bool]]:
    """Files that are opened together, and whether they are foreign."""
    from granufab.io import Format, format_of

    groups: list[tuple[list[Path], bool]] = []
    before: object = None
    for file in files:
        known = format_of(file, keywords.get("format"), table="columns" in keywords)
        own = isinstance(known, Format)
        joins = not own and not file.is_dir() and _belongs(file, known, before)
        if joins:
            groups[-1][0].append(file)
        else:
            groups.append(([file], not own))
        keeps = joins and not _completes(before, known)
        before = None if file.is_dir() else before if keeps else known
    return groups


def _belongs(file: Path, known: object, before: object) -> bool:
    """Whether a file is of the format of the one before, or completes it."""
    from granufab.io import Format
    from granufab.io.foreign_format import ForeignFormat

    if known is before or not isinstance(before, ForeignFormat) or isinstance(known, Format):
        return known is before
    if _completes(known, before) or _completes(before, known):
        return True
    with file.open("rb") as stream:
        return before.matches(file, stream.read(4096))


def _completes(part: object, whole: object) -> bool:
    """Whether files of one format belong to those of another."""
    from granufab.io.foreign_format import ForeignFormat

    if not isinstance(part, ForeignFormat) or not isinstance(whole, ForeignFormat):
        return False
    return part.key in whole.completed_by


def print_summaries(opened: Sequence[Opened]) -> None:
    """Say on standard error what was read of foreign data and what was done to it."""
    for one in opened:
        if one.summary is not None:
            for line in one.summary.lines():
                print(f"granufab: {line}", file=sys.stderr)
