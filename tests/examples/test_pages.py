"""The pages of the documentation: all listed, no broken link, and their Python runs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))

from moving_run import moving_run

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(DOCS.glob("*.md"))
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


def test_the_index_lists_every_page() -> None:
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \[\S+\]\((\S+)\) \|", text, re.MULTILINE)
    pages = [page.name for page in PAGES if page.name != "index.md"]
    assert sorted(listed) == sorted([*pages, "decisions"])


@pytest.mark.parametrize(
    "page", [*PAGES, *sorted(DOCS.glob("decisions/*.md"))], ids=lambda page: page.stem
)
def test_links_and_pictures_exist(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert not [link for link in links if not (page.parent / link).exists()]


def test_every_page_with_an_example_is_run() -> None:
    # test_page.py of states, test_{formats,campaigns,start,definitions}_page.py
    elsewhere = {"states", "evolution", "formats", "campaigns", "start", "definitions"}
    signatures = {"api", "architecture"}
    pages = {page.stem for page in PAGES if "```python" in page.read_text(encoding="utf-8")}
    assert pages == set(RUN_EXAMPLES) | elsewhere | signatures


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
