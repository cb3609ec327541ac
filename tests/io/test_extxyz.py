"""Extended XYZ and LAMMPS data: small files by hand, streams, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.io.readers import extxyz

PLACE = np.random.default_rng(4).uniform(0, 5, (3, 5, 3)).round(6)


def _file(path: Path, columns: str = "species:S:1:pos:R:3:radius:R:1:extra:R:1") -> Path:
    text = ""
    for frame in PLACE:
        text += f'5\nLattice="5 0 0 1 5 0 0 0 5" Properties={columns} pbc="T T F" Time=0.5\n'
        for k, place in enumerate(frame):
            text += f"Si {place[0]} {place[1]} {place[2]} {0.4 + k / 100} 1e-3\n"
    path.write_text(text)
    return path


def test_three_frames(tmp_path: Path) -> None:
    run = granufab.read(_file(tmp_path / "a.xyz"))
    assert len(run.frames) == 3
    for k, frame in enumerate(run.frames):
        packing = frame.packing
        np.testing.assert_array_equal(packing.grains.position, PLACE[k])
        np.testing.assert_array_equal(packing.grains.radius, 0.4 + np.arange(5) / 100)
        assert packing.cell is not None
        np.testing.assert_array_equal(packing.cell.matrix, [[5, 1, 0], [0, 5, 0], [0, 0, 5]])
        assert packing.cell.periodic == (True, True, False)
        assert packing.time == 0.5
    assert run.frames.summary.unknown_columns == ("extra",)  # type: ignore[attr-defined]


def test_radii_from_the_user(tmp_path: Path) -> None:
    path = _file(tmp_path / "a.xyz", "species:S:1:pos:R:3:x:R:1:extra:R:1")
    with pytest.raises(MissingData, match="give --radius"):
        granufab.read(path)
    assert granufab.read(path, radius=0.25).frames[0].packing.grains.radius.tolist() == [0.25] * 5


def test_frames_are_not_parsed_before_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows: list[int] = []
    parse = extxyz.parse_table
    monkeypatch.setattr(
        extxyz, "parse_table", lambda *args, **more: rows.append(1) or parse(*args, **more)
    )
    run = granufab.read(_file(tmp_path / "a.xyz"))
    opened = len(rows)
    assert opened <= 2  # the first and the last, for the strain between them
    _ = run.frames[1]
    assert len(rows) == opened + 1


def test_a_count_that_the_file_cannot_hold(tmp_path: Path) -> None:
    path = tmp_path / "a.xyz"
    path.write_text("99999999999\nProperties=species:S:1:pos:R:3\nH 0 0 0\n")
    with pytest.raises(CorruptFile, match=r"a\.xyz: line 1 declares 99999999999 rows"):
        granufab.read(path, radius=1.0)
