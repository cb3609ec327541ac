"""What the columns of a table hold, as a TOML file says it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from granufab.errors import InvalidSettings, MissingData

__all__ = ["read_column_map"]


def read_column_map(file: Path | str) -> dict[str, dict[str, Any]]:
    """Sections of a column map, for ``columns=`` of :func:`granufab.read`.

    Raises:
        MissingData: there is no such file, or it cannot be read.
        InvalidSettings: it is not TOML, or a key stands outside a section.
    """
    file = Path(file)
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise MissingData(f"{file}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:  # nested too deep, a number of 5000 digits
        raise InvalidSettings(f"{file}: is not TOML ({error})") from None
    for name, section in found.items():
        if not isinstance(section, dict):
            raise InvalidSettings(f"{file}: {name} stands outside a section such as [grains]")
    return found
