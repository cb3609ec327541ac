"""Which folder a reproduced figure goes to, and what in it may be replaced."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from granufab.errors import InvalidSettings
from granufab.reproduce.case_folder import RUN_FILES, check_writable

__all__ = ["prepare_out_folder"]

FIGURE_ENDINGS = (".pdf", ".png", ".json", ".csv")


def prepare_out_folder(
    name: str, figures: Sequence[str], out: Path | str | None, *, force: bool = False
) -> Path:
    """Empty the folder of an earlier result, or refuse; returns the folder, ready for writing.

    Only what :func:`granufab.reproduce.reproduce` itself leaves is ever removed.

    Args:
        name: of the figure, or all.
        figures: the figures that go there.
        out: the folder; None is ``./granufab-<name>``, which may be replaced.
        force: write into a folder that holds other things too (they stay).
    Raises:
        InvalidSettings: a given folder holds something else, or cannot be written.
    """
    folder = Path(f"granufab-{name}") if out is None else Path(out)
    if folder.exists() and not folder.is_dir():
        raise InvalidSettings(f"{folder}: is a file, not a folder; give another --out")
    foreign = _foreign(folder, figures)
    if foreign and out is not None and not force:
        raise InvalidSettings(
            f"{folder}: holds {foreign[0].name}, which this command did not write; nothing was "
            "changed; choose another --out, or --force to write beside it"
        )
    check_writable(folder)
    _remove_earlier(folder, foreign)
    return folder


def _foreign(folder: Path, figures: Sequence[str]) -> list[Path]:
    if not folder.exists():
        return []
    return sorted(entry for entry in folder.iterdir() if not _is_ours(entry, figures))


def _is_ours(entry: Path, figures: Sequence[str]) -> bool:
    if entry.stem in figures and entry.suffix in FIGURE_ENDINGS:
        return entry.is_file()
    if entry.name == "summary.json":
        return _is_our_summary(entry, figures)
    if entry.name == "runs" and entry.is_dir() and not entry.is_symlink():
        return all(_is_run_folder(item) for item in entry.iterdir())
    return False


def _is_our_summary(path: Path, figures: Sequence[str]) -> bool:
    try:
        held = list(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return False
    return held == list(figures)


def _is_run_folder(folder: Path) -> bool:
    if not folder.is_dir() or folder.is_symlink():
        return False
    return all(item.name in RUN_FILES and item.is_file() for item in folder.iterdir())


def _remove_earlier(folder: Path, foreign: list[Path]) -> None:
    for entry in folder.iterdir():
        if entry in foreign:
            continue
        if entry.is_dir():
            shutil.rmtree(entry)
        else:
            entry.unlink()
