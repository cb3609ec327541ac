"""Code cells of the tutorials, run in order without Jupyter."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

__all__ = ["TUTORIALS", "cells", "run_cells"]

TUTORIALS = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
_CELL = re.compile(r"^```\{code-cell\} python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def cells(page: Path) -> list[str]:
    """The code of a MyST notebook, cell by cell."""
    return _CELL.findall(page.read_text(encoding="utf-8"))


def run_cells(page: Path) -> dict[str, Any]:
    """Run all cells in the present folder, and return the names that they leave."""
    names: dict[str, Any] = {"__name__": "notebook"}
    for number, code in enumerate(cells(page), 1):
        exec(compile(code, f"{page.name}, cell {number}", "exec"), names)
    return names
