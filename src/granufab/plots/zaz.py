"""Paths in the (z, az) plane, where the limits are straight lines (Fig. 8)."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes

from granufab.plots.curves import LABELS, Results, collect
from granufab.plots.limits import Limits, critical_marker, limit_lines
from granufab.plots.path import draw_paths
from granufab.plots.style import COLOURS, FIT, new_figure, style

__all__ = ["zaz"]


def zaz(
    *results: Results,
    domain: Limits | Mapping[str, Limits] | None = None,
    z_definition: str = "z_backbone",
    window: float = 0.01,
    ax: Axes | None = None,
) -> Axes:
    """Evolution of a z against z with straight limit lines [Radjai2012, Fig. 8].

    From eq. 19 in 2D: a z = 2(z − z_min) at loss saturation, 2(z_max − z) at gain saturation.

    Args:
        results: a run, several, or {label: repeats of one path}.
        domain: a domain or a fit; {label: …} draws the lines of each path in its own colour.
        z_definition: column of the coordination number.
        window: strain over which the running mean is taken.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel.
    Raises:
        MissingData: a series lacks a column, or there is no series.
    """
    groups = collect(*results)
    with style():
        ax = ax if ax is not None else new_figure()[1][0]
        draw_paths(ax, groups, z_definition, window, scaled=True)
        each = domain if isinstance(domain, Mapping) else {"": domain}
        for label, item in each.items():
            if item is None:
                continue
            own = list(groups).index(label) if label in groups else None
            colour = FIT if own is None else COLOURS[own % len(COLOURS)]
            limit_lines(ax, item, scaled=True, colour=colour, shade=own is None)
            critical_marker(ax, item, scaled=True, colour=colour, label=own is None)
        ax.set_xlabel(LABELS.get(z_definition, z_definition))
        ax.set_ylabel(r"$a\,z$ [-]")
        ax.legend(loc="best")
    return ax
