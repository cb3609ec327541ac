"""exaDEM: frames of polyhedra with the interactions of the same step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample
from mangling import check_mutations, check_truncations

import granufab
from granufab.errors import CorruptFile, GranufabError, MissingData
from granufab.fabric import measure

BODIES = {3: (0.2, 1.0, 1.0), 5: (1.1, 1.0, 1.0), 9: (3.9, 1.2, 1.0)}


def _frame(folder: Path, step: int, pbc: str = ' pbc="T F F"') -> Path:
    rows = "".join(
        f"XX {x} {y} {z} 1 2 3 0 0.5 4 5 6 0 0 0 {k}\n" for k, (x, y, z) in BODIES.items()
    )
    path = folder / f"dem_pos_vel_{step:09d}.xyz"
    path.write_text(
        '3\nLattice="4 0 0 0 3 0 0 0 3" Properties=species:S:1:pos:R:3:vel:R:3:cluster:I:1:'
        f"mass:R:1:vrot:R:3:arot:R:3:id:I:1 Time={step / 10}{pbc}\n{rows}"
    )
    return path


def _row(i: int, j: int, parts: str, kind: int, force: str, tangent: str = "0,0,0.5") -> str:
    return f"{i},{j},{parts},{kind},-0.01,0,0,0,{force},{tangent},0,0,0,0,0,0\n"


def _interactions(folder: Path, step: int) -> Path:
    """3 and 5 touch at two parts; 9 touches 3 across the edge; a driver; a bond."""
    path = folder / f"InteractionOutputDir-{step}_0.txt"
    path.write_text(
        _row(3, 5, "1,2", 0, "-2,0,0")
        + _row(5, 3, "2,1", 0, "2,0,0", "0,0,-0.5")
        + _row(3, 5, "1,2", 2, "1,0,0")
        + _row(9, 3, "0,7", 3, "-3,0,-4")
        + _row(3, 0, "1,4294967296", 5, "0,9,0")
        + _row(3, 9, "1,1", 13, "0,9,0")
    )
    return path


def test_frame_and_interactions(tmp_path: Path) -> None:
    frame, listed = _frame(tmp_path, 20), _interactions(tmp_path, 20)
    run = granufab.read(frame, listed, radius=0.4)
    packing = run.frames[0].packing
    contacts, grains = packing.contacts, packing.grains
    assert contacts is not None and contacts.force is not None and contacts.gap is not None
    assert packing.time == 2.0 and grains.number is not None and grains.mass is not None
    assert grains.number[contacts.pair].tolist() == [[3, 5], [3, 5], [9, 3]]
    assert grains.mass.tolist() == [0.5] * 3
    assert np.allclose(contacts.normal, [[1, 0, 0], [1, 0, 0], [0.6, 0, 0.8]])
    assert np.allclose(contacts.force, [[2, 0, -0.5], [-1, 0, -0.5], [3, 0, 3.5]])
    assert contacts.branch is not None and np.allclose(contacts.branch[2], [0.3, -0.2, 0])
    summary = run.frames.summary  # type: ignore[union-attr]
    assert (summary.duplicates_dropped, summary.wall_contacts_dropped) == (1, 1)
    assert measure(packing, criterion="listed", z_definition="z")["z"] == 2.0


def test_a_folder_is_matched_by_step(tmp_path: Path) -> None:
    for step in (10, 20, 100):
        _frame(tmp_path, step, pbc="")
    for step in (100, 20):
        _interactions(tmp_path, step)
    run = granufab.read(tmp_path, radius=0.4)
    assert [run.frames[k].packing.time for k in range(len(run.frames))] == [2.0, 10.0]
    notes = " ".join(run.frames.summary.notes)  # type: ignore[union-attr]
    assert "1 frames without interactions" in notes and "give --periodic" in notes
    with pytest.raises(MissingData, match="give --radius"):
        granufab.read(tmp_path)
    with pytest.raises(MissingData, match=r"give the \.xyz file"):
        granufab.read(tmp_path / "InteractionOutputDir-20_0.txt")


def test_mangled_files(tmp_path: Path) -> None:
    frame, listed = _frame(tmp_path, 20), _interactions(tmp_path, 20)

    def read() -> granufab.Run:
        return granufab.read(frame, listed, format="exadem", radius=0.4)

    check_truncations(frame, read)
    for path in (frame, listed):
        assert check_mutations(path, read) > 20
    whole = listed.read_bytes()
    for cut in range(1, min(len(whole), 201)):
        if whole[cut - 1 : cut] != b"\n":  # a cut between two rows cannot be told
            listed.write_bytes(whole[:cut])
            with pytest.raises(GranufabError, match=r"_0\.txt: line \d+ does not end"):
                read()
    listed.write_bytes(whole)
    frame.write_text(frame.read_text().replace("3\nLat", "9999999\nLat"))
    with pytest.raises(CorruptFile, match="announces 9999999 grains"):
        read()


def test_sample_of_two_steps() -> None:
    """Fabric of the sample from its own lines: normals along f_n, unoriented."""
    folder = sample("exadem")
    run = granufab.read(folder, radius=0.1)
    assert len(run.frames) == 2
    for k, step in enumerate((7980, 8000)):
        packing = run.frames[k].packing
        table = np.loadtxt(folder / f"InteractionOutputDir-{step}_0.txt", delimiter=",")
        table = table[table[:, 4] < 4]
        normal = table[:, 9:12] / np.linalg.norm(table[:, 9:12], axis=1)[:, None]
        values = np.linalg.eigvalsh(normal.T @ normal / len(table))
        assert packing.contacts is not None and packing.grains.count == 200
        ours = packing.contacts.normal
        assert packing.contacts.count == len(table)
        assert np.linalg.eigvalsh(ours.T @ ours / len(table)) == pytest.approx(values, abs=1e-9)
        first = packing.grains.position[np.flatnonzero(packing.grains.number == table[0, 0])[0]]
        assert np.allclose(first, table[0, 15:18], atol=1e-4)
        force = packing.contacts.force
        assert force is not None and packing.contacts.branch is not None
        assert np.allclose(np.linalg.norm(force, axis=1),
                           np.linalg.norm(table[:, 9:12] + table[:, 12:15], axis=1))  # fmt: skip
        assert (np.einsum("ci,ci->c", ours, packing.contacts.branch) >= 0).all()
