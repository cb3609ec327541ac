"""The tutorial notebooks run, say what they found in asserted numbers, and are all listed."""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from notebook_cells import TUTORIALS, cells, run_cells

PAGES = sorted(page for page in TUTORIALS.glob("*.md") if page.stem != "index")
QUICK = [page for page in PAGES if page.stem != "friction-campaign"]
by_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


def _run(page: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a page shows no warnings
        run_cells(page)


@pytest.mark.parametrize("page", QUICK, ids=lambda page: page.stem)
def test_all_cells_run_in_order(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _run(page)


@pytest.mark.slow
def test_the_campaign_and_its_shell_commands_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = TUTORIALS / "friction-campaign.md"
    _run(page)
    runs = {file: file.stat().st_mtime_ns for file in tmp_path.glob("friction/cases/*/run.h5")}
    (lines,) = re.findall(r"^```sh\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    for line in lines.splitlines():
        words = shlex.split(line)
        assert words[0] == "granufab"
        command = [sys.executable, "-c", "from granufab.cli import main; main()", *words[1:]]
        subprocess.run(command, check=True, timeout=300)
    assert (tmp_path / "friction.png").stat().st_size > 10_000
    assert len(runs) == 6
    assert {file: file.stat().st_mtime_ns for file in runs} == runs  # nothing ran again


@by_page
def test_cells_assert_numbers_are_plain_python_and_fit_the_page(page: Path) -> None:
    found = [node for code in cells(page) for node in ast.walk(ast.parse(code))]
    checks = [node for node in found if isinstance(node, ast.Assert)]
    assert len(checks) >= 2
    widest = max(len(line) for code in cells(page) for line in code.splitlines())
    assert widest <= 90  # what a page shows without scrolling
    for check in checks:  # each looks at something that was computed
        assert any(isinstance(node, ast.Name) for node in ast.walk(check.test))


@by_page
def test_a_page_begins_with_its_notebook_and_ends_with_three_lines(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    head, _, _ = text.partition("\n## ")
    assert f"{{nb-download}}`{page.stem}.ipynb`" in head
    last = text.rpartition("\n## ")[2]
    assert last.startswith("What to take along\n")
    assert len(re.findall(r"^\d\. ", last, re.MULTILINE)) == 3
    assert "\nNext: " in last
    assert len(re.findall(r"\]\(", last)) >= 2


def test_the_index_lists_all() -> None:
    text = (TUTORIALS / "index.md").read_text(encoding="utf-8")
    names = {page.stem for page in PAGES}
    assert len(names) == 5
    assert set(re.findall(r"^\| \[.+?\]\((\S+?)\.md\) \|", text, re.MULTILINE)) == names
    listed = text.partition("```{toctree}")[2].partition("```")[0]
    assert {line.strip() for line in listed.splitlines()} >= names


@by_page
def test_links_lead_to_pages(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [name for name in targets if not (page.parent / name).exists()] == []
