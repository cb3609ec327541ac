"""Names of cases that stay the same: a readable prefix and a hash of the settings."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

from granufab.simulate.settings import Case

__all__ = ["case_digest", "case_id", "digest_of"]

DIGITS = 12  # hexadecimal; among 1e5 cases two share them with a probability of 2e-5
LONGEST_PREFIX = 60
_FOUND = ("dimension", "grain_count", "diameter", "pressure")


def case_digest(case: Case) -> str:
    """Hash of the resolved settings of a case, its name apart.

    Settings at their defaults are left out, so that a later version with more settings finds the
    same cases; a changed default is seen all the same, since a run's file names every setting.
    A case that starts from a file gets some settings of its sample from there when it is run;
    these do not count.
    """
    data = case.model_dump(mode="json", exclude={"name"}, exclude_defaults=True)
    if case.sample.file is not None:
        for name in _FOUND:
            data["sample"].pop(name, None)
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def case_id(name: str, parameters: Mapping[str, Any], seed: int, digest: str) -> str:
    """A folder's name: parameters and seed for the eye, the hash for certainty."""
    shown = {**parameters, "seed": seed}
    parts = [f"{key.rpartition('.')[2]}{_text(value)}" for key, value in shown.items()]
    prefix = re.sub(r"[^A-Za-z0-9.+-]", "_", "-".join([name, *parts]))[:LONGEST_PREFIX]
    return f"{prefix.strip('.-+_') or 'case'}-{digest}"


def digest_of(identifier: str) -> str:
    """The hash at the end of a case's id."""
    return identifier.rpartition("-")[2]


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
