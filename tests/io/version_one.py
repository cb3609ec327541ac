"""Turn a run file into one of schema version 1: no checksums, text of variable length."""

from __future__ import annotations

from pathlib import Path

import h5py

TEXTS = ("format", "created", "settings", "provenance")
ADDED = ("frames/checksum", "series/checksum", "summary_checksum")


def make_version_one(path: Path) -> None:
    """Remove what version 2 has added; the rest of the layout is the same."""
    with h5py.File(path, "r+") as file:
        for name in ADDED:
            if name in file:
                del file[name]
        del file.attrs["checksum"]
        file.attrs["schema_version"] = 1
        for name in TEXTS:
            text = file.attrs[name].decode()
            del file.attrs[name]
            file.attrs[name] = text
