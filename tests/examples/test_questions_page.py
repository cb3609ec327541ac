"""The commands of questions.md, of concepts.md and of the first lines of other pages run."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))
sys.path.insert(0, str(Path(__file__).parent))

from console_pages import blocks, commands
from small_runs import CASES, sheared

from granufab.cli import main
from granufab.simulate.settings import to_toml

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = ("questions.md", "concepts.md")
OPENINGS = [
    (page.name, " ".join(span.split()))
    for page in sorted(DOCS.glob("*.md"))
    if page.name not in PAGES
    for span in re.findall(
        r"`(granufab [^`]*?\brun\.h5[^`]*)`", page.read_text("utf-8").split("\n## ")[0]
    )
]
"""Commands within the text above the first heading, where a page says how it is reached."""
LINES = [
    (page, command.line)
    for page in PAGES
    for _, text in blocks(DOCS / page, "console")
    for command in commands(text)
]
LINES += list(dict.fromkeys(OPENINGS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run, its last state as tables, and the case that made it."""
    folder = tmp_path_factory.mktemp("questions")
    sheared(folder)
    (folder / "case.toml").write_text(to_toml(CASES[2]), encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["export", str(folder / "run.h5"), "-o", str(folder / "own.csv"), "--frame", "-1"])
    assert ended.value.code == 0
    for part in ("grains", "contacts"):
        (folder / f"own_{part}.csv").rename(folder / f"{part}.csv")
    return folder


@pytest.mark.parametrize(("page", "line"), LINES, ids=[" ".join(one) for one in LINES])
def test_command(
    page: str,
    line: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("GRANUFAB_THREADS", "1")
    tool, *words = shlex.split(line)
    assert tool == "granufab"
    with pytest.raises(SystemExit) as ended:
        main(words)
    printed = capsys.readouterr()
    assert ended.value.code == 0, printed.err
    file = re.search(r"(?:-o|--out) (\S+)", line)
    if file:
        assert (folder / file[1]).exists()
    else:
        assert printed.out.strip()


def test_console_blocks_are_all_there_is() -> None:
    for page in PAGES:
        languages = set(re.findall(r"^```(\w+)", (DOCS / page).read_text("utf-8"), re.MULTILINE))
        assert languages == {"console"}, page
    assert len(LINES) - len(set(OPENINGS)) > 20
    assert len(set(OPENINGS)) > 8


def test_every_extra_stands_on_the_page() -> None:
    import tomllib

    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    wanted = {name for name, needed in extras.items() if needed}
    text = (DOCS / "questions.md").read_text(encoding="utf-8")
    table = text.split("| extra | for |")[1].split("\n\n")[0]
    assert wanted <= set(re.findall(r"`(\w+)`", table))
