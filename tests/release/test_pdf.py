"""The PDF is printed by a browser that is installed; where there is none, one line says so."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "docs" / "print_pdf.py"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def _print(page: Path, target: Path, path: str | None = None) -> subprocess.CompletedProcess[str]:
    import os

    environment = {**os.environ} if path is None else {**os.environ, "PATH": path}
    return subprocess.run(
        [sys.executable, str(SCRIPT), str(page), str(target)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
        timeout=300,
    )


def test_without_a_browser_one_line_says_what_is_needed(tmp_path: Path) -> None:
    done = _print(tmp_path / "index.html", tmp_path / "x.pdf", path=str(tmp_path))
    assert done.returncode == 1
    assert done.stderr == f"printing the PDF needs one of {', '.join(BROWSERS)} on PATH\n"


@pytest.mark.slow
@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="no Chromium on PATH")
def test_a_page_with_a_formula_is_printed(tmp_path: Path) -> None:
    page, target = tmp_path / "index.html", tmp_path / "new" / "x.pdf"
    done = _print(page, target)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    page.write_text("<h1>G</h1><math><mi>z</mi><mo>=</mo><mn>4</mn></math>", encoding="utf-8")
    done = _print(page, target)
    assert done.returncode == 0, done.stderr
    assert target.read_bytes().startswith(b"%PDF-")
    assert target.stat().st_size > 2000
