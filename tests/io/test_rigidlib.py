"""RigidLibrary folders: sheared periodic frames, the offset of the upper image, the balance."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from foreign_samples import sample

import granufab
from granufab.errors import CorruptFile, MissingData
from granufab.fabric import balance, measure

EDGE, RATE, EVERY, FIRST = 20.0, 1e-3, 100.0, 7
"""The offset of frame k is EDGE·RATE·EVERY·k = 2 k."""


def _folder(folder: Path, *, parameters: bool = True, frames: int = 3) -> Path:
    """Three disks of radius 1: 0 and 1 touch inside, 2 touches 0 across the upper edge."""
    folder.mkdir(exist_ok=True)
    (folder / "posinit.dat").write_text("0 0 0 1.0\n1 0 0 1.0\n2 0 0 1.0\n")
    for k in range(FIRST, FIRST + frames):
        offset = EDGE * RATE * EVERY * k
        low = np.array([1.0, -9.5])
        high = low + np.array([offset - 0.6 * 1.9, EDGE - 0.8 * 1.9])
        high[0] -= EDGE * np.rint(high[0] / EDGE)
        inside = low + np.array([1.8, 0.0])
        rows = [(*low, 2), (*inside, 1), (*high, 1)]
        (folder / f"PosVel{k}.dat").write_text(
            "".join(f"{x} {y} 0 0.1 0.2 0.3 {count}\n" for x, y, count in rows)
        )
        (folder / f"Contact{k}.dat").write_text(
            "1 0 -1 0 0 0.2 0.01 0.02\n2 0 0.6 0.8 1 0.1 -0.04 0.01\n"
        )
    if parameters:
        (folder / "Parameters_final.dat").write_text(
            f"np 3\ntprint {EVERY}\nboxVec1x {EDGE}\nboxVec2y {EDGE}\nBCtype Periodic_Edwards\n"
            f"strain_rate {RATE}\nmu 0.5\n"
        )
    return folder


@pytest.mark.parametrize("parameters", [True, False])
def test_the_offset_is_found(tmp_path: Path, parameters: bool) -> None:
    folder = _folder(tmp_path / "sim", parameters=parameters)
    run = granufab.read(folder) if parameters else granufab.read(folder, cell=(EDGE, EDGE))
    assert len(run.frames) == 3
    for k in range(3):
        packing = run.frames[k].packing
        contacts, cell = packing.contacts, packing.cell
        assert contacts is not None and cell is not None and contacts.force is not None
        # Frame 7 has moved by 14, which is −6 with one whole width taken away.
        assert np.allclose(cell.matrix, [[EDGE, -6.0 + 2 * k], [0, EDGE]], atol=1e-9)
        assert contacts.branch is not None
        assert np.allclose(contacts.branch, [[-1.8, 0], [0.6 * 1.9, 0.8 * 1.9]])
        # On 0: f_n n − f_t t with t = (−n_y, n_x).
        assert np.allclose(contacts.force, [[-0.2, 0.03], [0.06 - 0.03 * 0.8, 0.08 + 0.03 * 0.6]])
        assert measure(packing, z_definition="z")["z"] == pytest.approx(4 / 3)
        assert packing.time == (pytest.approx((FIRST + k) * EVERY) if parameters else None)
    assert run.frames[2].eps_q == pytest.approx(2 * np.arcsinh(0.1), rel=1e-9)


def test_what_lacks_is_named(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "sim", parameters=False)
    with pytest.raises(MissingData, match="give --cell LX,LY"):
        granufab.read(folder)
    with pytest.raises(MissingData, match=r"posinit\.dat, which has the radii"):
        granufab.read(folder / "PosVel7.dat")
    (folder / "Contact8.dat").write_text("1 0 -1 0 0 0.2 0.01 0.02\n")
    with pytest.raises(CorruptFile, match=r"Contact8\.dat: ends with row 1, .*count 2"):
        _ = granufab.read(folder, cell=(EDGE, EDGE)).frames[1]


def test_an_impossible_offset_is_refused(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "sim", frames=1)
    rows = (folder / "PosVel7.dat").read_text().splitlines()
    x, _, *rest = rows[2].split()
    rows[2] = " ".join((x, "7.0", *rest))
    (folder / "PosVel7.dat").write_text("\n".join(rows) + "\n")
    with pytest.raises(CorruptFile, match=r"PosVel7\.dat.*do not touch at any offset"):
        granufab.read(folder)


def _listed(folder: Path, k: int) -> tuple[np.ndarray, np.ndarray]:
    table = np.loadtxt(folder / f"Contact{k}.dat")
    return table[:, :2].astype(int), table[:, 2:4]


def test_data_sim_sample() -> None:
    folder = sample("rigidlib", "DataSim")
    run = granufab.read(folder)
    assert len(run.frames) == 11 and run.frames[0].packing.grains.count == 1024
    before = None
    for k in range(11):
        frame = run.frames[k]
        values = measure(frame.packing, criterion="listed", z_definition="z")
        assert 3.7635 <= float(values["z"] or 0) <= 3.7735
        assert 0.178 <= float(values["a"] or 0) < 0.1855
        assert 134.5 <= float(values["theta_c"] or 0) < 136.5
        assert frame.eps_q == pytest.approx(1e-4 * k, rel=1e-3, abs=1e-12)
        contacts = frame.packing.contacts
        assert contacts is not None and contacts.gap is not None and contacts.branch is not None
        # k_rep = 1: the overlap at the minimum image is the listed normal force.
        force = np.loadtxt(folder / f"Contact{5000 + k}.dat", usecols=5)
        assert np.abs(contacts.gap + force).max() < 1e-4
        pair, normal = _listed(folder, 5000 + k)
        assert np.array_equal(pair, contacts.pair)
        unit = contacts.branch / np.linalg.norm(contacts.branch, axis=1)[:, None]
        assert np.abs(unit - normal).max() < 1e-4
        now = {(min(i, j), max(i, j)) for i, j in pair.tolist()}
        if before is not None:
            counted = balance(run.frames[k - 1], frame, criterion="listed")
            assert int(counted["gained"]) == len(now - before) <= 4
            assert int(counted["lost"]) == len(before - now) <= 4
        before = now


def test_data_sim_forces_balance() -> None:
    """The sense of the tangential forces: with it, the forces on a grain cancel."""
    packing = granufab.read(sample("rigidlib", "DataSim")).frames[0].packing
    contacts = packing.contacts
    assert contacts is not None and contacts.force is not None
    net = np.zeros((1024, 2))
    np.add.at(net, contacts.pair[:, 1], contacts.force)
    np.add.at(net, contacts.pair[:, 0], -contacts.force)
    typical = np.linalg.norm(contacts.force, axis=1).mean()
    assert np.median(np.linalg.norm(net, axis=1)) < 1e-4 * typical


def test_data_sim_without_parameters(tmp_path: Path) -> None:
    """The contacts alone give the offset that the strain rate gives."""
    for name in ("posinit.dat", "PosVel5005.dat", "Contact5005.dat"):
        shutil.copy(sample("rigidlib", "DataSim", name), tmp_path / name)
    cell = granufab.read(tmp_path, cell=(62.7755, 62.7755)).frames[0].packing.cell
    assert cell is not None
    assert cell.matrix[0, 1] % 62.7755 == pytest.approx(62.7755 * 0.5005, abs=1e-4)
