"""A series in tables, as another program could leave it."""

from __future__ import annotations

from pathlib import Path

__all__ = ["CELL", "STEP", "sheared_squares"]

STEP = 0.02


def sheared_squares(folder: Path, frames: int = 24) -> tuple[Path, Path]:
    """A periodic 4 × 4 lattice of disks in tables; along y every fourth contact goes one by one."""
    grains, contacts = ["frame,id,x,y,r"], ["frame,i,j,fn,ft"]
    for frame in range(frames):
        for k in range(16):
            grains.append(f"{frame},{k + 1},{k // 4 + 0.5},{k % 4 + 0.5},0.5")
        for k in range(16):
            contacts.append(f"{frame},{k + 1},{(k + 4) % 16 + 1},-1,0")
            if k >= frame // 2:
                contacts.append(f"{frame},{k + 1},{k // 4 * 4 + (k + 1) % 4 + 1},-2,0.5")
    paths = (folder / "grains.csv", folder / "contacts.csv")
    for path, lines in zip(paths, (grains, contacts), strict=True):
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return paths


CELL = ("--cell", "0,0,4,4", "--periodic", "xy")
