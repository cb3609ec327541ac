"""The paper's figures from small samples: ``granufab reproduce`` within seconds."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import granufab as gf
from granufab.reproduce import reproduce
from granufab.simulate.settings import Case

__all__ = ["GRAINS", "INERTIAL_NUMBER", "TOLERANCE", "Picture", "small"]

GRAINS, INERTIAL_NUMBER, TOLERANCE = 300, 2e-3, 1e-3
"""``granufab reproduce`` takes 5,000 grains (1,000 with ``--quick``), I = 3·10⁻⁴ and 10⁻⁴."""


@dataclass(frozen=True)
class Picture:
    """A finished figure; a notebook and the gallery show it."""

    png: bytes

    def _repr_png_(self) -> bytes:
        return self.png


def small(figure: str, *, grains: int = GRAINS, seed: int = 1) -> tuple[dict[str, Any], Picture]:
    """What ``granufab reproduce`` leaves in ``figN.json`` and ``figN.png``, of a small sample."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / figure
        numbers = reproduce(figure, grains=grains, seed=seed, out=out, workers=1, run_case=_faster)
        return numbers, Picture((out / f"{figure}.png").read_bytes())


def _faster(case: Case, **options: Any) -> gf.Run:
    """The same case at a higher rate and a larger residual."""
    path = tuple(s.model_copy(update={"inertial_number": INERTIAL_NUMBER}) for s in case.path)
    solver = case.solver.model_copy(update={"tolerance": TOLERANCE})
    return gf.run_case(case.model_copy(update={"path": path, "solver": solver}), **options)
