"""Every code block of every page is run by a test, and every link leads somewhere."""

from __future__ import annotations

import importlib.util
import re
import sys
import zlib
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import test_pages
import test_shell_blocks
from page_blocks import ROOT, Block, blocks, pages

PAGES = pages()
SHOWN = {"text", "none"}
"""Languages of what is only shown: output, a formula, another program's input."""
TESTS = "tests/examples"
CLAIMED: dict[tuple[str, str], str] = {
    ("README.md", "python"): f"{TESTS}/test_readme.py",
    ("paper/paper.md", "python"): "tests/release/test_release_files.py",
    ("docs/api.md", "python"): "tests/architecture/test_api.py",
    ("docs/states.md", "python"): "tests/states/test_page.py",
    ("docs/evolution.md", "python"): "tests/states/test_page.py",
    ("docs/formats.md", "python"): f"{TESTS}/test_formats_page.py",
    ("docs/formats.md", "toml"): f"{TESTS}/test_formats_page.py",
    ("docs/formats.md", "pycon"): f"{TESTS}/test_formats_page.py",
    ("docs/concepts.md", "console"): f"{TESTS}/test_questions_page.py",
    ("docs/campaigns.md", "python"): f"{TESTS}/test_campaigns_page.py",
    ("docs/campaigns.md", "toml"): f"{TESTS}/test_campaigns_page.py",
    ("docs/campaigns.md", "sh"): f"{TESTS}/test_campaigns_page.py",
    **{(f"docs/{page}.md", "python"): f"{TESTS}/test_pages.py" for page in test_pages.RUN_EXAMPLES},
    **{
        (page, "sh"): f"{TESTS}/test_shell_blocks.py"
        for page in (*test_shell_blocks.PREPARED, *test_shell_blocks.CHECKED)
    },
}
"""Which test runs the blocks of a page in a language."""


def claim(block: Block) -> str | None:
    """The test of a block: as listed, or the one named after its page or folder."""
    found = CLAIMED.get((block.page, block.language))
    if found:
        return found
    place = Path(block.page)
    names = [place.stem] if place.parent == Path("docs") else [place.parent.name]
    for name in names:
        for candidate in (f"test_{name}_page.py", f"test_{name}.py"):
            path = ROOT / TESTS / candidate
            if path.exists() and place.parent.name + "/" + place.name in _words(path):
                return f"{TESTS}/{candidate}"
            if path.exists() and place.name in _words(path):
                return f"{TESTS}/{candidate}"
    return None


def _words(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def _every_block() -> list[Block]:
    return [block for page in PAGES for block in blocks(page)]


def test_every_block_has_a_language_and_a_test() -> None:
    found = _every_block()
    assert len(found) > 60
    lost = [
        f"{block.page}:{block.line} [{block.language}]"
        for block in found
        if not block.language.startswith("{")
        and block.language not in SHOWN
        and claim(block) is None
    ]
    assert not lost, f"no test runs {lost}"


def test_every_claim_is_of_a_block_and_by_a_test_that_names_its_page() -> None:
    here = {(block.page, block.language) for block in _every_block()}
    for (page, language), test in CLAIMED.items():
        assert (page, language) in here, f"{page} has no {language}"
        text = _words(ROOT / test)
        stem = Path(page).stem
        assert f'"{stem}' in text or f"{stem}.md" in text or stem in text, (page, test)


def test_a_block_without_a_test_is_noticed(tmp_path: Path) -> None:
    assert claim(Block("docs/none.md", "python", "1\n", 1)) is None
    assert claim(Block("docs/states.md", "console", "$ granufab\n", 1)) is None
    broken = ROOT / "docs" / "states.md"
    assert len(list(blocks(broken))) >= 1


def _slug(title: str) -> str:
    """The anchor of a heading, as MyST and forges make it."""
    text = re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", title).strip().lower()
    return re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", text))


def _prose(page: Path) -> str:
    """A page without its blocks and its code."""
    text = re.sub(r"^(\s*)(`{3,}).*?^\1\2\s*$", "", page.read_text("utf-8"), flags=re.S | re.M)
    return re.sub(r"`[^`\n]*`", "", text)


def _anchors(page: Path) -> set[str]:
    text = re.sub(r"^(\s*)(`{3,}).*?^\1\2\s*$", "", page.read_text("utf-8"), flags=re.S | re.M)
    titles = re.findall(r"^#{1,6}\s+(.+?)\s*$", text, re.MULTILINE)
    return {_slug(title) for title in titles} | set(re.findall(r"^\((.+)\)=$", text, re.MULTILINE))


def links(page: Path) -> list[str]:
    """Targets of the links and pictures of a page."""
    return re.findall(r"\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)", _prose(page))


def _fault(page: Path, link: str) -> str | None:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        good = parts.scheme in ("https", "http", "mailto") and (parts.netloc or parts.path)
        return None if good else "no address"
    path = (page.parent / unquote(parts.path)) if parts.path else page
    built = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else ""
    if built.startswith(("docs/reference/", "docs/gallery/generated")):
        return None  # written by a build, which checks it
    if not path.exists() and not path.with_name(path.name + ".md").exists():
        return "no such file"
    path = path if path.exists() else path.with_name(path.name + ".md")
    if parts.fragment and path.suffix == ".md" and parts.fragment not in _anchors(path):
        return "no such heading"
    return None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page: Path) -> None:
    faults = {link: _fault(page, link) for link in links(page)}
    assert not {link: fault for link, fault in faults.items() if fault}


def test_a_broken_link_is_noticed() -> None:
    page = ROOT / "docs" / "states.md"
    assert _fault(page, "none.md") == "no such file"
    assert _fault(page, "solver.md#none") == "no such heading"
    assert _fault(page, "https:") == "no address"
    assert _fault(page, "solver.md#residual") is None


def test_every_page_is_in_a_table_of_contents() -> None:
    listed: set[Path] = {ROOT / "docs" / "index.md"}
    for page in PAGES:
        if not page.is_relative_to(ROOT / "docs"):
            continue
        for block in blocks(page):
            if not block.language.startswith("{toctree}"):
                continue
            entries = [line.strip() for line in block.text.splitlines()]
            for entry in (one for one in entries if one and not one.startswith(":")):
                name = re.sub(r"^.*<(.*)>$", r"\1", entry)
                listed |= set(page.parent.glob(f"{name.removesuffix('.md')}.md"))
    lost = [page for page in PAGES if page.is_relative_to(ROOT / "docs") and page not in listed]
    assert not lost


def test_the_check_of_a_built_site_notices_what_is_wrong(tmp_path: Path) -> None:
    """The same that ``make docs`` runs after each build."""
    spec = importlib.util.spec_from_file_location("check_site", ROOT / "docs" / "check_site.py")
    assert spec is not None
    assert spec.loader is not None
    check = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(check)
    (tmp_path / "a.html").write_text(
        '<p id="here"><a href="b.html#there">b</a><a href="#here">a</a><img src="c.png">'
        '<a href="https://example.org/x">out</a><a href="b.html#none">lost</a>',
        encoding="utf-8",
    )
    (tmp_path / "b.html").write_text('<h1 id="there">b</h1>', encoding="utf-8")
    assert sorted(check.broken_links(tmp_path)) == ["a.html: b.html#none", "a.html: c.png"]
    names = "granufab.fabric.tensors.fabric_tensor py:function 1 x -\n"
    head = b"# Sphinx inventory version 2\n# Project: x\n# Version: 1\n# zlib\n"
    (tmp_path / "objects.inv").write_bytes(head + zlib.compress(names.encode()))
    missing = set(check.missing_names(tmp_path))
    assert "granufab.fabric_tensor" not in missing
    assert "granufab.fabric.fabric_tensor" not in missing
    assert "granufab.measure" in missing
