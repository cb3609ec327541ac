"""The README's Python example runs as printed, with smaller samples, and gives sane numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def _example() -> str:
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) == 1
    return blocks[0]


def test_the_example_is_short() -> None:
    assert 8 <= len([line for line in _example().splitlines() if line.strip()]) <= 20


def test_the_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = _example()
    small = code.replace("random_sample(500", "random_sample(100").replace(
        "strain=0.2", "strain=0.1"
    )
    assert small.count("random_sample(100") == 2
    assert small.count("strain=0.1") == 2
    exec(compile(small, "README.md", "exec"), {})
    out = capsys.readouterr().out
    printed = re.findall(r"z = ([\d.]+), a = ([\d.]+)", out)
    assert len(printed) == 2
    z_min, z_max = map(float, re.findall(r"z_\w+ = ([\d.]+)", out))
    assert 2.0 < z_min < z_max < 5.0
    for z, a in printed:
        assert 2.8 < float(z) < 4.1  # between the isostatic limits of frictional and smooth disks
        assert 0.05 < float(a) < 0.8
    assert (tmp_path / "path.png").stat().st_size > 5000


@pytest.mark.parametrize(
    "command",
    [
        "python -m pip install -e '.[test]' && granufab reproduce fig7 --quick",
        "python -m pip install -e '.[test]' && pytest",
    ],
)
def test_the_two_commands_stand_in_the_readme(command: str) -> None:
    assert command in README.splitlines()


def test_every_file_the_readme_links_exists() -> None:
    links = re.findall(r"\]\(([^)#:]+)\)", README)
    assert "docs/api.md" in links
    assert not [link for link in links if not (ROOT / link).exists()]
