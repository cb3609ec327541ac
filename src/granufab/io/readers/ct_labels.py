"""Label images of tomography (or photographs): every voxel holds the number of its grain.

Grains are the labels above 0: centroids, and radii of spheres (disks) of the same volume.
Lengths are in voxels and the axes are those of the array. Contacts and normals carry the noise
of the image: surfaces up to one voxel apart are listed, and normals of small contacts lean
towards the axes of the image. Several images are several states, in the order given.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.label_contacts import FEWEST_FACES, label_contacts, label_grains
from granufab.io.label_image import label_image
from granufab.io.read_options import ReadOptions

__all__ = ["FORMAT"]

NOTES = (
    "lengths are in voxels; axes x, y, z are the first, second, third of the array",
    "touching labels are contacts: surfaces up to one voxel apart are among them, so z is too high",
    f"normals are fitted to the shared faces (fewer than {FEWEST_FACES}: between the centroids) "
    "and lean towards the axes of the image where contacts are small",
)
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def _matches(path: Path, head: bytes) -> bool:
    if path.suffix == ".npy":
        return head.startswith(b"\x93NUMPY")
    if path.suffix == ".npz":
        return head.startswith(b"PK\x03\x04") and b"label" in head[:64].lower()
    return path.suffix.lower() in (".tif", ".tiff") and head.startswith(_TIFF)


def _frame(path: Path) -> FoundFrame:
    image = label_image(path)
    grains = label_grains(image)
    contacts = label_contacts(image, grains)
    scale: Any = 0.75 / np.pi if image.ndim == 3 else 1.0 / np.pi
    return FoundFrame(
        place=str(path),
        position=grains.position,
        radius=(scale * grains.size) ** (1.0 / image.ndim),
        number=grains.number,
        dimension=image.ndim,
        contacts=FoundContacts(
            first=contacts.first,
            second=contacts.second,
            normal=contacts.normal,
            point=contacts.point,
            normal_to=None,
        ),
        round=False,
    )


def _open(paths: Sequence[Path], options: ReadOptions) -> Source:
    return LazyFrames(count=len(paths), parse=lambda k: _frame(paths[k]), notes=NOTES)


FORMAT = ForeignFormat(key="labels", name="label image (CT)", matches=_matches, open=_open)
