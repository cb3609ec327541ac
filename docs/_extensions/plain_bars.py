"""Docstrings may write \\|a\\| for a size: bars outside of literals are no substitutions."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

__all__ = ["setup"]

_LITERAL = re.compile(r"(``.+?``|`[^`]+`)")


def _escaped(line: str) -> str:
    parts = _LITERAL.split(line)
    return "".join(part if k % 2 else part.replace("|", r"\|") for k, part in enumerate(parts))


def _changed(
    _app: Sphinx, _what: str, _name: str, _of: Any, _options: Any, lines: list[str]
) -> None:
    lines[:] = [line if line.startswith("..") else _escaped(line) for line in lines]


def setup(app: Sphinx) -> dict[str, Any]:
    """Change docstrings before they are read."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _changed, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
