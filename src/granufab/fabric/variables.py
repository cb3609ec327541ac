"""How results describe their variables."""

from __future__ import annotations

__all__ = ["describe"]


def describe(long_name: str, units: str = "-") -> dict[str, str]:
    """Attributes of a variable."""
    return {"units": units, "long_name": long_name}
