"""Label images in files of numpy and in TIFF: whole numbers in 2 or 3 axes."""

from __future__ import annotations

import logging
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granufab.errors import CorruptFile, GranufabError, MissingData
from granufab.io.checked_hdf5 import LARGEST_RATIO
from granufab.io.npz_arrays import BROKEN_ARRAYS, archived_array, mapped_array

__all__ = ["label_image"]

_UNCOMPRESSED = 1


def label_image(path: Path) -> NDArray:
    """The labels, signed; .npy files stay on the disk.

    Raises:
        CorruptFile: the file is damaged, or holds no image of whole numbers.
        MissingData: it is TIFF, and what reads that is not installed.
    """
    try:
        image = _tiff(path) if path.suffix.lower().startswith(".tif") else _numpy(path)
    except GranufabError:
        raise
    except BROKEN_ARRAYS as error:
        reason = " ".join((str(error) or type(error).__name__).split())[:120]
        raise CorruptFile(
            f"{path}: the label image of {path.stat().st_size} bytes cannot be read ({reason})"
        ) from None
    if image.ndim not in (2, 3) or image.size == 0:
        raise CorruptFile(f"{path}: header: a label image has 2 or 3 axes, got shape {image.shape}")
    if image.dtype.kind not in "iu":
        raise CorruptFile(
            f"{path}: header: a label image holds whole numbers, one for each grain, got "
            f"{image.dtype}"
        )
    return image.view(image.dtype.str.replace("u", "i")) if image.dtype.itemsize == 8 else image


def _numpy(path: Path) -> NDArray:
    if path.suffix == ".npy":
        return mapped_array(path)
    with zipfile.ZipFile(path) as archive:
        files = [name for name in archive.namelist() if name.endswith(".npy")]
        names = [name for name in files if "label" in name.lower()] or files
        if not names:
            raise ValueError("it holds no array")
        return archived_array(archive, names[0])


def _tiff(path: Path) -> NDArray:
    try:
        tifffile: Any = import_module("tifffile")
    except ImportError:
        raise MissingData(
            f"{path}: TIFF images need the package tifffile; install granufab[ct]"
        ) from None
    try:
        with _listened() as said, tifffile.TiffFile(path) as file:
            series = file.series[0]
            packed = series.keyframe.compression != _UNCOMPRESSED
            most = path.stat().st_size * (LARGEST_RATIO if packed else 1)
            if series.size * series.dtype.itemsize > most:
                raise ValueError(f"it declares {series.size} voxels that are not stored")
            image = np.squeeze(series.asarray())
    except Exception as error:  # damaged images end that library in many ways
        raise ValueError(str(error) or type(error).__name__) from None
    lost = [text for text in said if "TiffPages" in text]
    if lost:  # it would go on with the pages before
        raise ValueError(lost[0])
    return image


@contextmanager
def _listened() -> Iterator[list[str]]:
    """What the library says in its log, which else goes to the screen."""
    said: list[str] = []

    class Listener(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    log, listener = logging.getLogger("tifffile"), Listener(logging.WARNING)
    passed, log.propagate = log.propagate, False
    log.addHandler(listener)
    try:
        yield said
    finally:
        log.removeHandler(listener)
        log.propagate = passed
