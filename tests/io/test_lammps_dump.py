"""Dumps of atoms and contacts: written here, compared with the numbers they were written from."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from lammps_text import Lattice, atoms_text, contacts, lattice, local_text

import granufab
from granufab.errors import CorruptFile, InvalidSettings, MissingData
from granufab.packing import Packing


def _write(folder: Path, states: list[Lattice]) -> tuple[Path, Path]:
    atoms, local = folder / "atoms.dump", folder / "contacts.dump"
    atoms.write_text("".join(atoms_text(state) for state in states))
    local.write_text("".join(local_text(state, contacts(state)) for state in states))
    return atoms, local


def _same_grains(packing: Packing, state: Lattice, digits: float = 1e-12) -> None:
    """Positions up to lattice vectors, radii and identities."""
    assert packing.grains.number is not None
    assert packing.grains.number.tolist() == state.number.tolist()
    turns = np.linalg.solve(state.matrix, (packing.grains.position - state.position).T)
    assert np.abs(turns - np.rint(turns)).max() < digits
    assert packing.grains.radius == pytest.approx(state.radius, rel=1e-14)


def test_grains_and_contacts_are_what_was_written(tmp_path: Path) -> None:
    states = [lattice(100, 0.0), lattice(200, 0.1), lattice(300, 0.2)]
    run = granufab.read(*_write(tmp_path, states))
    assert len(run.frames) == 3
    for k, state in enumerate(states):
        packing = run.frames[k].packing
        rows = np.array(contacts(state))
        _same_grains(packing, state)
        assert packing.cell is not None
        assert packing.cell.matrix == pytest.approx(state.matrix, abs=1e-12)
        found = packing.contacts
        assert found is not None
        assert found.count == len(rows) > 150
        assert packing.grains.number is not None
        pair = packing.grains.number[found.pair]
        assert sorted(map(tuple, pair.tolist())) == sorted(map(tuple, rows[:, :2].tolist()))
        assert found.force == pytest.approx(-(rows[:, 3:6] + rows[:, 6:9]), rel=1e-12)
        assert found.gap == pytest.approx(
            rows[:, 2] - packing.grains.radius[found.pair].sum(axis=1), abs=1e-12
        )
        assert np.einsum("ci,ci->c", found.force, found.normal).min() > 0


def _stretches(tilt: float) -> np.ndarray:
    """Logarithms of the stretches from the lattice without tilt to the one with it."""
    deformation = lattice(0, tilt).matrix @ np.linalg.inv(lattice(0, 0.0).matrix)
    return np.log(np.linalg.svd(deformation)[1])


def test_strain_follows_the_box(tmp_path: Path) -> None:
    run = granufab.read(*_write(tmp_path, [lattice(k, 0.1 * k) for k in range(3)]))
    for k in range(3):
        contraction = np.linalg.eigvalsh(-run.frames[k].strain)[::-1]
        assert contraction == pytest.approx(_stretches(0.1 * k), abs=1e-10)
    assert run.frames[2].eps_q == pytest.approx(np.ptp(_stretches(0.2)), rel=1e-9)


def test_a_flipped_box_strains_on(tmp_path: Path) -> None:
    """Beyond a tilt of 1/2 the box is written with the tilt less one: the lattice is the same."""
    path, tilts = tmp_path / "flip.dump", [0.0, 0.3, 0.45, 0.65, 0.9, 1.3]
    flipped = [lattice(k, tilt - round(tilt)) for k, tilt in enumerate(tilts)]
    path.write_text("".join(atoms_text(state) for state in flipped))
    run = granufab.read(path)
    for k, tilt in enumerate(tilts):
        largest = np.linalg.eigvalsh(-run.frames[k].strain)[2]
        assert largest == pytest.approx(_stretches(tilt)[0], abs=1e-9)
        cell = run.frames[k].packing.cell
        assert cell is not None
        assert cell.matrix == pytest.approx(flipped[k].matrix, abs=1e-12)


@pytest.mark.parametrize("kind", ["x", "xu", "xs", "xsu"])
def test_each_kind_of_coordinates(tmp_path: Path, kind: str) -> None:
    state = lattice(5, 0.25)
    path = tmp_path / "a.dump"
    path.write_text(atoms_text(state, kind))
    _same_grains(granufab.read(path).frames[0].packing, state)


def test_a_general_triclinic_box(tmp_path: Path) -> None:
    turned, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    turned *= np.sign(np.linalg.det(turned))
    flat = lattice(7, 0.2)
    state = Lattice(7, turned @ flat.matrix, flat.origin, flat.fraction, flat.radius, flat.number)
    lines = np.column_stack([state.matrix.T, state.origin]).tolist()
    text = "\n".join(" ".join(repr(x) for x in line) for line in lines)
    box = f"ITEM: BOX BOUNDS abc origin pp pp pp\n{text}\n"
    path = tmp_path / "general.dump"
    for kind in ("x", "xs"):
        path.write_text(atoms_text(state, kind, box=box))
        packing = granufab.read(path).frames[0].packing
        _same_grains(packing, state)
        assert packing.cell is not None
        assert packing.cell.matrix == pytest.approx(state.matrix, abs=1e-12)


def test_atoms_alone_touch_by_gap(tmp_path: Path) -> None:
    from granufab.fabric import select_contacts

    state = lattice(1, 0.1)
    path = tmp_path / "a.dump"
    path.write_text(atoms_text(state))
    run = granufab.read(path)
    assert run.frames[0].packing.contacts is None
    found = select_contacts(run.frames[0].packing, "gap:0")
    assert found.count == len(contacts(state))


def test_boundaries(tmp_path: Path) -> None:
    """pp repeats, f is a wall where it stands, s only follows the grains."""
    generator = np.random.default_rng(0)
    rows = generator.uniform(0, 10, (40, 3))
    body = "".join(f"{k} {x!r} {y!r} {z!r} 0.1\n" for k, (x, y, z) in enumerate(rows.tolist(), 1))

    def frame(flags: str, top: float) -> str:
        return (
            f"ITEM: TIMESTEP\n{top:.0f}\nITEM: NUMBER OF ATOMS\n40\n"
            f"ITEM: BOX BOUNDS {flags}\n0 10\n-1 11\n0 {top!r}\nITEM: ATOMS id x y z radius\n{body}"
        )

    path = tmp_path / "a.dump"
    path.write_text(frame("pp ff ss", 10.0) + frame("pp ff ss", 12.0))
    run = granufab.read(path)
    cell = run.frames[0].packing.cell
    assert cell is not None
    assert cell.origin is not None
    assert cell.periodic == (True, False, False)
    assert np.diag(cell.matrix)[:2] == pytest.approx([10, 12])
    assert cell.origin[2] == pytest.approx(rows[:, 2].min() - 0.1)
    assert cell.matrix[2, 2] == pytest.approx(np.ptp(rows[:, 2]) + 0.2)
    assert np.isnan(run.frames[1].eps_q), "the height of loose grains is no strain"
    path.write_text(frame("mm ss fs", 10.0))
    assert granufab.read(path).frames[0].packing.cell is None
    path.write_text(frame("", 10.0))
    with pytest.raises(MissingData, match=r"a\.dump: step 10: .*give --periodic"):
        granufab.read(path)
    cell = granufab.read(path, periodic="xz").frames[0].packing.cell
    assert cell is not None
    assert cell.periodic == (True, False, True)


def test_pairs_that_do_not_touch_are_told(tmp_path: Path) -> None:
    """As from computes without ``cutoff radius``: neighbours at the diagonals are listed too."""
    state = lattice(1)
    wide = Lattice(1, state.matrix, state.origin, state.fraction, 1.45 * state.radius, state.number)
    atoms, local = tmp_path / "a.dump", tmp_path / "c.dump"
    atoms.write_text(atoms_text(state))
    local.write_text(local_text(state, contacts(wide)))
    order = {"contacts": {"order": "index i j dist fx fy fz ftx fty ftz"}}
    run = granufab.read(atoms, local, columns=order)
    share = 1 - len(contacts(state)) / len(contacts(wide))
    assert share > 0.5
    text = run.frames.summary.conventions["listed pairs"]  # type: ignore[attr-defined]
    assert text.startswith(f"{100 * share:.0f} % do not touch")


def test_frames_are_matched_by_step(tmp_path: Path) -> None:
    states = [lattice(k, 0.05 * k) for k in range(5)]
    atoms, local = tmp_path / "atoms", tmp_path / "local"
    atoms.write_text("".join(atoms_text(states[k]) for k in (0, 1, 2, 4)))
    local.write_text("".join(local_text(states[k], contacts(states[k])) for k in (1, 3, 4)))
    run = granufab.read(local, atoms)
    tilts = [run.frames[k].packing.cell.matrix[0, 1] for k in range(len(run.frames))]  # type: ignore[union-attr]
    assert tilts == pytest.approx([states[k].matrix[0, 1] for k in (1, 4)])
    assert any(
        "2 frames of grains without contacts, 1 frames" in n for n in run.frames.summary.notes
    )  # type: ignore[attr-defined]
    local.write_text(local_text(states[3], contacts(states[3])))
    with pytest.raises(MissingData, match=r"steps 0\.\.4.*3\.\.3: no step is in both"):
        granufab.read(atoms, local)
    with pytest.raises(MissingData, match="contacts without their grains"):
        granufab.read(local)


def test_one_file_a_frame_is_sorted_by_step(tmp_path: Path) -> None:
    paths = []
    for k in (10, 9, 100):
        paths.append(tmp_path / f"dump.{k}")
        paths[-1].write_text(atoms_text(lattice(k, k / 1000)))
    run = granufab.read(*paths)
    tilts = [run.frames[k].packing.cell.matrix[0, 1] for k in range(3)]  # type: ignore[union-attr]
    assert tilts == sorted(tilts)


def test_empty_frames_are_passed_over(tmp_path: Path) -> None:
    state = lattice(3)
    empty = atoms_text(state).replace("\n64\n", "\n0\n").split("ITEM: ATOMS")[0]
    empty += "ITEM: ATOMS type x y z id diameter vx vy vz\n"
    path = tmp_path / "a.dump"
    path.write_text(empty + atoms_text(state) + empty + atoms_text(state))
    run = granufab.read(path)
    assert len(run.frames) == 2
    assert run.frames.summary.empty_frames == 1  # type: ignore[attr-defined]
    _same_grains(run.frames[1].packing, state)
    path.write_text(empty)
    with pytest.raises(MissingData, match=r"a\.dump: no frame of this data has grains"):
        granufab.read(path)


def test_time_and_units_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.dump"
    timed = "ITEM: TIME\n{}\n"
    path.write_text(
        "ITEM: UNITS\nlj\n" + timed.format(0.5) + atoms_text(lattice(1)) + timed.format(0.75)
        + atoms_text(lattice(2))
    )  # fmt: skip
    run = granufab.read(path)
    assert [run.frames[k].packing.time for k in (0, 1)] == [0.5, 0.75]


def test_nameless_columns_that_say_nothing_name_the_remedy(tmp_path: Path) -> None:
    """Too few contacts to recognise; the user's map in three ways gives the same."""
    state = lattice(1)
    rows = contacts(state)[:3]
    atoms, local = tmp_path / "a.dump", tmp_path / "c.dump"
    atoms.write_text(atoms_text(state))
    local.write_text(local_text(state, rows))
    with pytest.raises(MissingData, match=r'c\.dump: line 9: .*i = "c_p\[1\]", j = "c_p\[2\]"'):
        granufab.read(atoms, local)
    names = {"i": "c_p[1]", "j": 3} | {f"f{x}": f"c_l[{k}]" for k, x in enumerate("xyz", 2)}
    names |= {f"ft{x}": k for k, x in enumerate("xyz", 8)}
    order = {"order": "index i j dist fx fy fz ftx fty ftz"}
    wanted = -(np.array(rows)[:, 3:6] + np.array(rows)[:, 6:9])
    for columns in (names, order):
        run = granufab.read(atoms, local, columns={"contacts": columns})
        found = run.frames[0].packing.contacts
        assert found is not None
        assert found.force == pytest.approx(wanted, rel=1e-12)
    local.write_text(local_text(state, rows, "index id1 id2 dist fx fy fz ftx fty ftz"))
    found = granufab.read(atoms, local).frames[0].packing.contacts
    assert found is not None
    assert found.force == pytest.approx(wanted, rel=1e-12)
    for wrong, match in (
        ({"order": "i j"}, "gives 2 columns, but the file has 10"),
        ({"i": "c_q"}, "'c_q', which is not among index"),
        ({"i": 11}, "allowed: 1..10"),
        ({"what": 1}, "contacts.what is unknown, allowed: i, j"),
    ):
        with pytest.raises(InvalidSettings, match=match):
            granufab.read(atoms, local, columns={"contacts": wrong})


def test_liggghts_pair_gran_local(tmp_path: Path) -> None:
    """pos 6, vel 6, id 2 + periodic, force 3, torque 3, history 2, contactPoint 3."""
    state = lattice(1, 0.1)
    rows, generator = contacts(state), np.random.default_rng(2)
    text = local_text(state, [], "").replace("ENTRIES\n0", f"ENTRIES\n{len(rows)}")
    text = text.split("ITEM: ENTRIES ")[0] + "ITEM: ENTRIES "
    text += " ".join(f"c_fc[{k}]" for k in range(1, 27)) + " \n"
    for i, j, _, *f in rows:
        force = np.array(f[:3]) + f[3:]
        row = [*generator.normal(size=12), i, j, 0, *force, *generator.normal(size=8)]
        text += " ".join(f"{value:.15g}" for value in row) + " \n"
    atoms, local = tmp_path / "a.dump", tmp_path / "fc.dump"
    atoms.write_text(atoms_text(state))
    local.write_text(text)
    columns = {"contacts": {"order": "pos vel id force torque history contactPoint"}}
    found = granufab.read(atoms, local, columns=columns).frames[0].packing.contacts
    assert found is not None
    wanted = -np.array([np.array(f[:3]) + f[3:] for _, _, _, *f in rows])
    assert found.force == pytest.approx(wanted, rel=1e-12)


def test_disks_in_a_flat_box(tmp_path: Path) -> None:
    """A square lattice of touching disks: z = 4, two force columns, all z zero."""
    side, atoms, local = 6, tmp_path / "a.dump", tmp_path / "c.dump"
    head = (
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF {}\n{}\nITEM: BOX BOUNDS pp pp pp\n0 6\n0 6\n-0.5 0.5\n"
    )
    text = head.format("ATOMS", 36) + "ITEM: ATOMS id radius x y z omegax omegay omegaz\n"
    rows = []
    for k in range(36):
        i, j = divmod(k, side)
        text += f"{k + 1} {0.51 + 0.001 * (k % 5)} {i} {j} 0 0 0 {k}\n"
        rows.append((k + 1, ((i + 1) % side) * side + j + 1, -3.0 - k, 0.0))
        rows.append((k + 1, i * side + (j + 1) % side + 1, 0.0, -7.0))
    atoms.write_text(text)
    local.write_text(
        head.format("ENTRIES", 72) + "ITEM: ENTRIES c_1[1] c_1[2] c_2[1] c_2[2]\n"
        + "".join(" ".join(map(str, row)) + "\n" for row in rows)
    )  # fmt: skip
    packing = granufab.read(atoms, local).frames[0].packing
    assert packing.dimension == 2
    assert packing.contacts is not None
    assert packing.contacts.count == 72
    assert packing.grains.spin is not None
    assert packing.grains.spin[:, 0].tolist() == list(range(36))
    stress = granufab.measure(packing)
    mean = (sum(3.0 + k for k in range(36)) + 36 * 7.0) / 2 / 36
    assert stress["p"] == pytest.approx(mean)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("ITEM: ATOMS", "ITEM: GRAINS", "line 9: unknown 'ITEM: GRAINS type"),
        ("\n64\n", "\n65\n", "no complete frame up to .*, only step 1 with 64 of 65 rows"),
        ("\n64\n", "\n63\n", "step 1: 64 rows of ATOMS, the header says 63"),
        ("\n64\n", "\n9e9\n", "line 4: .* is '9e9', expected a whole number"),
        ("\n1 ", "\n1 x", "line 10: 'x.*' is not a number"),
        ("-1e-3", "", "line 10 has 8 columns, expected 9"),
        ("pp pp pp", "pp pq pp", "boundaries 'pp pq pp'"),
        ("type x y z", "type a b c", "no positions among the columns"),
        ("ITEM: TIMESTEP\n1\n", "ITEM: TIME\n1\n", "line 9: this frame has no ITEM: TIMESTEP"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, match: str) -> None:
    path = tmp_path / "a.dump"
    path.write_text(atoms_text(lattice(1)).replace(old, new, 1))
    with pytest.raises((CorruptFile, MissingData), match=r"a\.dump: .*" + match):
        granufab.read(path)


def test_two_atoms_of_one_id_are_refused(tmp_path: Path) -> None:
    state, path = lattice(1), tmp_path / "a.dump"
    state.number[1] = state.number[0]
    path.write_text(atoms_text(state))
    with pytest.raises(CorruptFile, match=f"body {state.number[0]} is listed more than once"):
        granufab.read(path)


def test_a_series_cut_off_gives_its_complete_frames(tmp_path: Path) -> None:
    atoms, local = _write(tmp_path, [lattice(k, 0.1 * k, side=3) for k in range(3)])
    text = local.read_text()
    local.write_text(text[:-3])
    run = granufab.read(atoms, local)
    assert len(run.frames) == 2
    assert any("left out at the end: step 2 with" in n for n in run.frames.summary.notes)  # type: ignore[attr-defined]


def test_a_count_that_the_file_cannot_hold_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "a.dump"
    for count in ("64000000", "9" * 18):
        text = atoms_text(lattice(1)).replace("\n64\n", f"\n{count}\n")
        path.write_text(text + atoms_text(lattice(2)))
        tracemalloc.start()
        with pytest.raises(CorruptFile, match=f"64 rows of ATOMS, the header says {count}"):
            granufab.read(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 2e6 + 4 * path.stat().st_size
