"""Label images of tomography (or photographs): every voxel holds the number of its grain.

Grains are the labels above 0: centroids, and radii of spheres (disks) of the same volume.
Lengths are in voxels and the axes are those of the array. Contacts and normals carry the noise
of the image: surfaces up to one voxel apart are listed, and normals of small contacts lean
towards the axes of the image. Several images are several states, in the order given.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError, MissingData
from granufab.io.foreign_format import ForeignFormat
from granufab.io.found import FoundContacts, FoundFrame, LazyFrames, Source
from granufab.io.label_contacts import FEWEST_FACES, label_contacts, label_grains
from granufab.io.read_options import ReadOptions

__all__ = ["FORMAT"]

NOTES = (
    "lengths are in voxels; axes x, y, z are the first, second, third of the array",
    "touching labels are contacts: surfaces up to one voxel apart are among them, so z is too high",
    f"normals are fitted to the shared faces (fewer than {FEWEST_FACES}: between the centroids) "
    "and lean towards the axes of the image where contacts are small",
)
_DAMAGED = (
    *(ValueError, OSError, EOFError, KeyError, MemoryError, SyntaxError, TypeError),
    *(OverflowError, NotImplementedError, zipfile.BadZipFile, zlib.error, TokenError),
)
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def _matches(path: Path, head: bytes) -> bool:
    if path.suffix == ".npy":
        return head.startswith(b"\x93NUMPY")
    if path.suffix == ".npz":
        return head.startswith(b"PK\x03\x04") and b"label" in head[:64].lower()
    return path.suffix.lower() in (".tif", ".tiff") and head.startswith(_TIFF)


def _image(path: Path) -> NDArray:
    """The labels; .npy files stay on the disk."""
    try:
        image = _tiff(path) if path.suffix.lower().startswith(".tif") else _numpy(path)
    except GranufabError:
        raise
    except _DAMAGED as error:
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise CorruptFile(f"{path}: the label image cannot be read ({reason})") from None
    if image.ndim not in (2, 3) or image.size == 0:
        raise CorruptFile(f"{path}: a label image has 2 or 3 axes, got shape {image.shape}")
    if image.dtype.kind not in "iu":
        raise CorruptFile(
            f"{path}: a label image holds whole numbers, one for each grain, got {image.dtype}"
        )
    return image.view(image.dtype.str.replace("u", "i")) if image.dtype.itemsize == 8 else image


def _numpy(path: Path) -> NDArray:
    if path.suffix == ".npy":
        return np.load(path, mmap_mode="r", allow_pickle=False)
    with np.load(path, allow_pickle=False) as archive:
        names = [name for name in archive.files if "label" in name.lower()] or archive.files
        if not names:
            raise ValueError("it holds no array")
        return archive[names[0]]


def _tiff(path: Path) -> NDArray:
    try:
        tifffile: Any = import_module("tifffile")
    except ImportError:
        raise MissingData(
            f"{path}: TIFF images need the package tifffile; install granufab[ct]"
        ) from None
    try:
        return np.squeeze(tifffile.imread(path))
    except Exception as error:  # damaged images end that library in many ways
        raise ValueError(str(error) or type(error).__name__) from None


def _frame(path: Path) -> FoundFrame:
    image = _image(path)
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
