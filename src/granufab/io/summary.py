"""Text and JSON files, written whole or not at all."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granufab.errors import InvalidSettings

_FULL = {getattr(errno, name, -1) for name in ("ENOSPC", "EFBIG", "EDQUOT", "EIO")}

__all__ = ["json_text", "plain", "replacing", "write_json", "write_text"]


def plain(value: Any) -> Any:
    """Reduce a value to what strict JSON holds.

    numpy scalars and arrays become numbers and lists, records and mappings become dicts with
    text keys, paths become text, NaN and ±∞ become None.

    Raises:
        InvalidSettings: the value has no plain form.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    raise InvalidSettings(
        f"a {type(value).__name__} cannot be written as JSON; give numbers, text, lists, mappings"
    )


def json_text(data: Any) -> str:
    """``data`` as strict, indented JSON that ends in a newline (see :func:`plain`)."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Give a temporary path beside ``path`` and move it there once the block has succeeded.

    Missing folders are made. Where the block fails the temporary file is removed and what was
    at ``path`` stays.

    Raises:
        InvalidSettings: the folder or the file cannot be written.
        OSError: the disk is full or fails.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        if error.errno in _FULL and "cannot be written" in str(error.strerror):  # told already
            raise
        if error.errno in _FULL:
            raise OSError(error.errno, f"cannot be written ({error.strerror})", str(path)) from None
        raise InvalidSettings(
            f"{path}: cannot be written ({error.strerror or error}); name another folder or file"
        ) from None


def write_text(text: str, path: Path | str) -> None:
    """Write ``text`` as UTF-8 to ``path``, whole or not at all.

    Args:
        text: the whole content.
        path: of the file, replaced if it exists.
    Raises:
        InvalidSettings: the file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(data: Any, path: Path | str) -> None:
    """Write ``data`` as strict JSON to ``path``, whole or not at all; NaN and ±∞ become null.

    Args:
        data: dicts, lists, numbers, texts, also numpy's.
        path: of the file, replaced if it exists.
    Raises:
        InvalidSettings: the file cannot be written, or a value has no plain form.
    """
    write_text(json_text(data), path)
