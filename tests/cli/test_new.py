"""``new`` prints commented TOML that reads back as the same case."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from granufab.cli.templates import TEMPLATES
from granufab.simulate.settings import Case, load_case

NAMES = [
    "isotropic", "shear", "biaxial", "triaxial", "true-triaxial", "simple-shear", "reversal",
]  # fmt: skip


def test_the_promised_templates_exist() -> None:
    assert sorted(TEMPLATES) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_output_reads_back_as_the_same_case(name: str, granufab, tmp_path: Path) -> None:
    done = granufab("new", name)
    assert done.code == 0
    file = tmp_path / "case.toml"
    file.write_text(done.out, encoding="utf-8")
    assert load_case(file) == TEMPLATES[name]


@pytest.mark.parametrize("name", NAMES)
def test_every_setting_carries_its_meaning(name: str, granufab) -> None:
    text = granufab("new", name).out
    for line in text.splitlines()[2:]:
        if line and not line.startswith("["):
            assert "  # " in line, line


def test_reversal_turns_back() -> None:
    forth, back = TEMPLATES["reversal"].path
    assert forth.strain > 0 > back.strain


def test_templates_differ_in_what_drives_the_cell(granufab) -> None:
    loadings = {
        name: tomllib.loads(granufab("new", name).out)["path"][0]["loading"] for name in NAMES
    }
    assert loadings == {
        "isotropic": "isotropic",
        "shear": "constant-mean",
        "biaxial": "biaxial",
        "triaxial": "triaxial",
        "true-triaxial": "constant-mean",
        "simple-shear": "simple-shear",
        "reversal": "constant-mean",
    }
    assert all(isinstance(case, Case) for case in TEMPLATES.values())
