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
Renew = Callable[[str], None]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The pages and their numbers, to be rewritten."""
    folder = tmp_path / "docs"
    folder.mkdir()
    for path in (*DOCS.glob("*.md"), *DOCS.glob("*.json")):
        shutil.copy(path, folder)
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


def test_every_table_is_what_its_numbers_give(copy: Path, renew: Renew) -> None:
    marked = [page for page in copy.glob("*.md") if MARKED in page.read_text("utf-8")]
    assert len(marked) >= 8
    emptied = 0
    for page in marked:
        text, count = re.subn(
            rf"({MARKED}(.*?) -->\n).*?(<!-- end of \2 -->)",
            r"\1\3",
            page.read_text("utf-8"),
            flags=re.DOTALL,
        )
        page.write_text(text, encoding="utf-8")
        emptied += count
    assert emptied >= 25
    renew("all")
    stale = [p.name for p in marked if p.read_text("utf-8") != (DOCS / p.name).read_text("utf-8")]
    assert not stale, f"run: make pages ({', '.join(stale)})"


@pytest.mark.parametrize(
    ("page", "file", "place", "told"),
    [
        ("claims", "figures", ("fig7", "paths", 0, "z_star", "value"), "9.876"),
        ("figures", "figures", ("fig6", "fit", "default", "z_min", "value"), "L1 2.469"),
        ("performance", "benchmarks", ("start", "help_seconds"), "9.88 s"),
        ("peers", "peers", ("present", 0, "z_backbone"), "9.876"),
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
