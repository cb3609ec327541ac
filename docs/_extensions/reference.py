"""Pages written from the program before a build: every module's names, every verb's options."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from sphinx.application import Sphinx

import granufab

__all__ = ["public_modules", "setup"]

PACKAGES = {
    "fabric": "Measures on packings",
    "states": "The accessible domain and the evolution law",
    "simulate": "Samples, loadings, runs",
    "io": "Run files and other programs' data",
    "plots": "Figures",
    "reproduce": "The paper's figures, cases in folders",
    "campaign": "Parameter sweeps",
    "viewer": "Data for the page in the browser",
}
SOURCE = Path(granufab.__file__).parent


def public_modules(package: str) -> Iterator[tuple[str, str]]:
    """Modules of a package that name something in ``__all__``, and which members to show.

    All members are named by nothing; of a package's own file those it defines, as the rest has
    modules of its own.
    """
    for path in sorted((SOURCE / package).rglob("*.py")):
        names = _names(path)
        parts = ("granufab", *path.relative_to(SOURCE).with_suffix("").parts)
        if path.name != "__init__.py":
            if names:
                yield ".".join(parts), ""
        elif own := [name for name in names if name in _functions(path)]:
            yield ".".join(parts[:-1]), ", ".join(own)


def _functions(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def _names(path: Path) -> list[str]:
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return ast.literal_eval(node.value)
    return []


def write_reference(folder: Path) -> None:
    """One page for the state, one for each package, and their list."""
    folder.mkdir(parents=True, exist_ok=True)
    named = ("packing", "history", "local_problem", "errors")
    state = [(f"granufab.{name}", "") for name in named]
    modules = {"state": state} | {name: list(public_modules(name)) for name in PACKAGES}
    titles = {"state": "States, runs and errors"} | PACKAGES
    for name, listed in modules.items():
        title = titles[name]
        if name != "state":
            title = f"granufab.{name}: {title.lower()}"
        parts = [title, "=" * len(title), ""]
        for module, members in listed:
            parts += [module, "-" * len(module), ""]
            parts += [f".. automodule:: {module}", f"   :members: {members}".rstrip(), ""]
        _write(folder / f"{name}.rst", "\n".join(parts))
    listed = "\n".join(f"   {name}" for name in modules)
    head = "Reference\n=========\n\n"
    head += "From the docstrings: formulas, shapes, units, errors, sources.\n\n"
    _write(folder / "index.rst", f"{head}.. toctree::\n   :maxdepth: 1\n\n{listed}\n")


def write_commands(page: Path) -> None:
    """Every verb with its arguments and options, as the program itself describes them."""
    from granufab.cli.application import app

    group: Any = typer.main.get_command(app)
    parts = ["# Commands", ""]
    parts += ["Written from the program; `granufab VERB --help` prints the same.", ""]
    for name, command in group.commands.items():
        parts += [f"## granufab {name}", "", _plain(command.help), ""]
        parts += _table("argument", [p for p in command.params if p.param_type_name == "argument"])
        parts += _table("option", [p for p in command.params if p.param_type_name == "option"])
    page.parent.mkdir(parents=True, exist_ok=True)
    _write(page, "\n".join(parts))


def _table(kind: str, parameters: list[Any]) -> list[str]:
    shown = [one for one in parameters if not getattr(one, "hidden", False)]
    if not shown:
        return []
    rows = [f"| {kind} | default | |", "|---|---|---|"]
    for one in shown:
        names = one.opts + one.secondary_opts if kind == "option" else [one.metavar or one.name]
        unsaid = one.default in (None, False, (), []) or callable(one.default)
        default = "" if unsaid else f"`{one.default}`"
        text = _plain(getattr(one, "help", "") or "").replace("\n", " ").replace("|", "\\|")
        shown_names = ", ".join(f"`{name}`" for name in names).replace("|", "\\|")
        rows.append(f"| {shown_names} | {default} | {text} |")
    return [*rows, ""]


def _plain(text: str | None) -> str:
    return (text or "").replace("\b", "").strip()


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def _written(app: Sphinx) -> None:
    write_reference(Path(app.srcdir) / "reference")
    write_commands(Path(app.srcdir) / "reference" / "commands.md")


def _of_another(
    _app: Sphinx, _what: str, _name: str, member: Any, _skip: bool, _options: Any
) -> bool | None:
    """Leave out what a base class of another library adds to ours, such as ``Figure.set``."""
    return True if (getattr(member, "__module__", None) or "").startswith("matplotlib.") else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages when a build begins."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("builder-inited", _written, priority=100)
    app.connect("autodoc-skip-member", _of_another)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
