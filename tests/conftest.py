"""Settings every test needs before matplotlib is first imported, and what tests tell.

Compiled kernels need none: their cache folder is named by a hash of their sources
(``granufab.kernels.options``), so an edited kernel is never served stale.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("MPLBACKEND", "Agg")

COUNTS = "GRANUFAB_COUNTS"
"""Names the file that ``tell`` adds to, one line of JSON each time (``make reliability``)."""


def _teller(node: Any) -> Callable[..., None]:
    def told(**values: Any) -> None:
        print(f"{node.name}: " + ", ".join(f"{key} {value}" for key, value in values.items()))
        target = os.environ.get(COUNTS)
        if target:
            with Path(target).open("a", encoding="utf-8") as lines:
                lines.write(json.dumps({"test": node.nodeid, **values}) + "\n")

    return told


@pytest.fixture
def tell(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Print what a test counted, and keep it where it is asked for."""
    return _teller(request.node)


@pytest.fixture(scope="module")
def tell_of_all(request: pytest.FixtureRequest) -> Callable[..., None]:
    """The same for all tests of a file together."""
    return _teller(request.node)
