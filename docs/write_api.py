"""Write docs/api.md: each public name of granufab with its signature, from the code."""

from __future__ import annotations

import ast
import inspect
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

import granufab

HEAD = """# Public interface

Everything here is `granufab.<name>`; it loads on first use. Signatures are the code's own.
Rewritten by `make docs`; a test compares this page with the code.
"""


def signature(value: Any) -> str:
    """The signature of a function, or the fields of a class, as its source has them."""
    node = ast.parse(textwrap.dedent(inspect.getsource(value))).body[0]
    if isinstance(node, ast.FunctionDef):
        return _function(node)
    assert isinstance(node, ast.ClassDef)
    lines = [_head(node)]
    for item in node.body:
        if isinstance(item, ast.AnnAssign) and not ast.unparse(item.target).startswith("_"):
            lines.append("    " + _field(item))
        elif isinstance(item, ast.FunctionDef) and not item.name.startswith("_"):
            decorators = [ast.unparse(d) for d in item.decorator_list]
            if "property" in decorators:
                lines.append(f"    {item.name} -> {ast.unparse(item.returns or ast.Constant(None))}")
            elif not any("validator" in d for d in decorators):
                lines.append("    " + _function(item))
    return "\n".join(lines)


def _head(node: ast.ClassDef) -> str:
    bases = ", ".join(ast.unparse(b) for b in node.bases if not ast.unparse(b).startswith("_"))
    return f"class {node.name}({bases}):" if bases else f"class {node.name}:"


def _field(item: ast.AnnAssign) -> str:
    text = f"{ast.unparse(item.target)}: {ast.unparse(item.annotation)}"
    value = item.value
    if isinstance(value, ast.Call) and ast.unparse(value.func) in ("Field", "field"):
        value = value.args[0] if value.args else None
    return text if value is None else f"{text} = {ast.unparse(value)}"


def _function(node: ast.FunctionDef) -> str:
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{node.name}({ast.unparse(node.args)}){returns}"
    if len(line) <= 96:
        return line
    parts = _split(ast.unparse(node.args))
    return f"{node.name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){returns}"


def _split(arguments: str) -> list[str]:
    """Split at the commas outside brackets."""
    parts, depth, current = [], 0, ""
    for letter in arguments:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append(current.strip())
            current = ""
        else:
            current += letter
    return [*parts, current.strip()]


def _first_line(value: Any) -> str:
    return (inspect.getdoc(value) or "").strip().split("\n")[0]


def page() -> str:
    """The whole page as Markdown."""
    parts = [HEAD]
    for name in granufab.__all__:
        value = getattr(granufab, name)
        parts.append(f"## {name}\n")
        if isinstance(value, ModuleType):
            public = ", ".join(f"`{item}`" for item in getattr(value, "__all__", ()))
            parts.append(f"Package. {_first_line(value)}\n\nHolds {public}.\n")
        elif isinstance(value, str):
            parts.append("The installed version, as text.\n")
        else:
            parts.append(f"```python\n{signature(value)}\n```\n{_first_line(value)}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    target = Path(__file__).with_name("api.md")
    target.write_text(page(), encoding="utf-8")
    print(f"wrote {target}")
