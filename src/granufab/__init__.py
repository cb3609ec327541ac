"""Granular fabric: simulate, measure and explain the contact network of granular matter.

The public names are listed in ``docs/api.md``. They load on first use, so ``import granufab``
costs nothing until something is asked for.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from granufab.notebook_hook import register as _register
from granufab.version import VERSION

if TYPE_CHECKING:
    from granufab import fabric, plots, reproduce, states
    from granufab.errors import GranufabError
    from granufab.fabric import fabric_tensor, measure, orientation
    from granufab.history import Run
    from granufab.io import read
    from granufab.packing import Packing
    from granufab.simulate import (
        Biaxial,
        ConstantMean,
        Isotropic,
        SimpleShear,
        Step,
        compress,
        prepare,
        random_sample,
        relax,
        run,
        run_case,
        shear,
    )
    from granufab.simulate.settings import Case, load_case
    from granufab.states import AccessibleDomain, fit_accessible_states, mohr
    from granufab.viewer.notebook import view

__version__ = VERSION

_HOME = {
    "random_sample": "simulate",
    "compress": "simulate",
    "relax": "simulate",
    "prepare": "simulate",
    "shear": "simulate",
    "run": "simulate",
    "run_case": "simulate",
    "ConstantMean": "simulate",
    "Biaxial": "simulate",
    "SimpleShear": "simulate",
    "Isotropic": "simulate",
    "Step": "simulate",
    "Case": "simulate.settings",
    "load_case": "simulate.settings",
    "Run": "history",
    "Packing": "packing",
    "read": "io",
    "measure": "fabric",
    "fabric_tensor": "fabric",
    "orientation": "fabric",
    "mohr": "states",
    "AccessibleDomain": "states",
    "fit_accessible_states": "states",
    "view": "viewer.notebook",
    "GranufabError": "errors",
}
_SUBPACKAGES = (
    "fabric", "states", "plots", "reproduce", "io", "simulate", "campaign", "viewer"
)  # fmt: skip

__all__ = [
    "AccessibleDomain",
    "Biaxial",
    "Case",
    "ConstantMean",
    "GranufabError",
    "Isotropic",
    "Packing",
    "Run",
    "SimpleShear",
    "Step",
    "__version__",
    "compress",
    "fabric",
    "fabric_tensor",
    "fit_accessible_states",
    "load_case",
    "measure",
    "mohr",
    "orientation",
    "plots",
    "prepare",
    "random_sample",
    "read",
    "relax",
    "reproduce",
    "run",
    "run_case",
    "shear",
    "states",
    "view",
]


_register()


def __getattr__(name: str) -> Any:
    if name in _SUBPACKAGES:
        return import_module(f"granufab.{name}")
    if name in _HOME:
        value = getattr(import_module(f"granufab.{_HOME[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'granufab' has no attribute {name!r}")


def __dir__() -> list[str]:
    return list(__all__)
