"""Pictures of start.md and concepts.md: ``python docs/page_figures.py``, half a minute.

The two samples are those of start.md; granufab makes the figures, labels are added here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import granufab as gf
from granufab import plots
from granufab.plots.style import COLOURS, INK, new_figure, style

IMAGES = Path(__file__).parent / "images"
DOTS_PER_INCH = 130
SMALL = ("sample.grain_count=300",)
DENSE = (*SMALL, 'name="dense"')
LOOSE = (*SMALL, 'name="loose"', "sample.friction=0.8", "sample.seed=2")


def save(figure: Figure, name: str) -> None:
    """Write a small picture."""
    with style():
        figure.savefig(IMAGES / f"{name}.png", dpi=DOTS_PER_INCH)


def fitted(runs: list[gf.Run]) -> gf.states.AccessibleFit:
    """The domain of all paths together."""
    columns = ([run.series[name] for run in runs] for name in ("eps_q", "z_backbone", "a_signed"))
    return gf.fit_accessible_states(*columns)


def network(run: gf.Run) -> Figure:
    """A corner of the last state, where single contacts can be seen."""
    packing = run.frames[-1].packing
    ax = plots.network(packing)
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = 9.0 * float(np.mean(2 * packing.grains.radius))
    ax.set_xlim(low[0] + 0.2 * size, low[0] + 1.2 * size)
    ax.set_ylim(low[1] + 0.2 * size, low[1] + 1.2 * size)
    figure = ax.figure
    assert isinstance(figure, Figure)
    figure.set_size_inches(3.3, 3.3)
    return figure


def orientations(run: gf.Run) -> Figure:
    """E(θ) before and after shearing."""
    both = {}
    for label, place in {"before": 0, "sheared": -1}.items():
        found = gf.fabric.select_network(run.frames[place].packing)
        both[label] = gf.orientation(found.contacts, z=found.z, bins=12)
    figure = plots.rose(both).figure
    assert isinstance(figure, Figure)
    return figure


def circles(fit: gf.states.AccessibleFit) -> Figure:
    """The Mohr circle of the critical state and of one inside, between the limit points."""
    inside = gf.mohr(float(fit.z_star.value), 0.4 * float(fit.a_star.value))
    figure = plots.mohr({"a state inside": inside}, domain=fit.domain).figure
    assert isinstance(figure, Figure)
    return figure


def domain(fit: gf.states.AccessibleFit) -> Figure:
    """The accessible domain with words on its sides."""
    limits = fit.domain
    figure, (ax,) = new_figure()
    with style():
        low, high = limits.z_min, limits.z_max
        z = np.linspace(low - 0.15, high + 0.15, 400)
        ax.fill_between(z, 0, np.clip(limits.a_max(z), 0, None), color="0.93", lw=0)
        for line in (limits.loss_saturation, limits.gain_saturation):
            ax.plot(z, line(z), color=INK, lw=0.9)
        ax.plot(limits.z_star, limits.a_star, "*", ms=11, color="#F0C808", mec=INK, mew=0.7)
        _words(ax, limits)
        ax.set_xlim(z[0], z[-1])
        ax.set_ylim(0, 1.6 * limits.a_star)
        ax.set_xlabel(r"coordination number $z$ [-]")
        ax.set_ylabel(r"anisotropy $a$ [-]")
    return figure


def _words(ax: Axes, limits: gf.AccessibleDomain) -> None:
    top, middle = limits.a_star, limits.z_star
    place = {"ha": "center", "fontsize": 8}
    ax.text(middle, 0.35 * top, "accessible", **place)
    ax.text(middle + 0.05, top, "critical state", va="center", fontsize=8)
    left, right = 0.5 * (limits.z_min + middle), 0.5 * (limits.z_max + middle)
    for x, text, turn, side in (
        (left, "loss saturated", 42, -1),
        (right, "gain saturated", -42, 1),
    ):
        ax.text(x + 0.06 * side, 0.56 * top, text, rotation=turn, va="center", **place)
    for x, text, colour in (
        (limits.z_min, r"$z_\mathrm{min}$", COLOURS[0]),
        (limits.z_max, r"$z_\mathrm{max}$", COLOURS[1]),
    ):
        ax.annotate(
            text, (x, 0), (x, 0.2 * top), ha="center", color=colour,
            arrowprops={"arrowstyle": "->", "color": colour, "lw": 0.8},
        )  # fmt: skip


def main() -> None:
    """Simulate both samples and draw."""
    runs = [gf.run_case(gf.load_case(None, overrides)) for overrides in (DENSE, LOOSE)]
    fit = fitted(runs)
    pictures: dict[str, Callable[[], Figure]] = {
        "start-path": lambda: plots.path(runs, domain=fit).figure,  # type: ignore[return-value]
        "concept-network": lambda: network(runs[0]),
        "concept-orientations": lambda: orientations(runs[0]),
        "concept-circles": lambda: circles(fit),
        "concept-domain": lambda: domain(fit),
    }
    for name, draw in pictures.items():
        save(draw(), name)


if __name__ == "__main__":
    main()
