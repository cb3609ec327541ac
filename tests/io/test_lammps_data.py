"""Data files of LAMMPS, written here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lammps_text import contacts, lattice

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import select_contacts


def _text(style: str = "sphere", general: bool = False) -> str:
    state = lattice(0, 0.2, side=3)
    (lx, xy, xz), (_, ly, yz), (_, _, lz) = state.matrix.tolist()
    x, y, z = state.origin.tolist()
    text = f"spheres # of a test\n\n{len(state.radius)} atoms\n1 atom types\n\n"
    if general:
        rows = [*state.matrix.T.tolist(), state.origin.tolist()]
        for row, name in zip(rows, ("avec", "bvec", "cvec", "abc origin"), strict=True):
            text += " ".join(map(repr, row)) + f" {name}\n"
    else:
        text += f"{x!r} {x + lx!r} xlo xhi\n{y!r} {y + ly!r} ylo yhi\n{z!r} {z + lz!r} zlo zhi\n"
        text += f"{xy!r} {xz!r} {yz!r} xy xz yz # tilts\n"
    text += f"\nAtoms # {style}\n\n"
    for k, (r, p) in enumerate(zip(state.radius.tolist(), state.position.tolist(), strict=True)):
        place = " ".join(map(repr, p))
        values = f"{2 * r!r} 2.5 " if style == "sphere" else ""
        text += f"{state.number[k]} 1 {values}{place} 0 0 0\n"
    text += "\nVelocities\n\n"
    for number in sorted(state.number.tolist()):
        text += f"{number} {number} 0.5 -1 0 0 {2 * number}\n"
    return text


@pytest.mark.parametrize("general", [False, True])
def test_a_state_is_what_was_written(tmp_path: Path, general: bool) -> None:
    path, state = tmp_path / "in.data", lattice(0, 0.2, side=3)
    path.write_text(_text(general=general))
    packing = granufab.read(path).frames[0].packing
    grains, cell = packing.grains, packing.cell
    assert grains.number is not None
    assert grains.velocity is not None
    assert grains.spin is not None
    assert cell is not None
    assert grains.number.tolist() == state.number.tolist()
    assert grains.position == pytest.approx(state.position, abs=1e-14)
    assert grains.radius == pytest.approx(state.radius, abs=1e-14)
    assert grains.mass == pytest.approx(2.5 * 4 / 3 * np.pi * state.radius**3)
    assert grains.velocity[:, 0].tolist() == state.number.tolist()
    assert grains.spin[:, 2].tolist() == (2 * state.number).tolist()
    assert cell.matrix == pytest.approx(state.matrix, abs=1e-12)
    assert cell.origin == pytest.approx(state.origin, abs=1e-12)
    assert cell.periodic == (True, True, True)
    assert select_contacts(packing, "gap:0").count == len(contacts(state))


def test_boundaries_are_the_users(tmp_path: Path) -> None:
    path = tmp_path / "in.data"
    path.write_text(_text())
    run = granufab.read(path, periodic="xy")
    cell = run.frames[0].packing.cell
    assert cell is not None
    assert cell.periodic == (True, True, False)


@pytest.mark.parametrize(
    ("old", "new", "error", "match"),
    [
        ("27 atoms", "28 atoms", CorruptFile, "Atoms has 27 rows, the header says 28"),
        ("Atoms # sphere", "Atoms # ellipsoid", MissingData, "'ellipsoid' cannot be read"),
        ("Atoms # sphere", "Bodies", CorruptFile, "no section Atoms"),
        (" 2.5 ", " ", CorruptFile, r"line \d+ has 9 columns, expected 7 or 10"),
        (" 2.5 ", " x ", CorruptFile, r"line \d+: 'x' is not a number"),
        ("xlo xhi", "1 xlo xhi", CorruptFile, "no three lines of two numbers"),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, old: str, new: str, error: type[Exception], match: str
) -> None:
    path = tmp_path / "in.data"
    path.write_text(_text().replace(old, new, 1))
    with pytest.raises(error, match=rf"in\.data: .*({match})"):
        granufab.read(path)


def test_points_need_a_radius(tmp_path: Path) -> None:
    path = tmp_path / "in.data"
    path.write_text(_text("atomic"))
    with pytest.raises(MissingData, match="give --radius"):
        granufab.read(path)
    assert (granufab.read(path, radius=0.5).frames[0].packing.grains.radius == 0.5).all()
