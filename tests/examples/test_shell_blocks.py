"""Every command in a block marked ``sh`` runs, in the order of its page, and ends with 0."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "cli"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))

from foreign_tables import sheared_squares
from moving_run import moving_run
from one_of_each_binary import EXAMPLES
from other_programs import write_dumps
from page_blocks import ROOT, blocks

import granufab
from granufab.cli import main
from granufab.io import write

FEW = ("--set", "path.0.strain=0.001", "--set", "path.0.inertial_number=5e-3")
"""Added to ``granufab run``: a path of a few steps."""
CASE = (
    "[sample]\ngrain_count = 40\nfriction = 0.3\n[[path]]\nstrain = 0.01\ninertial_number = 3e-3\n"
)


def _series(folder: Path) -> None:
    """Two exponential approaches to (3.4, 0.235), as in a series of a run."""
    strain = np.linspace(0.0, 0.3, 121)
    for name, z_0 in (("dense", 3.9), ("loose", 3.1)):
        (folder / name).mkdir(exist_ok=True)
        z = 3.4 + (z_0 - 3.4) * np.exp(-strain / 0.02)
        a = 0.235 * (1 - np.exp(-strain / 0.02))
        table = np.column_stack([strain, strain, z, z, a])
        np.savetxt(
            folder / name / "series.csv", table, delimiter=",", comments="",
            header="eps_q,eps_q_total,z,z_backbone,a_signed",
        )  # fmt: skip


def _foreign(folder: Path) -> None:
    """Dumps, tables and exports of a run of spheres."""
    run = granufab.read(moving_run(folder / "run.h5", 3, frames=31))
    write_dumps(run, folder)
    write(run.frames[-1], folder / "spheres.txt")
    grains, contacts = sheared_squares(folder)
    assert (grains.name, contacts.name) == ("grains.csv", "contacts.csv")
    (folder / "case.toml").write_text(CASE, encoding="utf-8")


def _formats(folder: Path) -> None:
    """And the files and folders of three more programs."""
    _foreign(folder)
    EXAMPLES["spam"](folder)
    for name, program in (("DataSim", "rigidlib"), ("DataAnnulus_1", "pegs")):
        (folder / name).mkdir()
        EXAMPLES[program](folder / name)
    (folder / "run.h5").unlink()


def _run(folder: Path) -> None:
    moving_run(folder / "run.h5", 2, frames=31)
    (folder / "case.toml").write_text(CASE, encoding="utf-8")


PREPARED: dict[str, Callable[[Path], None]] = {
    "README.md": _foreign,
    "docs/balance.md": _run,
    "docs/criterion.md": _run,
    "docs/evolution.md": _series,
    "docs/formats.md": _formats,
    "docs/reliability.md": _run,
    "docs/run-file.md": _run,
}
"""Pages whose commands run here, and the files they start from."""
CHECKED = (
    *("CONTRIBUTING.md", "docs/peers.md", "docs/performance.md", "docs/triaxial.md"),
    "docs/viewer.md",
)
"""Pages whose commands take long, serve or install: what they name must exist."""
ELSEWHERE = {"granufab reproduce fig7 --quick": ".ci/run"}
"""Commands that take long, and what runs them."""


def lines(page: str) -> list[str]:
    """The command lines of a page's ``sh`` blocks, without comments."""
    found = [b.text for b in blocks(ROOT / page) if b.language == "sh"]
    stripped = [
        re.sub(r"\s+#.*$", "", line).strip() for text in found for line in text.splitlines()
    ]
    return [line for line in stripped if line and not line.startswith("#")]


def _granufab(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    target = None
    if ">" in words:
        place = words.index(">")
        target, words = words[place + 1], words[:place]
    if words[0] == "run":
        words = [*words, *FEW]
    with pytest.raises(SystemExit) as ended:
        main(words)
    told = capsys.readouterr()
    assert ended.value.code == 0, f"{words}: {told.err}"
    if target:
        Path(target).write_text(told.out, encoding="utf-8")


def _exists(words: list[str]) -> None:
    """What a command of another program names is there."""
    text = shlex.join(words)
    if "pip" in words or words[:3] == ["python", "-m", "venv"] or words[0] == ".":
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
        for named in re.findall(r"\[([\w,]+)\]", text):
            assert set(named.split(",")) <= set(extras["optional-dependencies"]), text
    elif words[0] == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    elif words[0] == "python":
        script = ROOT / words[1]
        assert script.exists(), text
        if script.name == "pages.py":
            assert f'"{words[2]}":' in script.read_text("utf-8")
            return
        source = script / "__main__.py" if script.is_dir() else script
        for option in (word for word in words if word.startswith("--")):
            assert f'"{option}"' in source.read_text("utf-8"), f"{text}: {option}"
    elif words[0] == "granufab":
        done = subprocess.run(
            [sys.executable, "-c", "from granufab.cli import main; main()", words[1], "--help"],
            capture_output=True, text=True, check=True, env={**_wide()},
        )  # fmt: skip
        for option in (word for word in words if word.startswith("--")):
            assert option in done.stdout, text
    else:
        assert words[0] in ("pytest", ".ci/run"), text


def _wide() -> dict[str, str]:
    import os

    return {**os.environ, "COLUMNS": "200"}


def _parts(line: str) -> list[list[str]]:
    return [shlex.split(part) for part in line.split(" && ")]


@pytest.mark.parametrize("page", PREPARED)
def test_the_commands_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    PREPARED[page](tmp_path)
    ran = 0
    for line in lines(page):
        for words in _parts(line):
            text = " ".join(words)
            if text in ELSEWHERE:
                assert text in (ROOT / ELSEWHERE[text]).read_text("utf-8")
            elif words[0] == "granufab":
                _granufab(words[1:], capsys)
                ran += 1
            else:
                _exists(words)
    assert ran > 1


@pytest.mark.parametrize("page", CHECKED)
def test_what_the_commands_name_exists(page: str) -> None:
    found = lines(page)
    assert found
    for line in found:
        for words in _parts(line):
            _exists(words)


def test_a_command_that_does_not_exist_is_noticed() -> None:
    for line in ("make nothing", "python benchmarks/none.py", "pip install 'granufab[none]'"):
        with pytest.raises(AssertionError):
            _exists(shlex.split(line))
    assert shutil.which("granufab-nothing") is None
