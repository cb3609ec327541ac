"""Plain texts of spheres: spam's pair of files and the text export of YADE."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import measure, select_contacts


def _spheres(path: Path) -> Path:
    path.write_text(
        "##PERIODIC:: 10 10 10\n"
        "4 Sphere 0.2 5 5 1.0\n7 Sphere 8.3 5 5 1.0\n9 Sphere 0.2 6.5 5 0.6\n5 Sphere 5 5 5 1\n"
    )
    return path


def _contacts(path: Path) -> Path:
    """4–7 touch through the face at x = 0; the stored shift says otherwise."""
    path.write_text(
        "# idA idB nx ny nz Fn uN cellDistX cellDistY cellDistZ \n"
        "4 7 -1 0 0 -2.5 -0.1 1 1 1\n9 4 0 -1 0 -1.5 -0.1 0 0 0\n"
    )
    return path


def test_a_small_pair_of_spam_files(tmp_path: Path) -> None:
    files = _spheres(tmp_path / "s.txt"), _contacts(tmp_path / "c.txt")
    for given in (files, files[::-1]):
        packing = granufab.read(*given).frames[0].packing
        contacts, cell = packing.contacts, packing.cell
        assert cell is not None and cell.periodic == (True, True, True)
        assert np.array_equal(cell.matrix, 10 * np.eye(3))
        assert contacts is not None and contacts.branch is not None
        np.testing.assert_allclose(contacts.branch, [[-1.9, 0, 0], [0, -1.5, 0]])
        np.testing.assert_allclose(contacts.force, [[-2.5, 0, 0], [0, -1.5, 0]])
        np.testing.assert_allclose(contacts.gap, [-0.1, -0.1], atol=1e-12)
    alone = granufab.read(files[0]).frames[0].packing
    assert alone.contacts is None
    assert measure(alone, criterion="gap:0.0", z_definition="z")["z"] == 1.0
    with pytest.raises(MissingData, match=r"c\.txt"):
        granufab.read(files[1])
    files[1].write_text(files[1].read_text().replace("9 4 0", "8 4 0"))
    with pytest.raises(CorruptFile, match=r"c\.txt: contact 1 joins body 8"):
        granufab.read(*files)


def test_the_spam_sample() -> None:
    """203 spheres, 337 contacts, z 3.320; branches are the normals; 438 pairs overlap."""
    spheres, listed = sample("spam_dem", "spheres.txt"), sample("spam_dem", "contacts.txt")
    packing = granufab.read(spheres, listed).frames[0].packing
    contacts = packing.contacts
    assert contacts is not None and contacts.branch is not None
    assert (packing.grains.count, contacts.count) == (203, 337)
    values = measure(packing, z_definition="z")
    assert values["z"] == pytest.approx(3.320, abs=5e-4)
    tensor = contacts.normal.T @ contacts.normal / 337
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), [0.3099, 0.3278, 0.3623], atol=5e-5)
    # The file's own lines, without the package: the listed normals and the nearest images.
    rows = np.loadtxt(listed)
    table = np.loadtxt(spheres, usecols=(0, 2, 3, 4, 5))
    edges = np.array([float(word) for word in spheres.read_text().split("\n")[0].split()[1:]])
    place = table[np.argsort(table[:, 0]), 1:4]
    pair = rows[:, :2].astype(int)
    apart = place[pair[:, 1]] - place[pair[:, 0]]
    branch = apart - edges * np.rint(apart / edges)
    unit = branch / np.linalg.norm(branch, axis=1)[:, None]
    assert np.abs(unit - rows[:, 2:5]).max() < 2e-5  # six digits of each
    np.testing.assert_allclose(contacts.branch, branch, atol=1e-15)
    assert (np.einsum("ci,ci->c", contacts.normal, unit) > 1 - 1e-9).all()
    assert np.abs(apart + edges * rows[:, 7:10] - branch).max() > 0.5 * edges.min()
    overlapping = select_contacts(packing, "gap:0.0")
    assert overlapping.count == 438
    ours, all_pairs = ({frozenset(p) for p in c.pair.tolist()} for c in (contacts, overlapping))
    assert len(ours) == 337 and ours < all_pairs


def test_yade_text(tmp_path: Path) -> None:
    path = tmp_path / "spheres.txt"
    path.write_text("#format x_y_z_r\n0\t0\t0\t1\n2.05\t0\t0\t1\n0\t1.45\t0\t0.5\n0\t0\t9\t1\n")
    packing = granufab.read(path).frames[0].packing
    assert packing.contacts is None and packing.cell is None
    assert packing.grains.radius.tolist() == [1, 1, 0.5, 1]
    pairs = [select_contacts(packing, f"gap:{gap}").pair.tolist() for gap in (0.0, 0.1)]
    assert pairs == [[[0, 2]], [[0, 1], [0, 2]]]


def test_yade_sample_of_100_spheres() -> None:
    path = sample("yade_text", "100spheres")
    packing = granufab.read(path).frames[0].packing
    table = np.loadtxt(path, usecols=(0, 1, 2, 3))
    assert packing.grains.count == len(table) == 100
    np.testing.assert_array_equal(packing.grains.position, table[:, :3])
    np.testing.assert_array_equal(packing.grains.radius, table[:, 3])
    apart = np.linalg.norm(table[:, None, :3] - table[None, :, :3], axis=2)
    gap = (apart - table[:, None, 3] - table[None, :, 3])[np.triu_indices(100, 1)]
    reach = 0.5 * 2 * table[:, 3].mean()
    values = measure(packing, criterion="gap:0.5", z_definition="z")
    assert values["z"] == 2 * (gap <= reach).sum() / 100 == pytest.approx(1.34)


def test_yade_like_sample_of_uniform_spheres() -> None:
    path = sample("spam_dem", "uniformSpheres.txt")
    packing = granufab.read(path).frames[0].packing
    assert (packing.grains.radius == 0.001).all()
    assert packing.grains.count == len(path.read_text().splitlines()) - 1
