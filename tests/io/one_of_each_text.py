"""Ten grains in every format of text: small files for what must hold for all of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from one_of_each import COUNT, EDGE, PUSH, RADIUS, Example, Grid, Part, grid, row, rows

__all__ = ["TEXT", "fortran", "lmgc90_bodies"]


def _spam(folder: Path) -> Example:
    s = grid(3)
    (folder / "spheres.txt").write_text(
        f"##PERIODIC:: {EDGE} {EDGE} {EDGE}\n"
        + rows(row(k, "Sphere", s.position[k], s.radius[k]) for k in range(COUNT))
    )
    (folder / "contacts.txt").write_text(
        "# idA idB nx ny nz Fn uN cx cy cz\n"
        + rows(
            row(s.pair[c], s.normal[c], -s.push[c], -s.overlap[c], s.point[c])
            for c in range(len(s.pair))
        )
    )
    return Example(
        key="spam", folder=folder,
        parts=(Part(name="spheres.txt", number=f"{RADIUS}", counted=False),
               Part(name="contacts.txt", number=f"{PUSH}", counted=False)),
    )  # fmt: skip


def _yade(folder: Path) -> Example:
    s = grid(3)
    text = rows(row(s.position[k], s.radius[k]) for k in range(COUNT))
    (folder / "a.txt").write_text("#format x_y_z_r\n" + text)
    return Example(key="yade", folder=folder,
                   parts=(Part(name="a.txt", number=f"{RADIUS}", counted=False),))  # fmt: skip


_BOX = f"ITEM: BOX BOUNDS xy xz yz pp pp pp\n0 {EDGE + 1} 1\n0 {EDGE} 0\n0 {EDGE} 0\n"


def _dump(folder: Path, columns: str, local: Callable[[Grid, int], str]) -> tuple[Part, Part]:
    s = grid(3)
    heads = [f"ITEM: TIMESTEP\n{100 * t}\nITEM: NUMBER OF" for t in range(3)]
    (folder / "a.dump").write_text(
        rows(
            f"{head} ATOMS\n{COUNT}\n{_BOX}ITEM: ATOMS id type x y z radius vx\n"
            + rows(row(k + 1, 1, s.position[k] + 0.01 * t, s.radius[k], 0.5) for k in range(COUNT))
            for t, head in enumerate(heads)
        )
    )
    (folder / "c.dump").write_text(
        rows(
            f"{head} ENTRIES\n{len(s.pair)}\n{_BOX}ITEM: ENTRIES {columns}\n"
            + rows(local(s, c) for c in range(len(s.pair)))
            for head in heads
        )
    )
    return (
        Part(name="a.dump", number=f"{RADIUS}", counts=(r"ATOMS\n(\d+)\n",)),
        Part(name="c.dump", number="2.25", counts=(r"ENTRIES\n(\d+)\n",)),
    )


def _lammps_dump(folder: Path) -> Example:
    def local(s: Grid, c: int) -> str:
        force = -s.force[c]
        force[1] = 2.25 if c == 2 else force[1]
        return row(c + 1, s.pair[c] + 1, 1.0, force)

    parts = _dump(folder, "index c_p[1] c_p[2] c_l[1] c_l[2] c_l[3] c_l[4]", local)
    columns = {"contacts": {"order": "index i j dist fx fy fz"}}
    return Example(
        key="lammps_dump", folder=folder, parts=parts, series=True, options={"columns": columns}
    )


def _liggghts_local(folder: Path) -> Example:
    def local(s: Grid, c: int) -> str:
        i, j = s.pair[c]
        force = s.force[c].copy()
        force[1] = 2.25 if c == 2 else force[1]
        return row(s.position[i], s.position[j], i + 1, j + 1, 0, force, s.overlap[c])

    names = " ".join(f"c_1[{k}]" for k in range(1, 14))
    parts = _dump(folder, names, local)
    columns = {"contacts": {"order": "pos id force delta"}}
    return Example(
        key="lammps_dump", folder=folder, parts=parts, series=True, options={"columns": columns}
    )


def _lammps_data(folder: Path) -> Example:
    s = grid(3)
    (folder / "in.data").write_text(
        f"made by hand\n\n{COUNT} atoms\n1 atom types\n\n0 {EDGE} xlo xhi\n0 {EDGE} ylo yhi\n"
        f"0 {EDGE} zlo zhi\n0.5 0 0 xy xz yz\n\nAtoms # sphere\n\n"
        + rows(row(k + 1, 1, 2 * s.radius[k], 2.5, s.position[k]) for k in range(COUNT))
        + "\nVelocities\n\n"
        + rows(row(k + 1, 1, 2, 3, 0, 0, k) for k in range(COUNT))
    )
    part = Part(name="in.data", number=f"{2 * RADIUS}", counts=(r"(\d+) atoms\n",))
    return Example(key="lammps_data", folder=folder, parts=(part,))


def _mercury_restart(folder: Path) -> Example:
    s = grid(3)
    (folder / "a.restart").write_text(
        f"MercuryDPM 1.0 name test\nxMin 0 xMax {EDGE} yMin 0 yMax {EDGE} zMin 0 zMax {EDGE}\n"
        "timeStep 0.1 time 2.5 ntimeSteps 25 timeMax 9\nsystemDimensions 3 particleDimensions 3\n"
        "Boundaries 1\n"
        f"PeriodicBoundary id 0 normal 1 0 0 distanceLeft 0 distanceRight {EDGE} shift {EDGE} 0 0\n"
        f"Particles {COUNT}\n"
        + rows(
            row("BaseParticle id", k, "position", s.position[k], "velocity 0 0 1 angularVelocity",
                k, "0 0 radius", s.radius[k], "invMass 0.5")
            for k in range(COUNT)
        )
        + f"Interactions {len(s.pair)}\n"
        + rows(
            row("Law particleIds", s.pair[c], "timeStamp 1 contactPoint", s.point[c], "force",
                -s.force[c] if c != 2 else "-9.125 0 0", "torque 0 0 0")
            for c in range(len(s.pair))
        )
    )  # fmt: skip
    counts = (r"Particles (\d+)", r"Interactions (\d+)", r"Boundaries (\d+)")
    part = Part(name="a.restart", number=f"{RADIUS}", counts=counts)
    return Example(key="mercury_restart", folder=folder, parts=(part,))


def _mercury(folder: Path) -> Example:
    s = grid(3)
    data = fstat = ""
    for t in (1, 2, 3):
        data += f"{COUNT} {t} 0 0 0 {EDGE} {EDGE} {EDGE}\n"
        data += rows(
            row(s.position[k] + 0.01 * t, 0, 0, 0, s.radius[k], 0, 0, 0, 1, 2, 3, 0)
            for k in range(COUNT)
        )
        fstat += f"# {t} 1\n# 0 0 0 {EDGE} {EDGE} {EDGE}\n# 1 1 0 0 0 0\n"
        for c, (i, j) in enumerate(s.pair):
            for a, b, n in ((i, j, -s.normal[c]), (j, i, s.normal[c])):
                fstat += row(t, a, b, s.point[c], s.overlap[c], 0, s.push[c], 0, n, 0, 0, 0)
    (folder / "a.data").write_text(data)
    (folder / "a.fstat").write_text(fstat)
    return Example(
        key="mercury", folder=folder, series=True,
        parts=(Part(name="a.data", number=f"{RADIUS}", counts=(rf"({COUNT}) \d 0 0 0",)),
               Part(name="a.fstat", number=f"{PUSH}", counted=False)),
    )  # fmt: skip


def _rigidlib(folder: Path) -> Example:
    """Disk 0 also touches the image of disk 9 across the upper edge of a sheared box."""
    s, edge, names = grid(2), 20.0, []
    lowest, highest = 0, COUNT - 1
    (folder / "posinit.dat").write_text(rows(row(k, 0, 0, s.radius[k]) for k in range(COUNT)))
    for k in (7, 8):
        place = s.position.copy()
        place[:, 1] -= 0.5 * edge
        branch = np.array([0.6, 0.8]) * 0.95
        place[highest] = place[lowest] - branch + [edge * 1e-3 * 100 * k, edge]
        place[highest, 0] -= edge * np.rint(place[highest, 0] / edge)
        kept = (s.pair != highest).all(axis=1)
        count = np.bincount(s.pair[kept].ravel(), minlength=COUNT)
        count[[lowest, highest]] += 1
        (folder / f"PosVel{k}.dat").write_text(
            rows(row(place[g], 0, 0.1, 0.2, 0.3, count[g]) for g in range(COUNT))
        )
        (folder / f"Contact{k}.dat").write_text(
            rows(
                row(s.pair[c], s.normal[c], 0, s.push[c], 0.01, 0.02) for c in np.flatnonzero(kept)
            )
            + row(highest, lowest, 0.6, 0.8, 0, 5.5, 0, 0)
        )
        names += [f"PosVel{k}.dat", f"Contact{k}.dat"]
    (folder / "Parameters_final.dat").write_text(
        f"np {COUNT}\ntprint 100\nboxVec1x {edge}\nboxVec2y {edge}\nBCtype Periodic_Edwards\n"
        "strain_rate 0.001\nmu 0.5\n"
    )
    return Example(
        key="rigidlib", folder=folder, whole=True, series=True,
        parts=(Part(name="posinit.dat", number=f"{RADIUS}"),
               Part(name="PosVel7.dat", number=f"{s.position[4, 0]:.10g}"),
               Part(name="Contact7.dat", number=f"{PUSH}"),
               Part(name="Contact8.dat", number=f"{PUSH}"),
               Part(name="Parameters_final.dat", number=f"{edge}", counted=False)),
    )  # fmt: skip


def _pegs(folder: Path) -> Example:
    s = grid(2)
    (folder / "particle_positions.txt").write_text(
        rows(
            row(t, k + 1, s.position[k], s.radius[k], 0, mark=",")
            for t in (1, 2, 3)
            for k in range(COUNT)
        )
    )
    (folder / "Adjacency_list.txt").write_text(
        rows(
            row(t, s.pair[c] + 1, 0.25, s.push[c], mark=",")
            for t in (1, 2, 3)
            for c in range(len(s.pair))
        )
    )
    return Example(
        key="pegs", folder=folder, whole=True, series=True,
        parts=(Part(name="particle_positions.txt", number=f"{RADIUS}", counted=False),
               Part(name="Adjacency_list.txt", number=f"{PUSH}", counted=False)),
    )  # fmt: skip


def _rockable(folder: Path) -> Example:
    s = grid(3)
    (folder / "my.shp").write_text(
        "<\nname Wall\nradius 0.1\nvolume 8\nnv 4\n1 1 0\n>\n<\nname Ball\nradius 0.5\nnv 1\n"
        "0 0 0\n>\n"
    )
    (folder / "conf3").write_text(
        "Rockable 21-08-2022\nt 1.5\ndensity 0 6\nnDriven 1\nshapeFile my.shp\n"
        f"Particles {COUNT + 1}\n"
        + row("Wall 0 0 1 0 0 0", [0] * 6, 1, [0] * 9)
        + rows(
            row("Ball 0 0", 2 * s.radius[k], s.position[k], [0] * 6, 1, [0] * 9)
            for k in range(COUNT)
        )
        + f"Interactions {len(s.pair)}\n"
        + rows(
            row(s.pair[c] + 1, "0 0 0", -s.normal[c], -s.overlap[c], s.point[c], 0, 0, 0,
                s.push[c], [0.5, 0, 0], [0] * 4)
            for c in range(len(s.pair))
        )
    )  # fmt: skip
    return Example(
        key="rockable", folder=folder,
        parts=(Part(name="conf3", number=f"{2 * RADIUS}",
                    counts=(r"Particles (\d+)", r"Interactions (\d+)", r"nDriven (\d+)")),
               Part(name="my.shp", number="0.5", counts=(r"nv (\d+)",))),
    )  # fmt: skip


def _exadem(folder: Path) -> Example:
    s = grid(3)
    (folder / "dem_000000020.xyz").write_text(
        f'{COUNT}\nLattice="{EDGE} 0 0 0 {EDGE} 0 0 0 {EDGE}" Properties=species:S:1:pos:R:3:'
        'vel:R:3:mass:R:1:vrot:R:3:id:I:1:radius:R:1 Time=2 pbc="T F F"\n'
        + rows(
            row("XX", s.position[k], 1, 2, 3, 0.5, 4, 5, 6, k, s.radius[k]) for k in range(COUNT)
        )
    )
    (folder / "InteractionOutputDir-20_0.txt").write_text(
        rows(
            row(s.pair[c], 0, 0, 0, -s.overlap[c], s.point[c], -s.push[c] * s.normal[c],
                [0, 0, 0.5], s.position[s.pair[c]], mark=",")
            for c in range(len(s.pair))
        )
    )  # fmt: skip
    return Example(
        key="exadem", folder=folder,
        parts=(Part(name="dem_000000020.xyz", number=f"{RADIUS}",
                    counts=(r"^(\d+)\n", r"pos:R:(3)", r"radius:R:(1)")),
               Part(name="InteractionOutputDir-20_0.txt", number=f"{s.point[2, 1]:.10g}",
                    counted=False)),
    )  # fmt: skip


def fortran(value: float) -> str:
    """As LMGC90 writes it."""
    return f"{value:.7E}".replace("E", "D").rjust(15)


def lmgc90_bodies(path: Path) -> None:
    """BODIES.DAT of the disks and a wall."""
    s, text = grid(2), "! File BODIES\n!\n"
    for k, place in enumerate([*s.position, np.array([0.4, -0.6])]):
        shape = f" JONCx      1  color  DOWNx  ax1 ={fortran(2)}  ax2 ={fortran(0.1)}"
        if k < COUNT:
            shape = f" DISKx      1  color  BLEUx  byrd={fortran(s.radius[k])}"
        text += (
            f"$bdyty\n RBDY2  {k + 1:5d}\n$blmty\n PLAIN      1  behav  PLEXx  avrd={fortran(0.7)}"
            f"  gyrd={fortran(0.1)}\n$nodty\n NO3xx      1                coo1={fortran(place[0])}"
            f"  coo2={fortran(place[1])}  coo3={fortran(0)}\n$tacty\n{shape}\n$$$$$$\n      \n"
        )
    path.write_text(text + "!-----\n")


def _lmgc90(folder: Path) -> Example:
    s = grid(2)
    lmgc90_bodies(folder / "BODIES.DAT")
    dof, listed = "     \n! DOF\n     \n", "     \n! Vloc_Rloc\n      \n"
    for step in (7, 14):
        head = f"$steps {step:8d}              time={fortran(step * 0.1)}\n \n!-----\n"
        dof, listed = dof + head, listed + head
        for k in range(COUNT + 1):
            x = "  ".join(f"X({i})={fortran(0.01 * step)}" for i in (1, 2, 3))
            v = "  ".join(f"V({i})={fortran(0.1 * k)}" for i in (1, 2, 3))
            dof += (
                f"$bdyty\n RBDY2  {k + 1:5d}\n$nodty\n NO3xx      1                {x}\n{v}\n"
                "$$$$$$\n"
            )
        dof += "!-----\n"
        for c, (i, j) in enumerate(s.pair + 1):
            n = s.normal[c]
            listed += (
                f"$icdan  DKDKx {c + 1:8d}\n cdbdy  numbr  cdtac  numbr  behav  anbdy  numbr\n"
                f" RBDY2  {j:5d}  DISKx      1  rstc1  RBDY2  {i:5d}  DISKx      1  slibw    154\n"
                f"      rlt/H{fortran(0.25)}  rln/H{fortran(s.push[c])}  rls/H{fortran(0)}\n"
                f"      vlt ={fortran(0)}  vln ={fortran(0)}  vls ={fortran(0)}\n"
                f"      gapTT{fortran(-s.overlap[c])}\n"
                f"      n(1)={fortran(n[0])}  n(2)={fortran(n[1])}  n(3)={fortran(0)}\n"
                f"      coo1={fortran(0)}  coo2={fortran(0)}  coo3={fortran(0)}\n \n"
            )
    (folder / "DOF.INI").write_text(dof)
    (folder / "Vloc_Rloc.INI").write_text(listed)
    return Example(
        key="lmgc90", folder=folder, series=True,
        parts=(Part(name="BODIES.DAT", number=fortran(RADIUS).strip(), counts=(r"RBDY2 +(\d+)",)),
               Part(name="DOF.INI", number=fortran(0.07).strip()),
               Part(name="Vloc_Rloc.INI", number=fortran(PUSH).strip(), counted=False,
                    counts=(r"RBDY2 +(\d+)", r"icdan  DKDKx +(\d+)"))),
    )  # fmt: skip


def _extxyz(folder: Path) -> Example:
    s = grid(3)
    (folder / "a.xyz").write_text(
        rows(
            f'{COUNT}\nLattice="{EDGE} 0 0 1 {EDGE} 0 0 0 {EDGE}" Properties=species:S:1:pos:R:3:'
            f'radius:R:1:id:I:1 pbc="T T F" Time={t}\n'
            + rows(row("Si", s.position[k], s.radius[k], k) for k in range(COUNT))
            for t in (1, 2, 3)
        )
    )
    part = Part(
        name="a.xyz", number=f"{RADIUS}", counts=(r"^(\d+)\n", r"pos:R:(3)", r"radius:R:(1)")
    )
    return Example(key="extxyz", folder=folder, parts=(part,), series=True)


def _csv(folder: Path) -> Example:
    s = grid(3)
    (folder / "g.csv").write_text(
        "step,who,east,north,up,r\n"
        + rows(
            row(t, k, s.position[k], s.radius[k], mark=",") for t in (1, 2, 3) for k in range(COUNT)
        )
    )
    (folder / "c.csv").write_text(
        "step,i,j,fx,fy,fz\n"
        + rows(
            row(t, s.pair[c], s.force[c] if c != 2 else [9.125, 0, 0], mark=",")
            for t in (1, 2, 3)
            for c in range(len(s.pair))
        )
    )
    columns = {
        "grains": {"id": "who", "x": "east", "y": "north", "z": "up", "radius": 6},
        "conventions": {"compression": 1, "force_on": "second"},
    }
    return Example(
        key="csv", folder=folder, series=True, options={"columns": columns},
        parts=(Part(name="g.csv", number=f"{RADIUS}", counted=False),
               Part(name="c.csv", number="9.125", counted=False)),
    )  # fmt: skip


TEXT: dict[str, Callable[[Path], Example]] = {
    "spam": _spam,
    "yade": _yade,
    "lammps_dump": _lammps_dump,
    "liggghts_local": _liggghts_local,
    "lammps_data": _lammps_data,
    "mercury_restart": _mercury_restart,
    "mercury": _mercury,
    "rigidlib": _rigidlib,
    "pegs": _pegs,
    "rockable": _rockable,
    "exadem": _exadem,
    "lmgc90": _lmgc90,
    "extxyz": _extxyz,
    "csv": _csv,
}
