"""The Python of docs/viewer.md runs, and saves a page that holds its data."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import granufab

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))

from moving_run import moving_run

PAGE = Path(__file__).resolve().parents[2] / "docs" / "viewer.md"


def test_the_example_of_a_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("plotly", "starlette", "uvicorn"):
        pytest.importorskip(package, reason="the viewer needs granufab[view]")
    monkeypatch.chdir(tmp_path)
    run = granufab.read(moving_run(tmp_path / "run.h5", 2, frames=6))
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(code, PAGE.name, "exec"), {"granufab": granufab, "run": run})
    saved = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(saved) > 50_000
    assert "granufab" in saved
