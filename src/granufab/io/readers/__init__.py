"""Readers of other programs' data, one module a format; the first that recognises a file wins."""

from __future__ import annotations

from importlib import import_module

from granufab.io.foreign_format import ForeignFormat

__all__ = ["READERS", "foreign_formats"]

READERS: tuple[str, ...] = (
    "mercury_restart",
    "mercury_data",
    "rigidlib",
    "pegs",
    "rockable",
    "exadem",
    "ondem_vtkhdf",
    "lmgc90_hdf5",
    "lmgc90_text",
    "vtk_xml",
    "gsd",
    "extxyz",
    "spam_text",
    "lammps_dump",
    "lammps_data",
    "liggghts_vtk",
    "yade_text",
    "ct_labels",
    "csv_table",
)
"""Modules of this package with a ``FORMAT``, the more specific ones first."""


def foreign_formats() -> tuple[ForeignFormat, ...]:
    """All formats, in the order in which they are tried."""
    return tuple(import_module(f"{__name__}.{name}").FORMAT for name in READERS)
