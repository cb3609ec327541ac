"""``granufab new``: a commented case or campaign to start from."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

__all__ = ["new"]

Name = Literal[
    "isotropic", "shear", "biaxial", "triaxial", "true-triaxial", "simple-shear", "reversal",
    "sweep",
]  # fmt: skip


def new(
    name: Annotated[
        Name, typer.Argument(help="Which loading the case describes; sweep: a campaign.")
    ],
) -> None:
    """Print a commented TOML case: granufab new shear > case.toml"""
    from granufab.cli.templates import SWEEP, TEMPLATES
    from granufab.simulate.settings import to_toml

    if name == "sweep":
        print(SWEEP, end="")
        return
    print(to_toml(TEMPLATES[name], comments=True), end="")
