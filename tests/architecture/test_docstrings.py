"""Every public name says what it is, what it takes and what it raises."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import pytest

PACKAGES = (
    *("granufab", "granufab.packing", "granufab.history", "granufab.errors"),
    *("granufab.local_problem", "granufab.fabric", "granufab.states", "granufab.simulate"),
    *("granufab.io", "granufab.plots", "granufab.reproduce", "granufab.campaign"),
    "granufab.viewer",
)


def _public() -> Iterator[tuple[str, Any]]:
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in module.__all__:
            yield f"{package}.{name}", getattr(module, name)


FUNCTIONS = [(name, value) for name, value in _public() if inspect.isfunction(value)]
CLASSES = [(name, value) for name, value in _public() if inspect.isclass(value)]


def _text(value: Any) -> str:
    return inspect.cleandoc(value.__doc__ or "")


def _raises(function: Any) -> set[str]:
    """Exceptions that the function itself raises by name."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc]
    return {ast.unparse(c.func if isinstance(c, ast.Call) else c) for c in calls}


def test_there_are_names_to_look_at() -> None:
    assert len(FUNCTIONS) > 100
    assert len(CLASSES) > 40


@pytest.mark.parametrize(("name", "value"), FUNCTIONS, ids=[name for name, _ in FUNCTIONS])
def test_a_function_says_what_it_does_takes_and_raises(name: str, value: Any) -> None:
    text = _text(value)
    summary = text.split("\n\n")[0]
    assert summary.endswith((".", "].", "]")) or "Source" in text, f"{name}: {summary!r}"
    parameters = [p for p in inspect.signature(value).parameters if not p.startswith("_")]
    if len(parameters) > 1:
        listed = text.partition("Args:\n")[2]
        silent = [one for one in parameters if not re.search(rf"\b{one}\b", listed)]
        assert listed, f"{name} has no Args"
        assert not silent, f"{name}: Args leave out {silent}"
    if _raises(value):
        assert "Raises:\n" in text, f"{name} raises {_raises(value)}"


@pytest.mark.parametrize(("name", "value"), CLASSES, ids=[name for name, _ in CLASSES])
def test_a_class_says_what_it_is(name: str, value: Any) -> None:
    text = _text(value)
    assert text, name
    assert not text.startswith(f"{value.__name__}("), f"{name}: only the dataclass signature"
    methods = [
        key
        for key, member in vars(value).items()
        if inspect.isfunction(member) and not key.startswith("_") and not member.__doc__
    ]
    assert not methods, f"{name}: {methods} say nothing"
