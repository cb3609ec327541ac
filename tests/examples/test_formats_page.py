"""Every snippet of docs/formats.md runs, and gives the numbers that stand behind it."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

import granufab

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
SAMPLES = Path(os.environ.get("GRANUFAB_SAMPLES", ROOT.parent / "shared" / "samples"))
SNIPPETS = {
    section.split("\n", 1)[0]: code
    for section in PAGE.split("\n## ")[1:]
    for code in re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)
}


def made(folder: Path) -> None:
    """Files that users make themselves: a periodic square lattice, and a cube of eight labels."""
    folder.mkdir()
    grains, contacts = "frame,id,x,y,r\n", "frame,i,j,fn\n"
    for frame in range(2):
        for k in range(16):
            grains += f"{frame},{k},{k // 4 + 0.5},{k % 4 + 0.5},0.5\n"
            contacts += f"{frame},{k},{(k + 4) % 16},1\n{frame},{k},{k // 4 * 4 + (k + 1) % 4},1\n"
    (folder / "grains.csv").write_text(grains)
    (folder / "contacts.csv").write_text(contacts)
    cube = np.kron(np.arange(1, 9).reshape(2, 2, 2), np.ones((9, 9, 9), int))
    np.save(folder / "labels.npy", cube.astype(np.uint16))


def test_every_format_has_a_snippet() -> None:
    from granufab.io.readers import foreign_formats

    named = set(re.findall(r"`([a-z0-9_-]+)`", "".join(re.findall(r"^## .*$", PAGE, re.MULTILINE))))
    assert named == {known.key for known in foreign_formats()}
    assert len(SNIPPETS) == 14


@pytest.mark.parametrize("title", SNIPPETS)
def test_snippet(title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = SNIPPETS[title]
    needed = re.findall(r'"(\w+)/', code)
    for name in needed:
        if name != "made":
            if not (SAMPLES / name).exists():
                pytest.skip(f"the sample {name} is not in {SAMPLES} (GRANUFAB_SAMPLES)")
            if not (tmp_path / name).exists():
                (tmp_path / name).symlink_to(SAMPLES / name)
    made(tmp_path / "made")
    monkeypatch.chdir(tmp_path)
    names: dict = {"granufab": granufab}
    exec(code, names)
    target, comment = re.search(r"^(\w+, \w+) = [^#\n]*(?:# (.*))?$", code, re.M).groups()  # type: ignore[union-attr]
    values = [float(names[name]) for name in target.split(", ")]
    assert np.isfinite(values).all()
    if comment:
        for value, word in zip(values, comment.split(), strict=True):
            digits = len(word.partition(".")[2])
            assert value == pytest.approx(float(word), abs=0.6 * 10.0**-digits), title
    if title.startswith("Tomography"):
        assert values[0] == 3.0  # each of the eight shares three faces


@pytest.mark.parametrize("text", re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL))
def test_the_column_maps_are_read(text: str, tmp_path: Path) -> None:
    from granufab.io.column_map import read_column_map

    (tmp_path / "columns.toml").write_text(text, encoding="utf-8")
    found = read_column_map(tmp_path / "columns.toml")
    assert found["contacts"]["i"] in ("c_id[1]", 1)


def test_damaged_frames_are_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines of the interactive example, on an experiment that is sound."""
    monkeypatch.syspath_prepend(str(ROOT / "tests" / "io"))
    from one_of_each_binary import EXAMPLES

    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "DataAnnulus_1"
    folder.mkdir()
    EXAMPLES["pegs"](folder)
    (text,) = re.findall(r"```pycon\n(.*?)```", PAGE, flags=re.DOTALL)
    assert all(line.startswith(">>> ") for line in text.splitlines())
    names: dict = {"granufab": granufab}
    exec(re.sub(r"^>>> ", "", text, flags=re.MULTILINE), names)
    run = names["run"]
    assert len(run.frames.numbers) == len(run.frames) > 0
    assert not run.frames.summary.skipped_frames
