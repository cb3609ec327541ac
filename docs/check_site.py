"""Check a built site: every link within it leads somewhere, every public name is in it.

python docs/check_site.py build/site
"""

from __future__ import annotations

import importlib
import inspect
import sys
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

__all__ = ["broken_links", "documented", "missing_names"]

PACKAGES = (
    *("packing", "history", "errors", "local_problem", "fabric", "states", "simulate", "io"),
    *("plots", "reproduce", "campaign", "viewer"),
)


class _Page(HTMLParser):
    """The links of a page and the places that links may lead to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places = {"", "top"}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep links and names."""
        for name, value in attrs:
            if value is None:
                continue
            if name == "id" or (tag == "a" and name == "name"):
                self.places.add(value)
            elif name == "href" or (name == "src" and tag in ("img", "script")):
                self.links.append(value)


def broken_links(site: Path) -> Iterator[str]:
    """``page: link`` of every link that leads nowhere; other sites are not asked."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if parts.scheme not in ("https", "http", "mailto", "data"):
                    yield f"{path.relative_to(site)}: {link}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            known = pages.get(target)
            lost = not target.exists() or (
                known is not None and unquote(parts.fragment) not in known.places
            )
            if lost:
                yield f"{path.relative_to(site)}: {link}"


def documented(site: Path) -> set[str]:
    """Names of all objects in the site's inventory."""
    content = (site / "objects.inv").read_bytes()
    body = zlib.decompress(content.split(b"\n", 4)[4]).decode()
    return {line.split(" ", 1)[0] for line in body.splitlines()}


def missing_names(site: Path) -> Iterator[str]:
    """Public functions and classes that the site does not describe."""
    known = documented(site)
    for package in ("granufab", *(f"granufab.{name}" for name in PACKAGES)):
        module = importlib.import_module(package)
        for name in module.__all__:
            value = getattr(module, name)
            if not (inspect.isfunction(value) or inspect.isclass(value)):
                continue
            if f"{value.__module__}.{value.__qualname__}" not in known:
                yield f"{package}.{name}"


def main(site: Path) -> int:
    """Print what is wrong; 1 if anything is."""
    pages = len(list(site.rglob("*.html")))
    if not pages:
        print(f"{site} holds no pages: run make docs", file=sys.stderr)
        return 1
    found = sorted({f"broken link: {one}" for one in broken_links(site)})
    found += sorted({f"not described: {one}" for one in missing_names(site)})
    for line in found:
        print(line, file=sys.stderr)
    if not found:
        print(f"{pages} pages, {len(documented(site))} names: no broken link, no name missing")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve()))
