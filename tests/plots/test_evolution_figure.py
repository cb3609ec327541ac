"""The figure of an evolution law draws what it is given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from granufab import plots
from granufab.errors import MissingData
from granufab.states import (
    AccessibleDomain,
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    predict_evolution,
    proportional_gradient,
)


def prediction(sign: tuple[int, ...] = (1, -1)) -> xr.Dataset:
    law = EvolutionLaw(z_min=2.75, z_max=3.65, gain_rate=30.0, loss_rate=45.0)
    gradient = proportional_gradient(2)
    stages = [StrainStage(gradient=s * gradient, times=np.linspace(0, 0.2, 101)) for s in sign]
    return predict_evolution(law, fabric_from_state(3.6), stages)


def measured(path: xr.Dataset) -> xr.Dataset:
    return path.drop_vars("fabric").rename(z="z_backbone")


def test_lines_are_the_data(tmp_path: Path) -> None:
    path = prediction()
    figure = plots.evolution(
        {"dense": measured(path)},
        {"dense": path},
        domain=AccessibleDomain(z_min=2.75, z_max=3.65),
        window=0.0,
    )
    panels = figure.get_axes()
    assert len(panels) == 3
    for panel, name in zip(panels, ("z", "a_signed"), strict=False):
        dashed = [
            line for line in panel.lines if line.get_linestyle() == "--" and len(line.get_xdata())
        ]
        assert np.allclose(dashed[0].get_xdata(), path["eps_q_total"])
        assert np.allclose(dashed[0].get_ydata(), path[name])
    assert "z" in panels[0].get_ylabel() and "a" in panels[1].get_ylabel()
    low, high = panels[2].get_ylim()
    assert low < float(path["a_signed"].min()) and high > 0.28
    for file in plots.save(figure, tmp_path / "evolution"):
        assert file.stat().st_size > 5000


def test_a_prediction_of_nothing_measured() -> None:
    path = prediction()
    with pytest.raises(MissingData, match="'loose'"):
        plots.evolution({"dense": measured(path)}, {"loose": path})
