"""Which form of the theory a path follows: its dimension, compression or extension, or b.

The limits of eqs. 19–22 differ between 2D, triaxial compression, triaxial extension and true
triaxial states, so a fit must know which of them was run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import xarray as xr

from granufab.errors import InvalidSettings
from granufab.history import Run
from granufab.states.series import plateau_rows

__all__ = [
    "Symmetry",
    "described_series",
    "fit_symmetry",
    "run_symmetry",
    "series_symmetry",
    "symmetry_attributes",
]

Mode = Literal["compression", "extension"]
SIMPLE_SHEAR_B = 0.5
"""b of the strain rate in simple shear: one principal rate is zero, midway between the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Symmetry:
    """What a fit of the accessible domain has to know of its paths.

    Attributes:
        dimension: 2 or 3.
        mode: axisymmetric loading in 3D; None where it is to be read from the sign of a'.
        b: (ε̇_2 − ε̇_3)/(ε̇_1 − ε̇_3) of a true triaxial loading in 3D, else None.
    """

    dimension: int = 2
    mode: Mode | None = None
    b: float | None = None

    def but(
        self, *, dimension: int | None = None, mode: Mode | None = None, b: float | None = None
    ) -> Symmetry:
        """The same with what is given (not None) in its place; a given mode drops b.

        Raises:
            InvalidSettings: mode or b in 2D, or both.
        """
        wanted = self.dimension if dimension is None else dimension
        if mode is not None and b is not None:
            raise InvalidSettings("give mode or b, not both")
        for name, value in (("mode", mode), ("b", b)):
            if value is not None and wanted == 2:
                raise InvalidSettings(f"{name} is {value}, but the paths are 2D; give dimension 3")
        if wanted == 2:
            return Symmetry()
        kept = self.b if mode is None and b is None else b
        return Symmetry(
            dimension=wanted, mode=mode or (None if b is not None else self.mode), b=kept
        )

    def options(self) -> dict[str, Any]:
        """Keywords of :func:`granufab.states.fit_accessible_states`."""
        return {"dimension": self.dimension, "mode": self.mode or "compression", "b": self.b}


def run_symmetry(settings: Mapping[str, Any]) -> Symmetry:
    """Dimension and b of the first stage that shears, from the settings of a run.

    Args:
        settings: resolved settings as plain data (``Run.settings``); unknown ones count as 2D.
    """
    sample = settings.get("sample") or {}
    if sample.get("dimension", 2) == 2:
        return Symmetry()
    stages = [s for s in settings.get("path") or () if s.get("loading") != "isotropic"]
    return Symmetry(dimension=3, b=_stage_b(stages[0]) if stages else None)


def _stage_b(stage: Mapping[str, Any]) -> float | None:
    if str(stage.get("loading")).startswith("simple-shear"):
        return SIMPLE_SHEAR_B
    b = stage.get("b")
    # Backwards, the largest rate becomes the smallest.
    return None if b is None else float(b) if stage.get("strain", 1.0) >= 0 else 1.0 - float(b)


def described_series(run: Run) -> xr.Dataset:
    """The series of a run with ``dimension`` and ``b`` among its attributes."""
    return run.series.assign_attrs(symmetry_attributes(run_symmetry(run.settings)))


def symmetry_attributes(symmetry: Symmetry) -> dict[str, Any]:
    """Attributes that :func:`series_symmetry` reads back."""
    return {"dimension": symmetry.dimension, "b": symmetry.b}


def series_symmetry(series: xr.Dataset) -> Symmetry:
    """What the attributes of a series tell; 2D where they tell nothing."""
    return Symmetry(dimension=series.attrs.get("dimension", 2), b=series.attrs.get("b"))


def fit_symmetry(symmetries: Sequence[Symmetry], series: Sequence[xr.Dataset]) -> Symmetry:
    """The one symmetry of several paths; in axisymmetric 3D the mode is that of their plateaus.

    Args:
        symmetries: of each path.
        series: each path up to its first reversal, with ``eps_q`` and ``a_signed`` or ``a``.
    Raises:
        InvalidSettings: the paths differ in dimension, b or mode, so no one domain holds them.
    """
    if len({(item.dimension, item.b) for item in symmetries}) > 1:
        raise InvalidSettings(
            "the paths differ in dimension or b, so they have no common domain; fit them apart"
        )
    first = symmetries[0]
    if first.dimension == 2 or first.b is not None:
        return first
    given = zip(symmetries, series, strict=True)
    modes: set[Mode] = {item.mode or _plateau_mode(path) for item, path in given}
    if len(modes) > 1:
        raise InvalidSettings(
            "the paths are of compression and of extension, so they have no common domain; "
            "fit them apart"
        )
    return Symmetry(dimension=3, mode=modes.pop())


def _plateau_mode(series: xr.Dataset) -> Mode:
    """Extension where a' < 0 on the late-strain plateau."""
    signed = "a_signed" in series and bool(np.isfinite(series["a_signed"]).any())
    a = np.asarray(series["a_signed" if signed else "a"].values, dtype=float)
    strain = np.asarray(series["eps_q"].values, dtype=float)
    rising = strain if strain[-1] >= strain[0] else -strain
    return "extension" if np.nanmean(a[plateau_rows(rising, None)]) < 0 else "compression"
