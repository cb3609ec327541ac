"""BODIES.DAT of LMGC90, which both of its formats need."""

from __future__ import annotations

from granufab.packing import Packing

__all__ = ["bodies", "fortran"]


def fortran(value: float) -> str:
    """A number as LMGC90 writes it."""
    return f"{value:.7E}".replace("E", "D").rjust(15)


def bodies(packing: Packing) -> str:
    """Records of the disks: material, reference position, radius."""
    text = "! File BODIES\n!\n"
    for k, (x, y) in enumerate(packing.grains.position):
        text += (
            f"$bdyty\n RBDY2  {k + 1:5d}\n$blmty\n PLAIN      1  behav  PLEXx  "
            f"avrd={fortran(0.5)}  gyrd={fortran(0.35)}\n$nodty\n NO3xx      1                "
            f"coo1={fortran(x)}  coo2={fortran(y)}  coo3={fortran(0)}\n$tacty\n"
            f" DISKx      1  color  BLEUx  byrd={fortran(packing.grains.radius[k])}\n"
            "$$$$$$\n      \n"
        )
    return text + "!-----\n"
