"""Rockable conf files: driven walls, spheres and sphero-polyhedra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample
from mangling import check_mutations, check_truncations

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import measure

SHAPES = """<
name Wall
radius 0.1
volume 8
nv 4
1 1 0
>
<
name Ball
radius 0.5
nv 1
0 0 0
>
<
name Cube
radius 0.01
volume 4.1887902047863905
nv 8
>
"""


def _row(shape: str, x: float, y: float, z: float, scale: float = 1.0) -> str:
    return f"{shape} 0 0 {scale} {x} {y} {z} 1 2 3 0 0 0 1 0 0 0 4 5 6 0 0 0\n"


def _contact(i: int, j: int, kind: int, parts: str, n: str, dn: float, push: float) -> str:
    return f"{i} {j} {kind} {parts} {n} {dn} 0 0 0 0 0 0 {push} 0 0 0.5 0 0 0 0\n"


def _conf(folder: Path, name: str = "conf0", shape: str = "Ball", time: float = 1.5) -> Path:
    """A driven wall and three bodies in a row along x; the last two touch at two vertices."""
    (folder / "my.shp").write_text(SHAPES)
    bodies = [("Wall", 0.0, 1.0), (shape, 0.45, 1.0), (shape, 1.4, 1.0), (shape, 2.35, 2.0)]
    text = (
        f"Rockable 21-08-2022\nt {time}\ndensity 0 6\nnDriven 1\nshapeFile /else/where/my.shp\n"
        "precision 6\nParticles 4\n#name group cluster homothety\n"
        + "".join(_row(name, x, 0, 0, scale) for name, x, scale in bodies)
        + "Interactions 4\n"
        + _contact(1, 0, 2, "0 0", "1 0 0", -0.05, 9)
        + _contact(1, 2, 0, "0 0", "-1 0 0", -0.05, 2)
        + _contact(2, 3, 0, "0 0", "-1 0 0", -0.01, 3)
        + _contact(3, 2, 1, "1 4", "1 0 0", -0.01, 4)
        + "Interfaces 0\n"
    )
    (folder / name).write_text(text)
    return folder / name


def test_bodies_and_contacts(tmp_path: Path) -> None:
    run = granufab.read(_conf(tmp_path))
    packing = run.frames[0].packing
    contacts, grains = packing.contacts, packing.grains
    assert contacts is not None and contacts.force is not None and contacts.gap is not None
    assert packing.time == 1.5 and grains.radius.tolist() == [0.5, 0.5, 1.0]
    assert grains.mass is not None and grains.velocity is not None and grains.spin is not None
    assert np.allclose(grains.mass, np.pi * np.array([1, 1, 8]))
    assert grains.velocity[0].tolist() == [1, 2, 3] and grains.spin[0].tolist() == [4, 5, 6]
    assert contacts.pair.tolist() == [[0, 1], [1, 2], [2, 1]], "each part that touches counts"
    assert contacts.gap.tolist() == [-0.05, -0.01, -0.01]
    # Forces act on i along n, from j to i: on j the other way.
    assert np.allclose(contacts.force, [[2, 0, -0.5], [3, 0, -0.5], [-4, 0, -0.5]])
    assert np.allclose(contacts.normal, [[1, 0, 0], [1, 0, 0], [-1, 0, 0]])
    summary = run.frames.summary  # type: ignore[union-attr]
    assert (summary.walls_dropped, summary.wall_contacts_dropped) == (1, 1)


def test_a_part_listed_from_both_sides_counts_once(tmp_path: Path) -> None:
    path = _conf(tmp_path)
    twin = _contact(2, 1, 0, "0 0", "1 0 0", -0.05, 2)
    text = path.read_text().replace("Interactions 4\n", f"Interactions 5\n{twin}")
    path.write_text(text)
    packing = granufab.read(path).frames[0].packing
    assert packing.contacts is not None and packing.contacts.count == 3


def test_polyhedra_have_the_radius_of_equal_volume(tmp_path: Path) -> None:
    packing = granufab.read(_conf(tmp_path, shape="Cube")).frames[0].packing
    assert np.allclose(packing.grains.radius, [1, 1, 2])


def test_a_folder_is_a_series_and_shapes_are_sought(tmp_path: Path) -> None:
    for k in (10, 2):
        _conf(tmp_path, f"conf{k}", time=float(k))
    run = granufab.read(tmp_path)
    assert [run.frames[k].packing.time for k in (0, 1)] == [2.0, 10.0]
    (tmp_path / "my.shp").rename(tmp_path / "a.shp")
    assert "a.shp" in granufab.read(tmp_path / "conf2").frames.summary.notes[0]  # type: ignore[union-attr]
    (tmp_path / "a.shp").rename(tmp_path / "a.txt")
    with pytest.raises(MissingData, match=r"conf2: its shapes are in my\.shp"):
        granufab.read(tmp_path / "conf2")


def test_mangled_files(tmp_path: Path) -> None:
    path = _conf(tmp_path)
    check_truncations(path, lambda: granufab.read(path, format="rockable"))
    assert check_mutations(path, lambda: granufab.read(path, format="rockable")) > 20
    check_truncations(tmp_path / "my.shp", lambda: granufab.read(path), count=50)
    check_mutations(tmp_path / "my.shp", lambda: granufab.read(path), count=100)
    path.write_text(path.read_text().replace("Interactions 4", "Interactions 99999999"))
    with pytest.raises(CorruptFile, match="announces 99999999 interactions"):
        granufab.read(path)


def test_regression_sample() -> None:
    """512 spheres of 6 walls; every interaction is with a wall, so gaps give the grains'."""
    name = "regression_512_particles_LawDefault_noPeriodicity.conf"
    path = sample("rockable", name)
    run = granufab.read(path)
    packing = run.frames[0].packing
    summary = run.frames.summary  # type: ignore[union-attr]
    assert (packing.grains.count, summary.walls_dropped) == (512, 6)
    assert packing.contacts is not None
    assert packing.contacts.count + summary.wall_contacts_dropped == 192
    rows = [line.split() for line in path.read_text().splitlines()]
    inner = [row for row in rows if len(row) == 23 and row[0].isdigit() and int(row[1]) > 5]
    assert packing.contacts.count == len(inner) == 0
    assert np.allclose(packing.grains.radius, 0.43640601)
    assert packing.grains.mass is not None
    assert np.allclose(packing.grains.mass, 2e-5 * 3.4814549352253138e-01, rtol=1e-6)
    x = np.array([[float(w) for w in row[4:7]] for row in rows if row[:1] == ["SPHERE0"]])
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)[np.triu_indices(512, 1)]
    touching = int((apart < 2 * 0.43640601).sum())
    values = measure(packing, criterion="gap:0.15", z_definition="z")
    near = int((apart < 2 * 0.43640601 * 1.15).sum())
    assert touching == 0 and values["contact_count"] == near > 500
