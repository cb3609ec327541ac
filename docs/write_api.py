"""Write docs/api.md: each public name of granufab with its signature, from the code."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from pathlib import Path
from types import ModuleType
from typing import Any

import granufab

HEAD = """# Public interface

Everything here is `granufab.<name>`; it loads on first use. Signatures are the code's own.
Rewritten by `make docs`; a test compares this page with the code.
"""
WIDTH = 92


def signature(value: Any) -> str:
    """The signature of a function, or the fields and methods of a class, as the source has them."""
    node = ast.parse(textwrap.dedent(inspect.getsource(value))).body[0]
    if isinstance(node, ast.FunctionDef):
        return _function(node)
    assert isinstance(node, ast.ClassDef)
    lines = [line for item in node.body for line in _member(item)]
    return "\n".join([_head(node), *(textwrap.indent(line, "    ") for line in lines)])


def _head(node: ast.ClassDef) -> str:
    bases = ", ".join(ast.unparse(b) for b in node.bases if not ast.unparse(b).startswith("_"))
    return f"class {node.name}({bases}):" if bases else f"class {node.name}:"


def _member(item: ast.stmt) -> list[str]:
    if isinstance(item, ast.AnnAssign) and not ast.unparse(item.target).startswith("_"):
        return [_named(ast.unparse(item.target), item.annotation, _default(item.value))]
    if not isinstance(item, ast.FunctionDef) or item.name.startswith("_"):
        return []
    decorators = [ast.unparse(decorator) for decorator in item.decorator_list]
    if any("validator" in decorator for decorator in decorators):
        return []
    if {"property", "cached_property"} & set(decorators):
        return [_named(item.name, item.returns, None)]
    return [_function(item, method=True)]


def _default(value: ast.expr | None) -> ast.expr | None:
    """The default behind a call of ``Field`` or ``field``, if it is one."""
    if not isinstance(value, ast.Call) or ast.unparse(value.func) not in ("Field", "field"):
        return value
    named = [keyword.value for keyword in value.keywords if keyword.arg == "default"]
    return named[0] if named else None


def _function(node: ast.FunctionDef, *, method: bool = False) -> str:
    parts = _parameters(node.args)[1 if method else 0 :]
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{node.name}({', '.join(parts)}){returns}"
    if len(line) <= WIDTH:
        return line
    return f"{node.name}(\n" + "".join(f"    {part},\n" for part in parts) + f"){returns}"


def _parameters(arguments: ast.arguments) -> list[str]:
    positional = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(positional) - len(arguments.defaults)) + list(arguments.defaults)
    parts = [_named(a.arg, a.annotation, d) for a, d in zip(positional, defaults, strict=True)]
    if arguments.posonlyargs:
        parts.insert(len(arguments.posonlyargs), "/")
    if arguments.vararg:
        parts.append("*" + _named(arguments.vararg.arg, arguments.vararg.annotation, None))
    elif arguments.kwonlyargs:
        parts.append("*")
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        parts.append(_named(argument.arg, argument.annotation, default))
    if arguments.kwarg:
        parts.append("**" + _named(arguments.kwarg.arg, arguments.kwarg.annotation, None))
    return parts


def _named(name: str, annotation: ast.expr | None, default: ast.expr | None) -> str:
    text = f"{name}: {ast.unparse(annotation)}" if annotation else name
    return f"{text} = {ast.unparse(default)}" if default else text


def _first_line(value: Any) -> str:
    line = (inspect.getdoc(value) or "").strip().split("\n")[0]
    line = re.sub(r":math:`([^`]*)`", r"$\1$", line)
    return re.sub(r":\w+:`~?([^`]*)`", r"``\1``", line)


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
            parts.append(f"```python\n{signature(value)}\n```\n\n{_first_line(value)}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    target = Path(__file__).with_name("api.md")
    target.write_text(page(), encoding="utf-8")
    print(f"wrote {target}")
