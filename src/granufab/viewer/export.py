"""Runs as one HTML file that opens from disk: the page, and compressed blocks of data inside."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from granufab.errors import InvalidSettings
from granufab.fabric.coordination import ZDefinition
from granufab.io.summary import replacing
from granufab.version import VERSION
from granufab.viewer.page_files import page_files
from granufab.viewer.run_data import fit_data
from granufab.viewer.saved_run import SavedRun, compressed
from granufab.viewer.saved_words import saved_words
from granufab.viewer.single_page import data_block, page_parts
from granufab.viewer.thinning import evenly, fitting, parse_size
from granufab.viewer.viewed_run import ViewedRun

__all__ = ["MOST", "SavedPage", "save_page", "saved_page"]

MOST = "20MB"
"""Default limit of a saved page."""
CONTENTS = "saved-contents"
Progress = Callable[[str, float], None]
_PROBED = (0.0, 0.5, 1.0)
_MARGIN = 1.03
"""Allowance for frames larger than those that were probed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedPage:
    """A page with its data.

    Attributes:
        content: of the HTML file.
        lines: in words, what it holds, what was thinned and how exact it is.
    """

    content: bytes
    lines: tuple[str, ...]


def saved_page(
    runs: Sequence[ViewedRun],
    *,
    frames: slice | Sequence[slice] = slice(None),
    most: str | float = MOST,
    progress: Progress | None = None,
) -> SavedPage:
    """The page of some runs with their data inside.

    Args:
        runs: what is looked at.
        frames: the part of each run's frames that is kept, by their places; one part for all
            runs, or one for each.
        most: largest size, in bytes or in words such as ``20MB``; frames above it are left out
            evenly, but never the first and the last.
        progress: is called with a text and the fraction done.
    Raises:
        MissingData: a run has no frames, or plotly is not installed.
        InvalidSettings: no such frames, or the page cannot be so small.
    """
    limit = parse_size(most)
    tell: Progress = progress or (lambda text, fraction: None)
    files = page_files()
    tell("reading", 0.0)
    parts = [frames] * len(runs) if isinstance(frames, slice) else frames
    saved = [SavedRun(*one, part) for one, part in zip(enumerate(runs), parts, strict=True)]
    before, behind = page_parts(files, f"granufab: {', '.join(one.name for one in saved)}")
    rest = len(before) + len(behind)
    fits = {name: fit_data(runs, z_definition=name) for name in get_args(ZDefinition)}
    kept = [one.wanted for one in saved]
    rest += len(_contents(saved, kept, fits, limit)[0])
    kept, blocks = _fitted(saved, limit, rest, tell)
    contents, lines = _contents(saved, kept, fits, limit)
    return SavedPage(content=b"".join([before, contents, *blocks, behind]), lines=lines)


def save_page(page: SavedPage, path: Path | str, *, force: bool = False) -> None:
    """Write a page to a file, whole or not at all.

    Args:
        page: what :func:`saved_page` has made.
        path: of the file.
        force: replace one that exists.
    Raises:
        InvalidSettings: the file exists, or cannot be written there.
        OSError: the disk is full.
    """
    path = Path(path)
    if path.exists() and not force:
        raise InvalidSettings(f"{path}: exists already; choose another name, or force=True")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        stream.write(page.content)
        stream.flush()
        os.fsync(stream.fileno())


def _contents(
    saved: Sequence[SavedRun], kept: Sequence[Sequence[int]], fits: dict[str, Any], limit: int
) -> tuple[bytes, tuple[str, ...]]:
    """The block that the page reads first, and the words on the file."""
    lines = saved_words(saved, kept, limit)
    kinds = {rule.kind: rule.definitions for one in saved for rule in one.rules}
    choices = {"" if kind == "own" else kind: names for kind, names in kinds.items()}
    data = {
        "runs": [one.contents(places) for one, places in zip(saved, kept, strict=True)],
        "fits": fits,
        "choices": choices,
        "saved": {"program": f"granufab {VERSION}", "lines": lines},
    }
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return data_block(CONTENTS, compressed(text.encode())), lines


def _fitted(
    saved: Sequence[SavedRun], limit: int, rest: int, tell: Progress
) -> tuple[list[list[int]], list[bytes]]:
    """The frames that fit, and their blocks."""
    counts = [len(one.wanted) for one in saved]
    sizes = [_MARGIN * size for size in _probed(saved, tell)]
    while True:
        kept = fitting(counts, sizes, limit - rest)
        if kept is None:
            least = rest + sum(
                min(count, 2) * size for count, size in zip(counts, sizes, strict=True)
            )
            raise InvalidSettings(
                f"a page of these runs takes {least / 1e6:.2g} MB with their first and last "
                f"frames alone, {limit / 1e6:.2g} MB are allowed; allow more"
            )
        places = [
            [one.wanted[k] for k in evenly(count, number)]
            for one, count, number in zip(saved, counts, kept, strict=True)
        ]
        blocks = _blocks(saved, places, tell)
        if rest + sum(map(len, blocks)) <= limit:
            return places, blocks
        sizes = [_MARGIN * size for size in sizes]


def _probed(saved: Sequence[SavedRun], tell: Progress) -> list[float]:
    """Bytes of a frame of each run, from its first, its middle and its last one."""
    sizes = []
    for number, one in enumerate(saved):
        tell("measuring the size of frames", number / len(saved))
        places = sorted({one.wanted[round(x * (len(one.wanted) - 1))] for x in _PROBED})
        size = sum(len(block) for blocks in one.blocks(places) for block in blocks)
        sizes.append(size / len(places))
    return sizes


def _blocks(saved: Sequence[SavedRun], places: list[list[int]], tell: Progress) -> list[bytes]:
    found: list[bytes] = []
    total, done = sum(map(len, places)), 0
    for one, mine in zip(saved, places, strict=True):
        for blocks in one.blocks(mine):
            found += blocks
            done += 1
            tell("saving frames", done / total)
    return found
