"""Give up an HDF5 file that can no longer be written, where the disk is full for example.

HDF5 tries again to write what it still holds when the file is closed and when the process ends,
and crashes there (HDF5 2.0: a segmentation fault). So its descriptor is first turned to the null
device: the file itself stays as if its writer had been killed, which readers expect.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress

import h5py

__all__ = ["FAULTS", "give_up", "reason_of"]

FAULTS = (OSError, RuntimeError, ValueError, KeyError, AttributeError)
"""What h5py raises where HDF5 cannot write: the kind depends on the call that found it."""


def give_up(file: h5py.File) -> None:
    """Close a file without writing to it."""
    with suppress(OSError, RuntimeError, ValueError, NotImplementedError):
        descriptor = file.id.get_vfd_handle()
        null = os.open(os.devnull, os.O_RDWR)
        try:
            os.dup2(null, descriptor, inheritable=False)
        finally:
            os.close(null)
    with suppress(OSError, RuntimeError):
        file.close()


def reason_of(error: Exception) -> str:
    """The system's words in a message of HDF5, else its first line."""
    found = re.search(r"error message = '([^']*)'", str(error))
    return found.group(1) if found else str(error).splitlines()[0]
