"""The public names, their signatures and docs/api.md agree; importing the package is cheap."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from types import ModuleType

import pytest

import granufab

DOCS = Path(__file__).resolve().parents[2] / "docs"
PROMISED = (
    *("random_sample", "compress", "prepare", "shear", "run", "Run", "Case", "load_case"),
    *("Biaxial", "SimpleShear", "ConstantMean", "Isotropic", "read", "measure"),
    *("fabric", "fabric_tensor", "orientation", "mohr", "AccessibleDomain"),
    *("fit_accessible_states", "plots", "reproduce", "view", "__version__"),
)


def _sections() -> dict[str, str]:
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (\S+)\n", text, flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_promised_names_are_public() -> None:
    assert set(PROMISED) <= set(granufab.__all__)
    assert len(granufab.__all__) <= 30


@pytest.mark.parametrize("name", granufab.__all__)
def test_each_public_name_loads(name: str) -> None:
    assert getattr(granufab, name) is not None


@pytest.mark.parametrize("name", ["io", "simulate", "campaign", "viewer"])
def test_a_subpackage_loads_after_the_package_alone(name: str) -> None:
    code = f"import granufab; print(granufab.{name}.__name__)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split() == [f"granufab.{name}"]


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = granufab.nothing


def test_the_page_lists_exactly_the_public_names() -> None:
    assert list(_sections()) == list(granufab.__all__)


def test_the_page_is_what_the_code_says() -> None:
    spec = importlib.util.spec_from_file_location("write_api", DOCS / "write_api.py")
    assert spec is not None
    assert spec.loader is not None
    write_api = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(write_api)
    written = (DOCS / "api.md").read_text(encoding="utf-8")
    assert written == write_api.page(), "run: make docs"


@pytest.mark.parametrize("name", granufab.__all__)
def test_parameters_on_the_page_are_the_functions(name: str) -> None:
    value = getattr(granufab, name)
    if isinstance(value, str | ModuleType) or inspect.isclass(value):
        pytest.skip("no function")
    code = re.search(r"```python\n(.*?)\n```", _sections()[name], flags=re.DOTALL)
    assert code is not None
    parsed = ast.parse(textwrap.dedent(f"def {code[1]}: ...")).body[0]
    assert isinstance(parsed, ast.FunctionDef)
    arguments = [*parsed.args.posonlyargs, *parsed.args.args, *parsed.args.kwonlyargs]
    named = [a.arg for a in (*arguments, parsed.args.vararg, parsed.args.kwarg) if a]
    assert sorted(named) == sorted(inspect.signature(value).parameters)


@pytest.mark.parametrize("module", ["granufab", "granufab.cli"])
def test_importing_loads_nothing_heavy(module: str) -> None:
    program = (
        f"import sys, {module}; "
        "print(*{'numba', 'scipy', 'xarray', 'matplotlib', 'h5py', 'numpy'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
