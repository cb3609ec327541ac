"""MercuryDPM: restart files of three ages, data and fstat series in 2D and 3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample
from mangling import check_mutations, check_truncations

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import measure

EDGE = 10.0
SPHERES = ((1.0, 5.0, 5.0, 1.0), (2.9, 5.0, 5.0, 1.0), (9.1, 5.0, 5.0, 1.0), (2.9, 6.8, 5.0, 0.9))
"""x y z r; 0 touches 1 and, across the edge, 2; 1 touches 3."""
PAIRS = ((0, 1), (2, 0), (3, 1))


def _line(p: tuple[float, ...], k: int) -> str:
    x, y, z, r = p
    return (
        f"BaseParticle id {k + 7} indSpecies 0 position {x} {y} {z} orientation 1 0 0 0 "
        f"velocity 0.1 {k} 0 angularVelocity 0 0 {k} force 0 0 0 torque 0 0 0 radius {r} "
        f"invMass {0.5 if k else 0.25}\n"
    )


def _restart(path: Path, *, interactions: bool = True) -> Path:
    """Four spheres with numbers from 7, a wall contact; the forces are on the first."""
    text = (
        "MercuryDPM 1.0 name test\n"
        f"xMin 0 xMax {EDGE} yMin 0 yMax {EDGE} zMin 0 zMax {EDGE}\n"
        "timeStep 0.1 time 2.5 ntimeSteps 25 timeMax 9\n"
        "systemDimensions 3 particleDimensions 3 gravity 0 0 0\n"
        "Species 1\nLinearSpecies id 0 density 1\nWalls 0\nBoundaries 2\n"
        f"PeriodicBoundary id 0 normal 1 0 0 distanceLeft 0 distanceRight {EDGE} shift {EDGE} 0 0\n"
        "DeletionBoundary id 1 normal 0 0 1 distance 3\n"
        f"Particles {len(SPHERES)}\n" + "".join(_line(p, k) for k, p in enumerate(SPHERES))
    )
    if interactions:
        text += (
            "Interactions 4\n"
            "Law particleIds 7 8 timeStamp 1 contactPoint 2 5 5 force -3 0.5 0 torque 0 0 0\n"
            "Law particleIds 9 7 timeStamp 1 force -2 0 0 torque 0 0 0\n"
            "Law particleWallIds 8 0 timeStamp 1 contactPoint 2 0 5 force 0 9 0 torque 0 0 0\n"
            "Law particleIds 10 8 timeStamp 1 contactPoint 3 6 5 force 0 4 0 torque 0 0 0\n"
        )
    path.write_text(text)
    return path


def test_restart_gives_what_it_says(tmp_path: Path) -> None:
    run = granufab.read(_restart(tmp_path / "new.restart"))
    packing = run.frames[0].packing
    contacts, grains = packing.contacts, packing.grains
    assert contacts is not None and contacts.force is not None and contacts.gap is not None
    assert packing.time == 2.5 and packing.cell is not None
    assert packing.cell.periodic == (True, False, False)
    assert grains.number is not None and grains.number.tolist() == [7, 8, 9, 10]
    assert grains.mass is not None and grains.mass.tolist() == [4.0, 2.0, 2.0, 2.0]
    assert contacts.pair.tolist() == [[0, 1], [2, 0], [3, 1]]
    assert np.allclose(contacts.gap, [-0.1, -0.1, -0.1])
    assert np.allclose(contacts.force, [[3, -0.5, 0], [2, 0, 0], [0, -4, 0]])
    # Independent: two normals along x, one along y.
    assert np.allclose((contacts.normal.T @ contacts.normal) / 3, np.diag([2 / 3, 1 / 3, 0]))
    assert run.frames.summary.wall_contacts_dropped == 1  # type: ignore[union-attr]


@pytest.mark.parametrize("version", [2, 3])
def test_old_restarts_are_rows_by_position(tmp_path: Path, version: int) -> None:
    head = "BP " if version == 3 else ""
    species = " 0" if version == 3 else ""
    rows = "".join(
        f"{head}{x} {y} {z} 1 2 3 {r} 0 0 0 4 5 6 {0.0 if k == 3 else 0.5} 1{species}\n"
        for k, (x, y, z, r) in enumerate(SPHERES)
    )
    path = tmp_path / "old.restart"
    path.write_text(
        f"restart_version {version}\nname old\nxmin 0 xmax 10 ymin 0 ymax 10 zmin 0 zmax 10\n"
        "dt 0.1 t 3 tmax 4 save_count 5\ndim 3 gravity 0 0 -1\nSpecies 1\nk 1 rho 1\n"
        "Walls 1\nnumFiniteWalls 0 normal 0 0 -1 position 1.7\n"
        "WallsPeriodic 1\nnormal 1 0 0 pos_left 0 pos_right 10 shift 10 0 0\n"
        f"Particles {len(SPHERES)}\n{rows}FixedParticles 0\n"
    )
    packing = granufab.read(path).frames[0].packing
    assert packing.contacts is None and packing.time == 3.0 and packing.cell is not None
    assert packing.cell.periodic == (True, False, False)
    assert packing.grains.count == 3, "a grain of infinite mass is a wall"
    assert packing.grains.velocity is not None and packing.grains.spin is not None
    assert packing.grains.velocity[0].tolist() == [1, 2, 3]
    assert packing.grains.spin[0].tolist() == [4, 5, 6]
    kept = granufab.read(path, walls=True).frames[0].packing.grains
    assert kept.count == 4 and kept.mass is None
    assert measure(packing, criterion="gap:0.0", z_definition="z")["contact_count"] == 2


def test_lees_edwards_restarts_strain(tmp_path: Path) -> None:
    """One disk at the lower edge, one at the upper: they touch at the shifted image only."""
    paths = []
    for k, shift in enumerate((43.0, 44.0)):
        path = tmp_path / f"le.restart.{k}"
        rows = "".join(
            f"BaseParticle id {i} position {x} {y} 0 velocity 0 0 0 angularVelocity 0 0 0 "
            "radius 0.6 invMass 1\n"
            for i, (x, y) in enumerate(((5.0 + shift - 40.0, 9.6), (5.0, 0.5)))
        )
        path.write_text(
            "MercuryDPM 0.14 name le\nxMin 0 xMax 10 yMin 0 yMax 10 zMin 0 zMax 1\n"
            f"time {k}\nsystemDimensions 2 particleDimensions 2\nBoundaries 1\n"
            f"LeesEdwardsBoundary id 0 left 0 right 10 down 0 up 10 shift {shift} vel 1\n"
            f"Particles 2\n{rows}Interactions 1\n"
            "Law particleIds 0 1 timeStamp 1 force 0 -1 0 torque 0 0 0\n"
        )
        paths.append(path)
    run = granufab.read(*paths)
    for k in (0, 1):
        packing = run.frames[k].packing
        assert packing.cell is not None and packing.contacts is not None
        assert packing.cell.matrix.tolist() == [[10.0, 3.0 + k], [0.0, 10.0]]
        assert np.allclose(packing.contacts.branch, [[0.0, 0.9]])
    # Simple shear by γ = 0.1: the logarithmic strains are ± asinh(γ / 2).
    assert run.frames[1].eps_q == pytest.approx(2 * np.arcsinh(0.05), rel=1e-9)


def _data_2d(folder: Path) -> tuple[Path, Path]:
    """Frames at t = 0, 1, 2, 3 (the first empty); contacts at 0, 1, 3, with a wall."""
    data, fstat = folder / "a.data", folder / "a.fstat"
    rows, listed = ["0 0 0 0 10 10 \n"], [_heads(0)]
    for t in (1, 2, 3):
        x = 3.9 + 0.01 * t
        rows.append(f"3 {t} 0 0 10 10 \n")
        rows.append(f"2 5 0.1 0.2 1 0 0 0\n{x} 5 0 0 1 0 0.5 0\n9.3 1 0 0 1 0 0 0\n")
        if t != 2:
            end = f"{(2 + x) / 2} 5 0 {4 - x} 0 7 2"
            listed.append(_heads(t))
            listed.append(f"{t} 0 1 {end} -1 0 0 0 1 0\n{t} 1 0 {end} 1 -0 -0 -0 -1 -0\n")
            listed.append(f"{t} 2 -3 9.3 0 0 0.01 0 5 0 0 -1 -0 -0 -0 -0\n")
    data.write_text("".join(rows))
    fstat.write_text("".join(listed))
    return data, fstat


def _heads(time: float) -> str:
    return f"# {time} 1\n# 0 0 0 10 10 10\n# 1 1 0 0 0 0\n"


def test_data_and_fstat_are_matched_by_time(tmp_path: Path) -> None:
    run = granufab.read(*_data_2d(tmp_path))
    assert [run.frames[k].packing.time for k in range(len(run.frames))] == [1.0, 3.0]
    packing = run.frames[1].packing
    contacts = packing.contacts
    assert packing.dimension == 2 and contacts is not None and contacts.gap is not None
    assert contacts.pair.tolist() == [[0, 1]] and contacts.gap[0] == pytest.approx(-0.07)
    assert contacts.force is not None, "on 0 act −7 along x and 2 along y"
    assert np.allclose(contacts.normal, [[1, 0]]) and np.allclose(contacts.force, [[7, -2]])
    assert packing.grains.spin is not None and packing.grains.spin[:, 0].tolist() == [0, 0.5, 0]
    summary = run.frames.summary  # type: ignore[union-attr]
    assert (summary.duplicates_dropped, summary.wall_contacts_dropped) == (2, 2)
    alone = granufab.read(tmp_path / "a.data")
    assert len(alone.frames) == 3 and alone.frames[0].packing.contacts is None
    with pytest.raises(MissingData, match=r"a\.fstat.*give the \.data file"):
        granufab.read(tmp_path / "a.fstat")


def test_data_of_three_dimensions_find_the_periodic_axis(tmp_path: Path) -> None:
    data, fstat = tmp_path / "b.data", tmp_path / "b.fstat"
    rows = "".join(f"{x} {y} {z} 0 0 0 {r} 0 0 0 1 2 3 0\n" for x, y, z, r in SPHERES)
    data.write_text(f"4 0.5 0 0 0 10 10 10\n{rows}")
    lines = ""
    for i, j in PAIRS:
        branch = np.subtract(SPHERES[j][:3], SPHERES[i][:3])
        branch -= EDGE * np.rint(branch / EDGE)
        n = -branch / np.linalg.norm(branch)
        for a, b, sense in ((i, j, 1), (j, i, -1)):
            lines += (
                f"0.1 {a} {b} 0 0 0 0.1 0 3 0 {sense * n[0]} {sense * n[1]} {sense * n[2]} 0 0 0\n"
            )
    fstat.write_text(_heads(0.5) + lines)
    packing = granufab.read(data, fstat).frames[0].packing
    assert packing.cell is not None and packing.cell.periodic == (True, False, False)
    assert packing.contacts is not None and packing.contacts.branch is not None
    length = np.linalg.norm(packing.contacts.branch, axis=1)
    assert np.allclose(length, [1.9, 1.9, 1.8])
    assert measure(packing, z_definition="z")["z"] == 1.5


def test_numbers_that_contradict_the_file_are_named(tmp_path: Path) -> None:
    path = _restart(tmp_path / "x.restart")
    path.write_text(path.read_text().replace("Particles 4", "Particles 40000000000"))
    with pytest.raises(CorruptFile, match=r"line 11: announces 40000000000 particles"):
        granufab.read(path)
    data, fstat = _data_2d(tmp_path)
    fstat.write_text(fstat.read_text().replace("1 0 1 ", "1 0 8 "))
    with pytest.raises(CorruptFile, match=r"a\.fstat: t = 1: line 7: grain j is 8.*0\.\.2"):
        granufab.read(data, fstat)


def test_mangled_files(tmp_path: Path) -> None:
    restart = _restart(tmp_path / "new.restart")
    check_truncations(restart, lambda: granufab.read(restart, format="mercury_restart"))
    refused = check_mutations(restart, lambda: granufab.read(restart, format="mercury_restart"))
    assert refused > 20
    data, fstat = _data_2d(tmp_path)
    assert check_truncations(data, lambda: granufab.read(data, format="mercury")) > 20
    for path in (data, fstat):
        check_mutations(path, lambda: granufab.read(data, fstat, format="mercury"), count=150)


def test_simple_shear_sample() -> None:
    run = granufab.read(sample("mercurydpm", "SimpleShearIniSelfTest.restart"))
    packing = run.frames[0].packing
    assert packing.contacts is not None and packing.contacts.gap is not None
    assert (packing.grains.count, packing.contacts.count) == (4096, 6513)
    values = measure(packing, criterion="listed", z_definition="z")
    assert values["z"] == pytest.approx(3.180, abs=5e-4)
    assert packing.contacts.gap.max() < 0, "every listed pair overlaps at its minimum image"


def test_polydisperse_insertion_sample() -> None:
    """Each frame against the file's own lines: f_n, overlap and normals of the pairs i < j."""
    name = "PolydisperseInsertionBoundarySelfTest"
    data, fstat = sample("mercurydpm", f"{name}.data"), sample("mercurydpm", f"{name}.fstat")
    run = granufab.read(data, fstat)
    listed: dict[float, list[list[float]]] = {}
    for words in map(str.split, fstat.read_text().splitlines()):
        if words[0] == "#" and len(words) == 3:
            rows = listed.setdefault(float(words[1]), [])
        elif words[0] != "#" and 0 <= int(words[1]) < int(words[2]):
            rows.append([float(word) for word in words])
    assert len(run.frames) == 25 and len(listed) == 26
    for k in (0, 24):
        packing = run.frames[k].packing
        contacts, rows = packing.contacts, np.array(listed[packing.time or 0.0])
        assert contacts is not None and contacts.force is not None and contacts.gap is not None
        assert np.array_equal(np.sort(contacts.pair, axis=1), rows[:, 1:3])
        assert np.allclose(contacts.gap, -rows[:, 6])
        branch = packing.grains.position[contacts.pair[:, 1]]
        branch = branch - packing.grains.position[contacts.pair[:, 0]]
        unit = branch / np.linalg.norm(branch, axis=1)[:, None]
        assert np.allclose(contacts.normal, unit, atol=1e-9)
        along = np.einsum("ci,ci->c", contacts.force, contacts.normal)
        assert np.allclose(along, rows[:, 8])
