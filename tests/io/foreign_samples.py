"""Where the real files of other programs lie; they are no part of the project."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

FOLDER = Path(
    os.environ.get("GRANUFAB_SAMPLES", Path(__file__).parents[2].parent / "shared" / "samples")
)


def sample(*names: str) -> Path:
    """A real file or folder; the test is skipped where it is absent."""
    path = FOLDER.joinpath(*names)
    if not path.exists():
        pytest.skip(f"no {path.name}: set GRANUFAB_SAMPLES to the folder of sample files")
    return path
