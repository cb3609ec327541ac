"""The figures of the balance show the numbers they are given."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes

from granufab import plots
from granufab.errors import MissingData
from granufab.fabric import average_balance, balance_run, rates_by_sampling
from granufab.history import Frame, Run
from granufab.packing import Cell, Contacts, Grains, Packing


def _run(dimension: int, stages: tuple[int, ...] = (0,) * 7) -> Run:
    """Contacts that come and go at random and turn from the first axis to the second."""
    generator = np.random.default_rng(2)
    pairs = np.column_stack(np.triu_indices(20, 1))
    base = generator.normal(size=(len(pairs), dimension))
    frames = []
    for index, stage in enumerate(stages):
        normal = base * np.array([np.exp(-0.05 * index), *(1.0,) * (dimension - 1)])
        here = generator.random(len(pairs)) < 0.8
        normal = (normal / np.linalg.norm(normal, axis=1)[:, None])[here]
        matrix = np.diag([np.exp(-0.05 * index), *(1.0,) * (dimension - 1)])
        frames.append(
            Frame(
                packing=Packing(
                    grains=Grains(position=np.zeros((20, dimension)), radius=np.full(20, 0.5)),
                    contacts=Contacts(
                        pair=pairs[here], normal=normal, image=np.zeros_like(normal, dtype=int)
                    ),
                    cell=Cell(matrix=matrix),
                ),
                eps_q=0.05 * index,
                eps_q_total=0.05 * index,
                strain=np.zeros((dimension, dimension)),
                stage=stage,
                stress=np.eye(dimension),
                inertial_number=1e-3,
                direction=np.eye(dimension)[0],
            )
        )
    return Run(series_source=xr.Dataset(), frames=frames)


def _drawn(ax: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    handles, labels = ax.get_legend_handles_labels()
    line = handles[labels.index(label)]
    line = getattr(line, "lines", [line])[0]
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def _labelled(panels: list[Axes]) -> None:
    for panel in panels:
        assert "[" in panel.get_ylabel()
    assert "[" in panels[-1].get_xlabel()


def test_terms_by_direction_in_the_plane() -> None:
    data = balance_run(_run(2), criterion="listed", bins=12)
    panels = plots.balance(data, window=(0.0, 0.3))
    mean = average_balance(data, window=(0.0, 0.3))
    _labelled(panels)
    angle, gain = _drawn(panels[0], "gain $I^+$")
    np.testing.assert_allclose(angle, np.arange(-82.5, 90, 15))
    np.testing.assert_allclose(gain, np.roll(mean["gain_rate"], 6))
    angle, current = _drawn(panels[2], "measured")
    np.testing.assert_allclose(angle, np.arange(-90, 91, 15))
    assert current[0] == current[-1] == float(mean["current_rate"][6])
    np.testing.assert_allclose(current[6:], mean["current_rate"][:7])


def test_terms_by_direction_in_space() -> None:
    mean = average_balance(balance_run(_run(3), criterion="listed", bins=8), window=(0.0, 0.3))
    panels = plots.balance(mean)
    _labelled(panels)
    cosine, current = _drawn(panels[2], "affine")
    np.testing.assert_allclose(cosine, np.linspace(1, 0, 9), atol=1e-12)
    np.testing.assert_allclose(current, mean["current_rate_affine"])
    assert panels[2].get_xlim() == (1, 0)


def test_attribution_adds_up_in_every_stage() -> None:
    data = balance_run(_run(2, (0, 0, 0, 0, 1, 1, 1)), criterion="listed")
    panels = plots.attribution(data, smooth=0.0)
    _labelled(panels)
    parts = [_drawn(panels[1], name)[1] for name in ("gain", "loss", "rotation")]
    strain, total = _drawn(panels[1], "sum")
    np.testing.assert_allclose(np.sum(parts, axis=0), total, atol=1e-12)
    np.testing.assert_allclose(strain, [0.025, 0.075, 0.125])  # the second stage is another line
    change = data["az_after"] - data["az_before"]
    np.testing.assert_allclose(total, (change / data["strain"])[:3])
    _, turned = _drawn(panels[1], "rotation, affine")
    # Persistent contacts turn exactly with the mean flow here.
    np.testing.assert_allclose(turned, parts[2], rtol=0.02)


def test_nothing_moves_nothing_is_drawn() -> None:
    data = balance_run(_run(2), criterion="listed")
    with pytest.raises(MissingData, match="strain"):
        plots.attribution(data.assign(current_rate=data["current_rate"] * np.nan))
    with pytest.raises(MissingData, match="window"):
        plots.balance(data, window=(5.0, 6.0))


def test_rates_against_sampling() -> None:
    run = _run(2)
    rates = rates_by_sampling(run, multiples=(1, 2, 3), criterion="listed", window=(0, 0.3))
    ax = plots.sampling_rates({"all": rates})
    _labelled([ax])
    strain, loss = _drawn(ax, "all: loss")
    np.testing.assert_allclose(strain, [0.05, 0.1, 0.15])
    np.testing.assert_allclose(loss, rates["loss_rate"])
