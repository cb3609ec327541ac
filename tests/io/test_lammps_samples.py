"""LAMMPS' and LIGGGHTS' own files: fabric against LAMMPS' compute fabric, coordination numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample

import granufab
from granufab.fabric import fabric_tensor, select_contacts
from granufab.fabric.criterion import mean_diameter


def _thermo(log: Path, run: int) -> dict[int, list[float]]:
    """Rows of the run-th table of a log, by step."""
    table = log.read_text().split("   Step ")[run + 1].split("Loop time")[0]
    rows = [[float(word) for word in line.split()] for line in table.splitlines()[1:]]
    return {int(row[0]): row[1:] for row in rows if row}


def _last_column_sums(dump: Path) -> dict[int, float]:
    """Sum of the last column of each frame: contact/atom."""
    frames = dump.read_text().split("ITEM: TIMESTEP\n")[1:]
    sums = {}
    for frame in frames:
        rows = frame.split("ITEM: ATOMS")[1].splitlines()[1:]
        sums[int(frame.split()[0])] = sum(float(row.split()[-1]) for row in rows)
    return sums


def test_fabric_is_what_lammps_computes() -> None:
    """C = (15/2)(F − I/3) to 1e-5 undeformed and 1e-3 sheared: its box lags by a step."""
    atoms, local = sample("lammps", "atoms.dump"), sample("lammps", "contacts.dump")
    thermo = _thermo(sample("lammps", "log.lammps"), 2)
    touching = _last_column_sums(atoms)
    run = granufab.read(atoms, local)
    assert len(run.frames) == len(thermo) == 9
    for k, (step, row) in enumerate(thermo.items()):
        frame = run.frames[k]
        found = frame.packing.contacts
        assert found is not None
        assert str(step) in frame.packing.source
        assert 2 * found.count == touching[step] == row[7] * frame.packing.grains.count
        tensor = 7.5 * (fabric_tensor(found) - np.eye(3) / 3)
        tolerance = 1e-5 if k == 0 else 1e-3
        assert tensor[[0, 1, 2, 0], [0, 1, 2, 1]] == pytest.approx(row[9:13], abs=tolerance)


def test_stress_is_what_lammps_computes() -> None:
    """Also the tangential forces, told from the nameless columns: pressures and shear stress."""
    atoms, local = sample("lammps", "atoms.dump"), sample("lammps", "contacts.dump")
    thermo = _thermo(sample("lammps", "log.lammps"), 2)
    run = granufab.read(atoms, local)
    notes = " ".join(run.frames.summary.notes)  # type: ignore[attr-defined]
    assert "i = c_pr[1], j = c_pr[2], fx = c_pl[3]" in notes
    assert "ftx = c_pl[6], fty = c_pl[7], ftz = c_pl[8]" in notes
    for k, row in enumerate(thermo.values()):
        stress = run.frames[k].stress
        assert np.diag(stress) == pytest.approx(row[1:4], rel=1e-5 if k == 0 else 1e-3)
        # Sheared, the dump's damping across the moving boundary is not that of the step.
        assert stress[1, 0] == pytest.approx(row[4], abs=(1e-3 if k == 0 else 0.02) * row[0])
    map_ = "index i j dist force fx fy fz ftx fty ftz ft"
    told = granufab.read(atoms, local, columns={"contacts": {"order": map_}})
    assert told.frames[8].stress == pytest.approx(run.frames[8].stress, rel=1e-12)


def test_shear_strain_of_the_box() -> None:
    run = granufab.read(sample("lammps", "atoms.dump"), sample("lammps", "contacts.dump"))
    stretch = np.log(np.linalg.svd(np.array([[1, 2.9952 / 9.36], [0, 1]]))[1])
    assert run.frames[8].eps_q == pytest.approx(np.ptp(stretch), rel=1e-9)


def test_liggghts_pile() -> None:
    """z of 22410 spheres: 5.072 at zero tolerance, 5.116 at 2e-6."""
    run = granufab.read(sample("liggghts", "azamat_liggghts_test.particles"))
    packing = run.frames[0].packing
    assert packing.grains.count == 22410
    for tolerance, wanted in ((0.0, 5.072), (2e-6, 5.116)):
        gap = tolerance / mean_diameter(packing)
        pairs = select_contacts(packing, f"gap:{gap!r}")
        assert 2 * pairs.count / packing.grains.count == pytest.approx(wanted, abs=5e-4)


def test_liggghts_vtk() -> None:
    """Positions, radii and ids against the words of the file."""
    path = sample("liggghts", "cohesion_48000.vtk")
    packing = granufab.read(path, cell=(0.1, 0.1, 0.1), periodic="").frames[0].packing
    text = path.read_text()

    def words(begin: str, end: str) -> np.ndarray:
        found = re.search(re.escape(begin) + r"\n(.*?)" + re.escape(end), text, re.DOTALL)
        assert found is not None
        return np.array([float(word) for word in found[1].split()])

    grains = packing.grains
    assert grains.count == 1000
    assert grains.position.ravel() == pytest.approx(words("POINTS 1000 float", "VERTICES"), rel=0)
    assert (grains.radius == words("radius 1 1000 double", "omega")).all()
    assert grains.number is not None
    assert (grains.number == words("id 1 1000 int", "type")).all()
    assert grains.velocity is not None
    assert (grains.velocity.ravel() == words("v 3 1000 double", "f 3")).all()
    near = np.linalg.norm(grains.position[:, None] - grains.position[None], axis=2)
    near -= grains.radius[:, None] + grains.radius[None]
    touching = int((near < 0).sum() - 1000)
    assert 2 * select_contacts(packing, "gap:0").count == touching > 1000
