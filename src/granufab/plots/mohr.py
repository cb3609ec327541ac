"""Mohr circles of the fabric tensor between the two limit states (Fig. 6)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.typing import ColorType

from granufab.plots.limits import Limits, as_domain
from granufab.plots.style import INK, new_figure, style
from granufab.states import (
    AccessibleDomain,
    MohrCircle,
    critical_circle,
    limit_circles,
    tangent_line,
)

__all__ = ["mohr"]


def mohr(
    circles: Mapping[str, MohrCircle] | MohrCircle | None = None,
    *,
    domain: Limits | None = None,
    critical: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Mohr circles of fabric states on the (G_n, G_t) plane [Radjai2012, Fig. 6].

    The limit isotropic states L1 and L2 are points at z_min/(2D) and z_max/(2D); every
    accessible circle lies between them. The critical circle spans them and touches
    G_t = ± tan α G_n. In 3D the circle is the one through G_1 and G_3; the two through G_2 are
    thin, and the projections on all planes fill the tinted region between the three. In
    axisymmetric states G_2 is one of the others, and nothing but the circle is left.

    Args:
        circles: a circle from :func:`granufab.mohr`, or several with their labels.
        domain: a domain or a fit of one; draws L1 and L2.
        critical: draw the critical circle and its cone (needs ``domain``).
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, its two axes equally scaled.
    """
    if isinstance(circles, MohrCircle):
        circles = {"state": circles}
    theta = np.linspace(0, np.pi, 361)
    with style():
        ax = ax if ax is not None else new_figure(height=2.4)[1][0]
        ax.set_aspect("equal", adjustable="datalim")
        ax.axhline(0, color=INK, lw=0.6)
        for label, circle in (circles or {}).items():
            (line,) = ax.plot(*circle.points(theta), label=label, zorder=3)
            ax.plot([circle.centre], [0], "+", color=line.get_color(), ms=5, zorder=3)
            _draw_inner(ax, circle, line.get_color())
        if domain is None and circles:
            widest = max(max(c.radius, 0.05 * c.p_G) for c in circles.values())  # a point has none
            top = 1.45 * widest  # room for the legend
            ax.update_datalim([(circle.centre, top) for circle in circles.values()])
            ax.autoscale_view()
        if domain is not None:
            if critical:
                _draw_critical(ax, as_domain(domain))
            _draw_limits(ax, as_domain(domain))
        ax.set_xlabel(r"$G_n$ [-]")
        ax.set_ylabel(r"$G_t$ [-]")
        if ax.get_legend_handles_labels()[0]:
            ax.legend(loc="upper center", ncols=2)
    return ax


def _draw_inner(ax: Axes, circle: MohrCircle, colour: ColorType) -> None:
    """The two smaller circles of a 3D state and the region between the three."""
    outer, *inner = circle.circles
    inner = [(centre, radius) for centre, radius in inner if radius > 1e-3 * outer[1]]
    if len(inner) < 2:
        return
    angle = np.linspace(0, np.pi, 181)
    normal = outer[0] - outer[1] * np.cos(angle)
    height = outer[1] * np.sin(angle)
    floor = np.zeros_like(normal)
    for centre, radius in inner:
        floor = np.maximum(floor, np.sqrt(np.maximum(radius**2 - (normal - centre) ** 2, 0.0)))
        turn = np.linspace(0, 2 * np.pi, 241)
        ax.plot(centre + radius * np.cos(turn), radius * np.sin(turn), color=colour, lw=0.6)
    for sign in (1, -1):
        ax.fill_between(normal, sign * floor, sign * height, color=colour, alpha=0.12, lw=0)


def _draw_limits(ax: Axes, domain: AccessibleDomain) -> None:
    width = (domain.z_max - domain.z_min) / (2 * domain.dimension)
    for name, circle, side in zip("12", limit_circles(domain), (-1, 1), strict=True):
        ax.plot([circle.centre], [0], "o", color=INK, ms=4, zorder=5, clip_on=False)
        ax.annotate(
            f"$L_{name}$",
            (circle.centre, 0),
            xytext=(7 * side, 5),
            textcoords="offset points",
            ha="right" if side < 0 else "left",
        )
    low, high = (circle.centre for circle in limit_circles(domain))
    ax.update_datalim([(low - 0.25 * width, -0.5 * width), (high + 0.25 * width, 0.7 * width)])
    ax.autoscale_view()


def _draw_critical(ax: Axes, domain: AccessibleDomain) -> None:
    circle = critical_circle(domain)
    theta = np.linspace(0, np.pi, 361)
    ax.plot(*circle.points(theta), color=INK, lw=1.0, zorder=2.5, label="critical state")
    slope, (normal, tangential) = tangent_line(domain)
    reach = 1.12 * domain.z_max / (2 * domain.dimension)
    for sign in (1, -1):
        ax.plot([0, reach], [0, sign * slope * reach], color=INK, lw=0.7, ls=(0, (5, 2)))
        ax.plot([normal], [sign * tangential], ".", color=INK, ms=4)
    arc = np.linspace(0, domain.tangent_angle, 40)
    radius = 0.42 * domain.z_min / (2 * domain.dimension)
    ax.plot(radius * np.cos(arc), radius * np.sin(arc), color=INK, lw=0.6)
    half = domain.tangent_angle / 2
    ax.text(1.06 * radius * np.cos(half), 1.06 * radius * np.sin(half), r"$\alpha$", va="center")
