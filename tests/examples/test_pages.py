"""The Python of the pages that read run.h5 runs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))

from moving_run import moving_run

DOCS = Path(__file__).resolve().parents[2] / "docs"
RUN_EXAMPLES = {
    "balance": 2,
    "criterion": 2,
    "forces": 2,
    "local-problems": 2,
    "orientation": 3,
    "reliability": 2,
    "run-file": 2,
    "velocity": 2,
}
"""Pages whose examples read run.h5, and its dimension."""


@pytest.mark.parametrize(("page", "dimension"), RUN_EXAMPLES.items())
def test_the_examples_run(
    page: str, dimension: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    moving_run(Path("run.h5"), dimension, frames=31)
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(compile(block, f"{page}.md", "exec"), names)
    plt.close("all")
