"""``granufab new``: a commented case to start from."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

__all__ = ["new"]

Name = Literal[
    "isotropic", "shear", "biaxial", "triaxial", "true-triaxial", "simple-shear", "reversal"
]


def new(name: Annotated[Name, typer.Argument(help="Which loading the case describes.")]) -> None:
    """Print a commented TOML case: granufab new shear > case.toml"""
    from granufab.cli.templates import TEMPLATES
    from granufab.simulate.settings import to_toml

    print(to_toml(TEMPLATES[name], comments=True), end="")
