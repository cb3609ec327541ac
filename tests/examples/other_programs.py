"""Files as other programs would leave them, of a run of ours, for the commands on the pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from granufab.history import Frame, Run

__all__ = ["write_dumps", "write_spam"]


def write_dumps(run: Run, folder: Path) -> None:
    """``atoms.dump`` and ``contacts.dump`` of LAMMPS, with every frame of a run of spheres."""
    atoms = "".join(_atoms(frame, step) for step, frame in enumerate(run.frames))
    contacts = "".join(_contacts(frame, step) for step, frame in enumerate(run.frames))
    (folder / "atoms.dump").write_text(atoms, encoding="utf-8")
    (folder / "contacts.dump").write_text(contacts, encoding="utf-8")


def _box(frame: Frame) -> str:
    cell = frame.packing.cell
    assert cell is not None
    edges = np.diag(cell.matrix)
    return "ITEM: BOX BOUNDS pp pp pp\n" + "".join(f"0 {float(edge)!r}\n" for edge in edges)


def _atoms(frame: Frame, step: int) -> str:
    grains = frame.packing.grains
    lines = [f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{grains.count}"]
    lines.append(_box(frame) + "ITEM: ATOMS id type x y z radius")
    for k, (place, radius) in enumerate(zip(grains.position, grains.radius, strict=True)):
        x, y, z = place.tolist()
        lines.append(f"{k + 1} 1 {x!r} {y!r} {z!r} {float(radius)!r}")
    return "\n".join(lines) + "\n"


def _contacts(frame: Frame, step: int) -> str:
    contacts = frame.packing.contacts
    assert contacts is not None
    assert contacts.force is not None
    lines = [f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{contacts.count}"]
    names = "patom1 patom2 dist fx fy fz"
    lines.append(_box(frame) + f"ITEM: ENTRIES {names}")
    length = np.linalg.norm(contacts.branch, axis=1)
    for (i, j), distance, force in zip(contacts.pair, length, contacts.force, strict=True):
        fx, fy, fz = (-force).tolist()  # on the first grain, as LAMMPS has it
        lines.append(f"{i + 1} {j + 1} {float(distance)!r} {fx!r} {fy!r} {fz!r}")
    return "\n".join(lines) + "\n"


def write_spam(run: Run, folder: Path) -> None:
    """``spheres.txt`` and ``contacts.txt`` of YADE's exports: the last frame, from 0."""
    from granufab.io import write

    write(run.frames[-1], folder / "spheres.txt")
