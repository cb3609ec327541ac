"""Figures of gallery scripts: whatever a script leaves in a variable and a notebook would show.

sphinx-gallery's own collector knows only figures of pyplot; those of ``granufab.plots`` are none.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

__all__ = ["collect"]

DOTS_PER_INCH = 180


def collect(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures that a block has made, and return the text that shows them."""
    shown: list[Any] = block_vars.setdefault("shown_figures", [])
    paths = []
    for value in list(block_vars["example_globals"].values()):
        if not hasattr(type(value), "_repr_png_") or any(value is one for one in shown):
            continue
        shown.append(value)
        path = next(block_vars["image_path_iterator"])
        if isinstance(value, Figure):
            value.savefig(path, dpi=DOTS_PER_INCH)
        else:
            Path(path).write_bytes(value._repr_png_())
        paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])
