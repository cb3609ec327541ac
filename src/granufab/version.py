"""The version of the package, for those who must not import all of its public names."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

__all__ = ["VERSION"]

try:
    VERSION = version("granufab")
except PackageNotFoundError:  # used from its source tree without installing
    VERSION = "0+unknown"
