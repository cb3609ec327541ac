"""Every exception that granufab raises on purpose: one line saying what, where, got, remedy."""

from __future__ import annotations

__all__ = [
    "BrokenState",
    "CorruptFile",
    "GranufabError",
    "IncompleteFile",
    "InvalidPacking",
    "InvalidProblem",
    "InvalidSettings",
    "MissingData",
    "NotConverged",
    "UnknownFormat",
]


class GranufabError(Exception):
    """Base of all granufab errors; its message is one line a user can act on."""


class InvalidPacking(GranufabError, ValueError):
    """The arrays of a packing contradict each other."""


class InvalidProblem(GranufabError, ValueError):
    """A contact problem (W, q, mu) contradicts itself or cannot be solved."""


class InvalidSettings(GranufabError, ValueError):
    """A setting is unknown, of the wrong type or out of range."""


class MissingData(GranufabError, ValueError):
    """A quantity needs data that its source does not hold."""


class UnknownFormat(GranufabError, ValueError):
    """A file is in no format that granufab reads."""


class CorruptFile(GranufabError, OSError):
    """A file is truncated or its content contradicts itself."""


class BrokenState(GranufabError, RuntimeError):
    """A step of a simulation left a state that cannot be, or grains that overlap too far."""


class IncompleteFile(UserWarning):
    """A file is truncated, but what is there of it is sound; shown as a warning."""


class NotConverged(GranufabError, RuntimeError):
    """An iteration ended above its tolerance, or a wanted state could not be reached."""
