"""Which records show themselves as tables in a notebook, registered by name where IPython runs.

The tables need measures and figures, which lie above the records: so the records do not know
them, and nothing is imported before one is shown.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any

__all__ = ["register"]

_TABLES = "granufab.viewer.notebook_tables"
_SHOWN = {
    ("granufab.history", "Run"): "run_table",
    ("granufab.history", "Frame"): "frame_table",
    ("granufab.packing", "Packing"): "packing_table",
    ("granufab.states.domain", "AccessibleDomain"): "domain_table",
    ("granufab.states.fit", "AccessibleFit"): "fit_table",
}


def register() -> bool:
    """Tell the notebook that runs in this process, if there is one, how to show our records.

    Returns:
        Whether there is one.
    """
    module = sys.modules.get("IPython")
    shell = None if module is None else module.get_ipython()
    formatter = getattr(shell, "display_formatter", None)
    if formatter is None:
        return False
    for (home, name), function in _SHOWN.items():
        formatter.formatters["text/html"].for_type_by_name(home, name, _lazily(function))
    pictures = formatter.formatters["image/png"]
    pictures.for_type_by_name("matplotlib.axes._axes", "Axes", _lazily("panel_picture"))
    return True


def _lazily(function: str) -> Callable[[Any], Any]:
    return lambda value: getattr(import_module(_TABLES), function)(value)
