"""The page as one file: style, charts and modules inside, blocks of data behind them."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping
from html import escape

from granufab.errors import CorruptFile
from granufab.viewer.page_files import PLOTLY, PageFile

__all__ = ["data_block", "page_parts"]

_MODULES = "granufab/"
"""What names of modules begin with once they are no files: the import map knows them."""
_IMPORT = re.compile(
    r"""^((?:import|export)\b[^;'"]*?\bfrom\s*|import\s*)(["'])\./""", re.MULTILINE
)
_STYLE = re.compile(r'<link\b[^>]*href="/page/([\w.-]+\.css)"[^>]*>')
_MODULE = re.compile(r'<script\b[^>]*type="module"[^>]*src="/page/([\w.-]+\.js)"[^>]*></script>')
_SCRIPT = re.compile(r'<script\b[^>]*src="/page/([\w.-]+\.js)"[^>]*></script>')


def data_block(name: str, packed: bytes) -> bytes:
    """A block of the page that holds bytes and that no browser runs.

    Args:
        name: its id.
        packed: compressed bytes.
    """
    text = base64.b64encode(packed)
    return b'<script type="text/plain" id="%s">%s</script>\n' % (escape(name).encode(), text)


def page_parts(files: Mapping[str, PageFile], title: str) -> tuple[bytes, bytes]:
    """What comes before and behind the blocks of data in a page that loads nothing.

    Args:
        files: of the page (:func:`~granufab.viewer.page_files.page_files`).
        title: of the document, any text.
    Returns:
        The two parts of the file.
    Raises:
        CorruptFile: the page asks for a file that is none of its own.
    """
    texts = {name: file.content.decode() for name, file in files.items()}
    nonce = hashlib.sha256("".join(texts.values()).encode()).hexdigest()[:32]
    page = texts["index.html"]
    page = re.sub(r"<title>.*?</title>", lambda _: f"<title>{escape(title)}</title>", page)
    page = page.replace('<meta charset="utf-8">', f'<meta charset="utf-8">\n{_policy(nonce)}', 1)

    def style(found: re.Match[str]) -> str:
        return f"<style>\n{_inert(_file(texts, found[1]), 'style')}</style>"

    def module(found: re.Match[str]) -> str:
        start = f'import "{_MODULES}{_named(texts, found[1])}";'
        names = json.dumps({"imports": _import_map(texts)}).replace("<", "\\u003c")
        return (
            f'<script type="importmap" nonce="{nonce}">{names}</script>\n'
            f'<script type="module" nonce="{nonce}">{start}</script>'
        )

    def script(found: re.Match[str]) -> str:
        return f'<script nonce="{nonce}">{_inert(_file(texts, found[1]), "script")}</script>'

    for pattern, change in ((_STYLE, style), (_MODULE, module), (_SCRIPT, script)):
        page = pattern.sub(change, page)
    head, end, rest = page.partition("<script")
    lacking = re.search(r'(?:src|href)="/page/([^"]*)"', head + rest)
    if lacking or not end:
        raise CorruptFile(f"the page of the viewer asks for {lacking and lacking[1]!r}")
    return head.encode(), (end + rest).encode()


def _policy(nonce: str) -> str:
    """Nothing is fetched, and no script runs but those of the page."""
    rules = (
        f"default-src 'none'; script-src 'nonce-{nonce}' data:; style-src 'unsafe-inline'; "
        "img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'"
    )
    return f'<meta http-equiv="Content-Security-Policy" content="{rules}">'


def _import_map(texts: Mapping[str, str]) -> dict[str, str]:
    found = {}
    for name, text in texts.items():
        if name.endswith(".js") and name != PLOTLY:
            code = base64.b64encode(_IMPORT.sub(rf"\1\2{_MODULES}", text).encode()).decode()
            found[_MODULES + name] = f"data:text/javascript;charset=utf-8;base64,{code}"
    return found


def _named(texts: Mapping[str, str], name: str) -> str:
    _file(texts, name)
    return name


def _file(texts: Mapping[str, str], name: str) -> str:
    if name not in texts:
        raise CorruptFile(f"the page of the viewer asks for {name!r}, which it does not hold")
    return texts[name]


def _inert(text: str, tag: str) -> str:
    """A text that cannot end the element that holds it; in strings and comments it is the same."""
    text = re.sub(rf"</(?={tag})", r"<\\/", text, flags=re.IGNORECASE)
    return text.replace("<!--", "\\x3c!--")
