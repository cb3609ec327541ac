"""Every script of the gallery runs as it stands, and every figure, reader and loading has one."""

from __future__ import annotations

import ast
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from page_blocks import ROOT, blocks

from granufab.io import formats
from granufab.io.readers import foreign_formats
from granufab.reproduce import FIGURES
from granufab.simulate.settings import Stage

GALLERY = ROOT / "docs" / "gallery"
SCRIPTS = {
    path.relative_to(GALLERY).as_posix(): path
    for family in ("figures", "sources", "loadings")
    for path in sorted((GALLERY / family).glob("*.py"))
    if not path.name.startswith("shared_")
}
QUICK = {name for name in SCRIPTS if not name.startswith("figures/")} | {
    "figures/fig2.py", "figures/fig7.py",
}  # fmt: skip
"""Those that the default test command runs; building the site runs all."""


def _names(family: str) -> set[str]:
    return {path.stem for name, path in SCRIPTS.items() if name.startswith(f"{family}/")}


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in SCRIPTS
    ],
)  # fmt: skip
def test_a_script_runs_and_leaves_its_figure(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    script = SCRIPTS[name]
    monkeypatch.syspath_prepend(str(script.parent))
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    open_run = formats.foreign_run

    def open_and_note(known: str, *rest: Any) -> Any:
        opened.append(known)
        return open_run(known, *rest)

    monkeypatch.setattr(formats, "foreign_run", open_and_note)
    left = runpy.run_path(str(script), run_name="__main__")
    if name.startswith("sources/"):
        key = {"liggghts_local": "lammps_dump"}.get(script.stem[5:], script.stem[5:])
        assert next(known.name for known in foreign_formats() if known.key == key) in opened
    shown = [value for value in left.values() if hasattr(type(value), "_repr_png_")]
    assert len(shown) == 1
    assert shown[0]._repr_png_().startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [], "a script leaves no files where it is run"


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_asserts_a_number_and_names_the_page_that_goes_deeper(name: str) -> None:
    tree = ast.parse(SCRIPTS[name].read_text(encoding="utf-8"))
    asserted = [node for node in tree.body if isinstance(node, ast.Assert)] + [
        inner
        for node in tree.body
        if isinstance(node, ast.For)
        for inner in node.body
        if isinstance(inner, ast.Assert)
    ]
    assert any(isinstance(node, ast.Compare) for one in asserted for node in ast.walk(one.test))
    text = ast.get_docstring(tree) or ""
    pages = [part.split("`")[0] for part in text.split(":doc:`/")[1:]]
    assert pages
    for page in pages:
        assert (GALLERY.parent / f"{page}.md").exists(), page


def test_every_figure_has_a_script() -> None:
    assert _names("figures") == set(FIGURES)


def test_every_reader_has_a_script() -> None:
    readers = {f"read_{known.key}" for known in foreign_formats()}
    assert _names("sources") == readers | {"read_liggghts_local"}


def test_every_loading_has_a_script() -> None:
    loadings: Any = get_args(Stage.model_fields["loading"].annotation)
    named = {loading.replace("-", "_") for loading in loadings}
    assert _names("loadings") == named | {"true_triaxial", "reversal"}


def test_the_command_of_the_page_runs_a_script_by_itself() -> None:
    """Those of gallery/index.md, from the root of the project."""
    commands = [b.text.strip() for b in blocks(GALLERY / "index.md") if b.language == "sh"]
    assert len(commands) == 1
    python, *words = shlex.split(commands[0])
    assert python == "python"
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "lateral" in done.stdout
