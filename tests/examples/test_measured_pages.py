"""Every measured table of the documentation is what its JSON gives; renewing changes nothing."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS, BENCHMARKS = ROOT / "docs", ROOT / "benchmarks"
MARKED = "<!-- measured table: "
SETTINGS = "tests/reliability/test_hostile_settings.py:: slow"
Renew = Callable[[str], None]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The pages and their numbers, to be rewritten."""
    folder = tmp_path / "docs"
    folder.mkdir()
    for path in (*DOCS.glob("*.md"), *DOCS.glob("*.json")):
        shutil.copy(path, folder)
    shutil.copytree(ROOT / "paper", tmp_path / "paper")
    return folder


@pytest.fixture
def renew(copy: Path, monkeypatch: pytest.MonkeyPatch) -> Renew:
    """Writes pages of the copy from the numbers beside them."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in {path.stem for path in BENCHMARKS.glob("*.py")} & set(sys.modules):
        monkeypatch.delitem(sys.modules, name)
    import pages  # type: ignore[import-not-found]

    monkeypatch.setattr(pages, "DOCS", copy)
    return lambda name: pages.main(name, copy)


def _emptied(text: str) -> tuple[str, int]:
    """A page without its measured tables and counts, and how many they were."""
    table = rf"({MARKED}(.*?) -->\n).*?(<!-- end of \2 -->)"
    text, tables = re.subn(table, r"\1\3", text, flags=re.DOTALL)
    text, counts = re.subn(r"(<!-- counted: \w+ -->).*?(<!-- end -->)", r"\1\2", text)
    return text, tables + counts


def test_every_number_is_what_its_json_gives(copy: Path, renew: Renew) -> None:
    found = {}
    for page in (*copy.glob("*.md"), copy.parent / "paper" / "paper.md"):
        text = page.read_text("utf-8")
        empty, count = _emptied(text)
        if count:
            found[page] = (text, count)
            page.write_text(empty, encoding="utf-8")
    assert len(found) >= 10
    assert sum(count for _, count in found.values()) >= 55
    renew("all")
    stale = [page.name for page, (text, _) in found.items() if page.read_text("utf-8") != text]
    assert not stale, f"run: make pages ({', '.join(stale)})"


@pytest.mark.parametrize(
    ("page", "file", "place", "told"),
    [
        ("claims", "figures", ("fig7", "paths", 0, "z_star", "value"), "9.876"),
        ("figures", "figures", ("fig6", "fit", "default", "z_min", "value"), "L1 2.469"),
        ("performance", "benchmarks", ("start", "help_seconds"), "9.88 s"),
        ("peers", "peers", ("present", 0, "z_backbone"), "9.876"),
        ("reliability", "reliability", (SETTINGS, "told", 0, "seconds"), "9.88 s"),
    ],
)
def test_another_number_changes_the_page(
    page: str, file: str, place: tuple[str | int, ...], told: str, copy: Path, renew: Renew
) -> None:
    path = copy / f"{file}.json"
    data = json.loads(path.read_text("utf-8"))
    part = data
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = 9.876
    path.write_text(json.dumps(data), encoding="utf-8")
    assert told not in (DOCS / f"{page}.md").read_text("utf-8")
    renew(page)
    assert told in (copy / f"{page}.md").read_text("utf-8")
