"""The evolution law that ``granufab fit --evolution`` fits and writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granufab.cli.choices import Form

if TYPE_CHECKING:
    import xarray as xr

    from granufab.states import AccessibleFit, EvolutionFit

__all__ = ["fit_law", "print_law", "write_law"]


def fit_law(
    paths: Sequence[xr.Dataset], domain: AccessibleFit, definition: str, form: Form
) -> EvolutionFit:
    """Fit an evolution law to the first stage of some series, with the loading of ``domain``."""
    from granufab.reproduce.recipe import first_stage
    from granufab.reproduce.series_fit import known_rows
    from granufab.states import fit_evolution

    rows = [known_rows(first_stage(path), definition) for path in paths]
    strain, z, a = ([row[name] for row in rows] for name in ("eps_q", definition, "a"))
    return fit_evolution(strain, z, a, form=form, dimension=domain.dimension, b=domain.b)


def write_law(law: EvolutionFit, file: Path, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Write the fit and what it was fitted to; returns what is worth printing of it."""
    from granufab.io import write_json

    data = law.to_dict() | {name: entry[name] for name in ("z_definition", "series")}
    write_json(data, file)
    shown = ("form", "limits", "parameters", "rms", "state_count", "aic", "bic")
    return {name: data[name] for name in shown} | {"file": str(file)}


def print_law(law: EvolutionFit) -> None:
    """Print the law's parameters for people."""
    from granufab.cli.output import print_rows

    rows = [[name, e.value, e.low, e.high] for name, e in law.parameters.items()]
    print_rows(f"evolution law: {law.form}", ("", "value", "low", "high"), rows)
    errors = ", ".join(f"{name} {value:.3g}" for name, value in law.rms.items())
    print(f"rms residuals over {law.state_count} states: {errors}")
