"""The files of the page, read once at the start: a name from a request never opens a file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from granufab.errors import MissingData

__all__ = ["PLOTLY", "PageFile", "page_files"]

PLOTLY = "plotly.min.js"
"""Name under which the charts' JavaScript is served."""
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PageFile:
    """A file of the page.

    Attributes:
        content: its bytes.
        type: for the header Content-Type.
    """

    content: bytes
    type: str


def page_files() -> dict[str, PageFile]:
    """Every file of the page by its name, ``index.html`` and the charts' JavaScript among them.

    Raises:
        MissingData: the package plotly, whose wheel holds that JavaScript, is not installed.
    """
    found: dict[str, PageFile] = {}
    for entry in files("granufab.viewer").joinpath("page").iterdir():
        ending = "." + entry.name.rpartition(".")[2]
        if ending in _TYPES:
            found[entry.name] = PageFile(content=entry.read_bytes(), type=_TYPES[ending])
    found[PLOTLY] = PageFile(content=_plotly(), type=_TYPES[".js"])
    return found


def _plotly() -> bytes:
    try:
        return files("plotly").joinpath("package_data", PLOTLY).read_bytes()
    except (ImportError, OSError):
        raise MissingData(
            "the charts of the viewer need the package plotly; install granufab[view]"
        ) from None
