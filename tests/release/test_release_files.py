"""What a release needs: one version, a valid citation, a paper whose references exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BIB = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
DOI = re.compile(r"10\.\d{4,9}/[-._;()/:A-Za-z0-9]+")


def _cited(text: str) -> str:
    (value,) = re.findall(r"^version: (.+)$", text, re.MULTILINE)
    return value


def test_the_version_has_one_place() -> None:
    assert _cited((ROOT / "CITATION.cff").read_text("utf-8")) == PROJECT["version"]
    assert f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text("utf-8")
    import granufab

    sources = Path(granufab.__file__).parent.rglob("*.py")
    assert not [p for p in sources if PROJECT["version"] in p.read_text("utf-8")]


def test_the_citation_is_valid() -> None:
    pytest.importorskip("cffconvert", reason="cffconvert comes with the extra release")
    from cffconvert import Citation

    citation = Citation((ROOT / "CITATION.cff").read_text("utf-8"))
    citation.validate()
    assert "10.1007/s10035-012-0321-8" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_the_paper_cites_what_the_bibliography_has() -> None:
    keys = set(re.findall(r"^@\w+\{(\w+),", BIB, re.MULTILINE))
    assert set(re.findall(r"@(\w+)", PAPER)) == keys
    entries = BIB.split("\n@")
    without = [e.split(",")[0] for e in entries if not re.search(r"doi = \{(.+)\}", e)]
    assert not without
    assert all(DOI.fullmatch(doi) for doi in re.findall(r"doi = \{(.+)\}", BIB))


def test_the_paper_is_short_and_its_figures_exist() -> None:
    body = PAPER.split("---\n", 2)[2]
    assert 700 < len(body.split()) < 1400
    pictures = re.findall(r"\]\((\S+\.png)\)", body)
    assert len(pictures) == 2
    assert all((ROOT / "paper" / picture).is_file() for picture in pictures)
    for heading in ("Summary", "Statement of need", "State of the field", "Example", "References"):
        assert f"# {heading}\n" in body


def test_the_papers_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    """With fewer grains and less strain."""
    (code,) = re.findall(r"```python\n(.*?)```", PAPER, re.DOTALL)
    small = code.replace("random_sample(500", "random_sample(60").replace(
        "strain=0.2", "strain=0.1"
    )
    assert small.count("60") == small.count("strain=0.1") == 1
    exec(compile(small, "paper.md", "exec"), {})
    values = [
        float(v) for v in re.findall(r"value=(?:np\.float64\()?([\d.]+)", capsys.readouterr().out)
    ]
    assert len(values) == 3
    assert 2.0 < values[0] < values[1] < 5.0


def test_the_forms_ask_for_what_is_needed() -> None:
    yaml = pytest.importorskip("yaml", reason="PyYAML comes with the extra docs")
    forms = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
    assert [path.name for path in forms] == ["bug.yml", "config.yml", "number.yml"]
    for path in forms:
        form = yaml.safe_load(path.read_text("utf-8"))
        if path.name == "config.yml":
            continue
        assert {"name", "description", "body"} <= set(form)
        asked = [one["id"] for one in form["body"] if one["type"] != "markdown"]
        assert "version" in asked
        assert len(set(asked)) == len(asked)
    bug = yaml.safe_load(forms[0].read_text("utf-8"))
    needed = {one["id"] for one in bug["body"] if one.get("validations", {}).get("required")}
    assert {"version", "command", "doctor"} <= needed


def test_no_python_is_named_that_was_not_tried() -> None:
    """Minor versions among the classifiers are those that the tests run on."""
    named = re.findall(r"Python :: (3\.\d+)", " ".join(PROJECT["classifiers"]))
    assert named == ["3.11"]
    assert PROJECT["requires-python"] == ">=3.11"


def test_the_extras_are_pinned() -> None:
    pins = re.findall(r"^([\w.-]+)==", (ROOT / "constraints.txt").read_text("utf-8"), re.MULTILINE)
    pinned = {re.sub(r"[-_.]+", "-", name).lower() for name in pins}
    extras = PROJECT["optional-dependencies"]
    for name in ("test", "dev", "docs", "release"):
        wanted = {re.split(r"[\[<>=]", one)[0].lower() for one in extras[name]} - {"granufab"}
        assert wanted <= pinned, name
