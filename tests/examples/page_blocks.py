"""The fenced blocks of the pages."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["ROOT", "Block", "blocks", "pages"]

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ("reference", "gallery/generated", "_static", ".jupyter_cache")


@dataclass(frozen=True)
class Block:
    """A fenced block: its page from the root, its language, its text, its first line."""

    page: str
    language: str
    text: str
    line: int


def pages() -> list[Path]:
    """Every page in Markdown that a reader finds; those written by a build are left out."""
    found = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "paper" / "paper.md"]
    left = [(ROOT / "docs" / name) for name in GENERATED]
    return sorted(p for p in found if not any(p.is_relative_to(one) for one in left))


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page in order, also those within lists.

    Raises:
        ValueError: a block is not closed.
    """
    name = page.relative_to(ROOT).as_posix()
    fence, language, first, text = "", "", 0, []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        found = re.match(r"^(\s*)(`{3,}|~{3,})\s*(.*)$", line)
        if not fence and found:
            fence, language, first, text = found[2], found[3].strip(), number, []
        elif fence and found and found[2].startswith(fence) and not found[3]:
            yield Block(name, language, "\n".join(text) + "\n", first)
            fence = ""
        elif fence:
            text.append(line)
    if fence:
        raise ValueError(f"{name}:{first}: the block is not closed")
