"""Files that verbs write: refused before anything is computed."""

from __future__ import annotations

from pathlib import Path

from granufab.errors import InvalidSettings

__all__ = ["check_figure", "check_new", "check_table"]

FIGURE_ENDINGS = (".pdf", ".png", ".svg", ".eps", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")


def check_new(file: Path | None, force: bool) -> None:
    """Refuse to replace a file that exists."""
    if file is not None and file.exists() and not force:
        raise InvalidSettings(f"{file}: exists already; choose another name, or --force")


def check_table(out: Path | None, force: bool) -> None:
    """Refuse a table that cannot be written: another ending, or a file that exists."""
    if out is None:
        return
    if out.suffix not in (".csv", ".nc"):
        raise InvalidSettings(f"--out {out}: the name must end in .csv or .nc")
    check_new(out, force)


def check_figure(output: Path | None, force: bool) -> None:
    """Refuse a figure that cannot be written: ending, existing file, missing folder."""
    if output is None:
        return
    if output.suffix.lower() not in FIGURE_ENDINGS:
        endings = ", ".join(FIGURE_ENDINGS)
        raise InvalidSettings(f"-o {output}: the name must end in one of {endings}")
    check_new(output, force)
    if not output.parent.is_dir():
        raise InvalidSettings(f"{output}: there is no folder {output.parent}")
