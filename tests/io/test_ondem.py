"""ON-DEM VTKHDF: the samples' known answers, signs of the normal force, walls, damage."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from foreign_samples import sample

import granufab


def _file(path: Path, sign: float, *, overlap: bool = True, said: str = "") -> Path:
    """Two spheres and a wall in the draft's layout; squeezed, with a virtual pair."""
    with h5py.File(path, "w") as file:
        file["VTKHDF/Points"] = np.array([[0, 0, 1.0], [0, 0, 2.9], [0, 3.0, 1]])
        file["VTKHDF/PointData/radius"] = np.ones(3)
        file["VTKHDF/PointData/body_id"] = np.array([4, 9, 2], np.int32)
        file["ONDEM/Bodies/Walls/body_id"] = np.array([0], np.int32)
        file["ONDEM/Interactions/id1"] = np.array([0, 4, 4], np.int32)
        file["ONDEM/Interactions/id2"] = np.array([4, 9, 2], np.int32)
        file["ONDEM/Interactions/normal"] = np.array([[0, 0, 1.0], [0, 0, 1], [0, 1, 0]])
        file["ONDEM/Interactions/normal_force"] = sign * np.array([7.0, 5.0, 0.0])
        file["ONDEM/Interactions/shear_force"] = np.array([[0, 0, 0], [0.5, 0, 0], [0, 0, 0]])
        file["ONDEM/Interactions/virtual"] = np.array([0, 0, 1], np.int8)
        if overlap:
            file["ONDEM/Interactions/overlap"] = np.array([0.0, 0.1, -1.0])
        if said:
            file["ONDEM/Interactions/normal_force"].attrs["positive_in"] = said
        file["ONDEM/Scene/gravity"] = np.zeros(3)
        file["ONDEM/Scene"].attrs["time"] = 0.25
    return path


@pytest.mark.parametrize(
    ("sign", "overlap", "said"),
    [(1.0, True, ""), (-1.0, True, ""), (-1.0, False, ""), (1.0, False, "compression")],
)
def test_the_force_on_the_second_sphere(
    tmp_path: Path, sign: float, overlap: bool, said: str
) -> None:
    run = granufab.read(_file(tmp_path / "a.vtkhdf", sign, overlap=overlap, said=said))
    packing = run.frames[0].packing
    assert packing.contacts is not None
    assert packing.grains.number[packing.contacts.pair].tolist() == [[4, 9]]
    np.testing.assert_allclose(packing.contacts.force, [[0.5, 0.0, 5.0]])
    np.testing.assert_allclose(packing.contacts.gap, [-0.1])
    assert packing.time == 0.25


def test_the_sample_of_36_spheres() -> None:
    path = sample("ondem_vtkhdf", "testing_test_box_spheres.vtkhdf")
    packing = granufab.read(path).frames[0].packing
    with h5py.File(path) as file:
        spheres = file["VTKHDF/PointData/body_id"][:]
        pair = np.column_stack([file[f"ONDEM/Interactions/{name}"][:] for name in ("id1", "id2")])
        both = np.isin(pair, spheres).all(axis=1)
        force = file["ONDEM/Interactions/normal_force"][:]
        weight = 9.81 * file["VTKHDF/PointData/mass"][:]
    assert (packing.grains.count, len(pair), int(both.sum())) == (36, 36, 27)
    assert packing.contacts is not None
    assert packing.contacts.force is not None
    assert packing.contacts.count == 27
    along = np.einsum("ci,ci->c", packing.contacts.force, packing.contacts.normal)
    np.testing.assert_allclose(along, force[both], rtol=1e-12)
    # Columns of four spheres: each contact carries what lies on it.
    np.testing.assert_allclose(np.unique(along.round(6)), (weight[0] * np.arange(1, 4)).round(6))
    gap = packing.contacts.branch
    assert gap is not None
    distance = np.linalg.norm(gap, axis=1) - packing.grains.radius[packing.contacts.pair].sum(1)
    np.testing.assert_allclose(packing.contacts.gap, distance, atol=1e-14)


def test_the_sample_of_5_spheres_on_a_wall() -> None:
    run = granufab.read(sample("ondem_vtkhdf", "test_5spheres.vtkhdf"), dimension=3)
    packing = run.frames[0].packing
    assert packing.grains.count == 5
    assert packing.contacts is not None
    assert packing.contacts.count == 0


def test_more_declared_than_stored(tmp_path: Path) -> None:
    path = _file(tmp_path / "a.vtkhdf", 1.0)
    with h5py.File(path, "a") as file:
        del file["VTKHDF/PointData/radius"]
        file.create_dataset("VTKHDF/PointData/radius", (2**40,), "f8", chunks=(1024,))
    with pytest.raises(granufab.GranufabError, match=r"a\.vtkhdf.*radius declares"):
        granufab.read(path)
    with h5py.File(path, "a") as file:
        del file["VTKHDF/PointData/radius"]
        file["VTKHDF/PointData/radius"] = h5py.ExternalLink("/etc/hostname", "/a")
    with pytest.raises(granufab.GranufabError, match="give --radius"):
        granufab.read(path)
