"""Label images: spheres of known contacts drawn in voxels are found again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from granufab import read
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import neighbours_within
from granufab.io import label_contacts as labels
from granufab.packing import Grains, Packing

RADIUS = 10.0
BOX = 120


def tree_of_spheres(count: int, box: int, gap: float, seed: int = 5) -> np.ndarray:
    """Centres of spheres, each of which touches one other and stays ``gap`` off the rest."""
    chance = np.random.default_rng(seed)
    centres = [np.full(3, box / 2)]
    while len(centres) < count:
        step = chance.normal(size=3)
        host = int(chance.integers(len(centres)))
        centre = centres[host] + 2 * RADIUS * step / np.linalg.norm(step)
        far = np.linalg.norm(np.array(centres) - centre, axis=1)
        far[host] = np.inf
        if (far > 2 * RADIUS + gap).all() and (np.abs(centre - box / 2) < box / 2 - 11).all():
            centres.append(centre)
    return np.array(centres)


def drawn(centres: np.ndarray, box: int) -> np.ndarray:
    """Voxels within the spheres, numbered from 1."""
    image = np.zeros((box,) * 3, np.uint16)
    grid = np.indices(image.shape).astype(np.float32)
    for number, centre in enumerate(centres, 1):
        distance = sum((grid[k] - centre[k]) ** 2 for k in range(3))
        image[distance < RADIUS**2] = number
    return image


@pytest.fixture(scope="module")
def sample() -> tuple[np.ndarray, np.ndarray]:
    centres = tree_of_spheres(40, BOX, gap=1.1)
    return centres, drawn(centres, BOX)


def test_spheres_and_contacts_come_back(sample, tmp_path: Path) -> None:
    centres, image = sample
    np.save(tmp_path / "labels.npy", image)
    run = read(tmp_path / "labels.npy")
    packing = run.frames[0].packing
    assert np.abs(packing.grains.position - centres).max() < 0.05  # voxels
    np.testing.assert_allclose(packing.grains.radius, RADIUS, rtol=5e-3)
    truth = neighbours_within(Packing(grains=Grains(
        position=centres, radius=np.full(len(centres), RADIUS))), 1e-9)  # fmt: skip
    contacts = packing.contacts
    assert contacts is not None
    assert set(map(tuple, contacts.pair.tolist())) == set(map(tuple, truth.pair.tolist()))
    assert truth.count == len(centres) - 1
    assert run.settings["record"]["criterion"] == "listed"
    # The noise of normals at a radius of 10 voxels, as the documentation states it.
    order = np.lexsort(truth.pair.T[::-1])
    mine = np.lexsort(contacts.pair.T[::-1])
    cosine = np.abs(np.einsum("ci,ci->c", truth.normal[order], contacts.normal[mine]))
    angle = np.degrees(np.arccos(np.minimum(cosine, 1)))
    assert 1.0 < angle.mean() < 6.0
    assert np.einsum("ci,ci->c", contacts.normal, contacts.branch).min() > 0


def test_touching_voxels_are_at_most_a_voxel_apart() -> None:
    """Contacts are over-detected up to a gap of one voxel and no further."""
    centres = tree_of_spheres(60, BOX, gap=0.2, seed=2)
    image = drawn(centres, BOX)
    grains = labels.label_grains(image)
    found = labels.label_contacts(image, grains)
    gap = np.linalg.norm(centres[found.second - 1] - centres[found.first - 1], axis=1) - 2 * RADIUS
    assert gap.max() <= 1.0
    assert (gap > 0.1).any()
    assert (gap < 1e-9).sum() == len(centres) - 1


@pytest.mark.parametrize("normal", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 0), (3, 2, 1)])
def test_a_flat_contact_has_its_plane(normal: tuple[int, ...]) -> None:
    """Two halves of a cube parted by a plane: the fitted normal leans by less than 3 degrees."""
    direction = np.array(normal) / np.linalg.norm(normal)
    height = np.tensordot(direction, np.indices((40, 40, 40)) - 19.37, axes=1)
    image = np.where(height < 0, 1, 2)
    found = labels.label_contacts(image, labels.label_grains(image))
    assert (found.first.tolist(), found.second.tolist()) == ([1], [2])
    assert np.degrees(np.arccos(min(1, abs(found.normal[0] @ direction)))) < 3


def test_slabs_change_nothing(sample, monkeypatch: pytest.MonkeyPatch) -> None:
    image = sample[1]
    whole = labels.label_contacts(image, labels.label_grains(image))
    monkeypatch.setattr(labels, "_SLAB_VOXELS", 3 * BOX * BOX)
    grains = labels.label_grains(image)
    parts = labels.label_contacts(image, grains)
    np.testing.assert_array_equal(parts.faces, whole.faces)
    np.testing.assert_allclose(parts.point, whole.point, atol=1e-9)
    # Counted once more, voxel by voxel.
    count = sum(
        int(((a != b) & (a > 0) & (b > 0)).sum())
        for a, b in (
            (np.delete(image, -1, k), np.delete(image, 0, k)) for k in range(3)
        )
    )  # fmt: skip
    assert parts.faces.sum() == count


def test_photographs_are_two_dimensional(tmp_path: Path) -> None:
    image = np.zeros((30, 40), np.int64)
    image[5:15, 5:25], image[15:25, 5:25], image[5:25, 28:38] = 4, 9, 2_000_000_000
    np.savez_compressed(tmp_path / "frame.npz", labels=image)
    packing = read(tmp_path / "frame.npz").frames[0].packing
    assert packing.dimension == 2
    assert packing.grains.number is not None
    assert packing.grains.number.tolist() == [4, 9, 2_000_000_000]
    np.testing.assert_allclose(packing.grains.radius, np.sqrt(200 / np.pi))
    assert packing.contacts is not None
    assert packing.contacts.pair.tolist() == [[0, 1]]
    np.testing.assert_allclose(packing.contacts.normal, [[1, 0]], atol=1e-12)


def test_tiff_images_need_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "labels.tif"
    path.write_bytes(b"II*\0" + bytes(60))
    monkeypatch.setitem(__import__("sys").modules, "tifffile", None)
    with pytest.raises(MissingData, match=r"install granufab\[ct\]"):
        read(path)


def test_tiff_images_are_the_same(sample, tmp_path: Path) -> None:
    tifffile = pytest.importorskip("tifffile", reason="granufab[ct] is not installed")
    tifffile.imwrite(tmp_path / "labels.tif", sample[1])
    np.save(tmp_path / "labels.npy", sample[1])
    one, other = (read(tmp_path / f"labels.{end}").frames[0].packing for end in ("tif", "npy"))
    np.testing.assert_array_equal(one.grains.position, other.grains.position)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.zeros((3, 3, 3)), "whole numbers"),
        (np.zeros(9, np.int32), "2 or 3 axes"),
    ],
)
def test_other_arrays_are_refused(tmp_path: Path, image: np.ndarray, words: str) -> None:
    np.save(tmp_path / "labels.npy", image)
    with pytest.raises(CorruptFile, match=words):
        read(tmp_path / "labels.npy")
