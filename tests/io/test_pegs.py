"""Photoelastic experiments in the layout of PeGS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample
from mangling import check_mutations

import granufab
from granufab.errors import CorruptFile, GranufabError, MissingData
from granufab.fabric import measure

DISKS = ((11, 0.0, 0.0, 10.0), (12, 19.0, 0.0, 10.0), (15, 19.0, 22.0, 11.0))


def _experiment(folder: Path, columns: int = 6) -> Path:
    """Two frames; 15 is listed with 12 although the measured disks do not touch."""
    folder.mkdir(exist_ok=True)
    rows, listed = "", ""
    for frame in (4, 5):
        for k, x, y, r in DISKS:
            values = f"{k},{x + frame},{y},{r}"
            rows += f"{frame},{values},0\n" if columns == 6 else f"{values},{frame}\n"
        listed += f"{frame},11,12,0.25,2\n{frame},12,11,0.25,2\n"
        listed += f"{frame},15,12,-0.5,1.5\n" if frame == 5 else ""
    (folder / "particle_positions.txt").write_text(rows)
    (folder / "Adjacency_list.txt").write_text(listed)
    return folder


@pytest.mark.parametrize("columns", [5, 6])
def test_the_list_tells_who_touches(tmp_path: Path, columns: int) -> None:
    folder = _experiment(tmp_path / "run", columns)
    for given in ((folder,), (folder / "Adjacency_list.txt", folder / "particle_positions.txt")):
        run = granufab.read(*given)
        assert len(run.frames) == 2
        packing = run.frames[1].packing
        contacts = packing.contacts
        assert packing.dimension == 2 and contacts is not None and contacts.force is not None
        assert packing.grains.number is not None
        assert packing.grains.number[contacts.pair].tolist() == [[11, 12], [15, 12]]
        assert contacts.gap is not None and contacts.gap.tolist() == [-1.0, 1.0]
        assert np.allclose(contacts.normal, [[1, 0], [0, -1]])
        assert np.allclose(contacts.force, [[2, 0.25], [-0.5, -1.5]])
        assert measure(packing, z_definition="z")["z"] == pytest.approx(4 / 3)
        assert run.frames.summary.duplicates_dropped == 2  # type: ignore[union-attr]


def test_what_lacks_is_named(tmp_path: Path) -> None:
    folder = _experiment(tmp_path / "run")
    with pytest.raises(MissingData, match=r"Adjacency_list\.txt.*one file of positions"):
        granufab.read(folder / "Adjacency_list.txt")
    text = (folder / "Adjacency_list.txt").read_text().replace("5,15,12", "5,16,12")
    (folder / "Adjacency_list.txt").write_text(text)
    run = granufab.read(folder)
    assert run.frames[0].packing.grains.count == 3
    with pytest.raises(
        CorruptFile, match=r"frame 5 has no particle 16, which touches 12 in line 5"
    ):
        _ = run.frames[1]


def test_mangled_files(tmp_path: Path) -> None:
    folder = _experiment(tmp_path / "run")
    for name in ("particle_positions.txt", "Adjacency_list.txt"):
        check_mutations(folder / name, lambda: granufab.read(folder, format="pegs"))
        _check_cuts(folder, name)


def _check_cuts(folder: Path, name: str) -> None:
    """Cuts between two lines cannot be told; any other one is refused."""
    whole = (folder / name).read_bytes()
    for cut in range(1, min(len(whole), 201)):
        (folder / name).write_bytes(whole[:cut])
        if whole[cut - 1 : cut] == b"\n":
            continue
        with pytest.raises(GranufabError, match=rf"{name}: line \d+ does not end"):
            granufab.read(folder, format="pegs")
    (folder / name).write_bytes(whole)


def test_annulus_sample() -> None:
    """Frame 1 against its own lines; frame 2 lists particles that have no positions."""
    folder = sample("rigidlib", "DataAnnulus_1")
    run = granufab.read(folder)
    packing = run.frames[0].packing
    assert packing.grains.count == 1783 and packing.contacts is not None
    place, pairs = {}, {}
    for line in (folder / "particle_positions.txt").read_text().splitlines():
        number, x, y, _, frame = map(float, line.split(","))
        if frame == 1:
            place[number] = np.array([x, y])
    for line in (folder / "Adjacency_list.txt").read_text().splitlines():
        frame, i, j, _, push = map(float, line.split(","))
        if frame == 1:
            pairs[min(i, j), max(i, j)] = push
    normal = np.array([place[j] - place[i] for i, j in pairs])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    low, high = np.linalg.eigvalsh(normal.T @ normal / len(pairs))
    values = measure(packing, criterion="listed", z_definition="z")
    assert packing.contacts.count == len(pairs) == 51
    assert values["z"] == pytest.approx(2 * 51 / 1783)
    assert values["a"] == pytest.approx(2 * (high - low))
    force = packing.contacts.force
    assert force is not None
    along = np.einsum("ci,ci->c", force, packing.contacts.normal)
    assert sorted(along) == pytest.approx(sorted(pairs.values()))
    with pytest.raises(CorruptFile, match="frame 2 has no particle"):
        _ = run.frames[1]
