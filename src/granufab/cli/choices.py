"""Words that several verbs let the user choose from."""

from __future__ import annotations

from typing import Literal

__all__ = ["Definition", "Form"]

Definition = Literal["z", "z_backbone", "z_mechanical"]
"""Which coordination number."""

Form = Literal["minimal", "early", "shedding", "memory"]
"""Which evolution law."""
