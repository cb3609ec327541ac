"""Reading TOML settings: the file, and one line that says what is wrong in it."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from granufab.errors import InvalidSettings

__all__ = ["describe_error", "read_toml"]


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises:
        InvalidSettings: the file is missing, cannot be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidSettings(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidSettings(f"{path}: cannot be read ({error})") from None
    except (ValueError, RecursionError) as error:  # nested too deep, a number of 5000 digits
        raise InvalidSettings(f"{path}: not valid TOML: {error}") from None


def describe_error(error: ValidationError, model: type[BaseModel]) -> str:
    """The first error in one line: the key, what is wrong, the value; the nearest known name.

    Args:
        error: what ``model`` raised.
        model: of the whole file.
    """
    first = error.errors()[0]
    location = _short(".".join(str(part) for part in first["loc"]))
    if first["type"] == "extra_forbidden":
        known = _known_names(model, first["loc"])
        near = difflib.get_close_matches(str(first["loc"][-1]), known, n=1, cutoff=0.0)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"unknown key {location}{hint} (known: {', '.join(known)})"
    message = _short(first["msg"].removeprefix("Value error, "), 1000)
    got = (
        ""
        if first["type"] in ("value_error", "missing")
        else f", got {_short(repr(first['input']))}"
    )
    return f"{location}: {message}{got}" if location else message


def _short(text: str, most: int = 200) -> str:
    """A text without its middle where it is long: a line must stay one to read."""
    return text if len(text) <= most else f"{text[: most // 2]} … {text[-most // 4 :]}"


def _known_names(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    for part in location[:-1]:
        if isinstance(part, str):
            model = _model_in(model.model_fields[part].annotation) or model
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The settings model that a field holds, alone, optional or in a sequence."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_model_in(part) for part in get_args(annotation))
    return next((item for item in found if item is not None), None)
