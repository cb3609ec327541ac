"""The ten minutes' page runs to the letter, in order, in one folder, and prints what it shows."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from importlib.util import find_spec
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs"))
sys.path.insert(0, str(Path(__file__).parent))

from console_pages import Shell, blocks, commands
from printed_lines import assert_alike

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "start.md"
SERVED = "granufab view dense/run.h5 loose/run.h5"
INSTALL = [
    "python3 -m venv env",
    ". env/bin/activate",
    "python -m pip install '.[view]'",
]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Shell, dict[str, str]]:
    """The folder after all blocks, and what each command printed."""
    shell = Shell(tmp_path_factory.mktemp("start"))
    printed: dict[str, str] = {}
    for language, text in blocks(PAGE, "console", "python"):
        if language == "python":
            (shell.folder / "mine.py").write_text(text, encoding="utf-8")
            printed["python"] = shell.run("python mine.py")
        for command in commands(text) if language == "console" else ():
            printed[command.line] = shell.run(command.line)
            assert_alike(printed[command.line], command.printed)
    return shell, printed


def _value(text: str, name: str) -> float:
    found = re.search(rf"^\s*{re.escape(name)}\s+([\d.]+)", text, re.MULTILINE)
    assert found, f"{name} is not in\n{text}"
    return float(found[1])


def test_both_samples_end_in_one_critical_state(played: tuple[Shell, dict[str, str]]) -> None:
    shell, printed = played
    found = {
        name: next(text for line, text in printed.items() if line.endswith(f"--out {name}"))
        for name in ("dense", "loose")
    }
    assert _value(found["dense"], "z_0") > _value(found["loose"], "z_0") + 0.5
    assert abs(_value(found["dense"], "z*") - _value(found["loose"], "z*")) < 0.1
    assert (shell.folder / "path.png").stat().st_size > 20_000
    for name in ("run.h5", "series.csv", "settings.toml", "summary.json"):
        assert (shell.folder / "loose" / name).exists()


def test_foreign_tables_give_the_state_of_the_run(played: tuple[Shell, dict[str, str]]) -> None:
    shell, printed = played
    line = next(line for line in printed if line.startswith("granufab fit theirs"))
    own = shell.run("granufab fit loose/run.h5")
    assert _value(printed[line], "z_star") == pytest.approx(_value(own, "z_star"), abs=0.02)
    assert _value(printed[line], "a_star") == pytest.approx(_value(own, "a_star"), abs=0.05)
    python = [float(word) for word in re.findall(r"= ([\d.]+)", printed["python"])]
    names = ("z_star", "a_star", "z_min")
    assert python == pytest.approx([_value(printed[line], name) for name in names], abs=0.006)
    rows = (shell.folder / "theirs.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 32


def test_the_other_blocks_are_the_ones_tested_here() -> None:
    text = "".join(block for _, block in blocks(PAGE, "bash"))
    assert text.splitlines() == [*INSTALL, SERVED]
    languages = set(re.findall(r"^```(\w+)", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert languages == {"bash", "console", "python"}


@pytest.mark.skipif(
    any(find_spec(name) is None for name in ("starlette", "uvicorn", "plotly")),
    reason="the viewer needs granufab[view]",
)
def test_the_viewer_serves_both_runs(played: tuple[Shell, dict[str, str]]) -> None:
    shell = played[0]
    with subprocess.Popen(
        ["bash", "-c", f"exec {SERVED} --no-browser"],
        cwd=shell.folder, env=shell.environment(), stdout=subprocess.PIPE, text=True,
    ) as server:  # fmt: skip
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        try:
            assert address.startswith("http://127.0.0.1:")
            with urllib.request.urlopen(address, timeout=60) as answer:
                assert "granufab" in answer.read().decode()
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(address.split("?")[0], timeout=60)
        finally:
            server.send_signal(signal.SIGINT)
        assert server.wait(60) == 0


@pytest.mark.slow
def test_the_installation_in_a_new_environment(tmp_path: Path) -> None:
    """Needs a package index or a folder of wheels (PIP_FIND_LINKS, PIP_NO_INDEX)."""
    source = tmp_path / "granufab"
    subprocess.run(["git", "clone", "-q", str(ROOT), str(source)], check=True)
    lines = [*INSTALL, "env/bin/granufab --version"]
    done = subprocess.run(
        ["bash", "-ec", "unset PYTHONPATH\n" + "\n".join(lines)],
        cwd=source, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode and "No matching distribution" in done.stderr:
        pytest.skip("no packages to install from")
    assert done.returncode == 0, done.stderr
    assert re.search(r"^granufab \d+\.\d+\.\d+$", done.stdout, re.MULTILINE)
