"""Limit lines, accessible region and critical state on the (z, a) and (z, az) planes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from granufab.packing import Array
from granufab.plots.style import FIT, INK
from granufab.states import AccessibleDomain, AccessibleFit

__all__ = ["Limits", "as_domain", "critical_marker", "limit_lines"]

Limits = AccessibleDomain | AccessibleFit
"""A domain, or a fit of one with its intervals."""


def as_domain(limits: Limits) -> AccessibleDomain:
    """The domain itself."""
    return limits.domain if isinstance(limits, AccessibleFit) else limits


def limit_lines(
    ax: Axes, limits: Limits, *, scaled: bool, colour: str = INK, shade: bool = True
) -> None:
    """Draw loss and gain saturation [Radjai2012, eq. 19], inside the view that the data set.

    Args:
        ax: panel whose limits are already set; the view is widened to hold the critical state.
        limits: a domain or a fit; the intervals of a fit's z_min and z_max become bands.
        scaled: the ordinate is a z instead of a.
        colour: of the lines.
        shade: tint the accessible region, and draw the bands.
    """
    domain = as_domain(limits)
    apex = domain.a_star * (domain.z_star if scaled else 1.0)
    low, high = ax.get_xlim()
    low, high = min(low, domain.z_min - 0.02), max(high, domain.z_max + 0.02)
    bottom, top = ax.get_ylim()
    z = np.linspace(max(low, 1e-3), high, 400)
    loss, gain = _lines(domain, z, scaled)
    dash = (0, (5, 2))
    if not shade:
        # Several domains in one panel stay readable if each line ends at its critical state.
        loss, gain = (np.where(line <= 1.02 * apex, line, np.nan) for line in (loss, gain))
    for line in (loss, gain):
        ax.plot(z, line, color=colour, lw=0.8, ls="-" if shade else dash, zorder=2)
    if shade:
        inside = np.minimum(loss, gain)
        ax.fill_between(z, 0, np.maximum(inside, 0), color=FIT, alpha=0.12, lw=0, zorder=0.5)
        if isinstance(limits, AccessibleFit):
            _bands(ax, limits, z, scaled)
    ax.set_xlim(low, high)
    ax.set_ylim(bottom, max(top, 1.22 * apex))


def _lines(domain: AccessibleDomain, z: Array, scaled: bool) -> tuple[Array, Array]:
    if scaled:
        return domain.loss_line(z), domain.gain_line(z)
    return domain.loss_saturation(z), domain.gain_saturation(z)


def _bands(ax: Axes, fit: AccessibleFit, z: Array, scaled: bool) -> None:
    loss, gain = fit.domain.slopes
    factor = z if scaled else np.ones_like(z)
    for edges in (
        [loss * (1 - bound / z) * factor for bound in (fit.z_min.low, fit.z_min.high)],
        [gain * (bound / z - 1) * factor for bound in (fit.z_max.low, fit.z_max.high)],
    ):
        ax.fill_between(z, edges[0], edges[1], color=FIT, alpha=0.3, lw=0, zorder=1)


def critical_marker(
    ax: Axes, limits: Limits, *, scaled: bool, colour: str = INK, label: bool = True
) -> None:
    """Draw the critical state (z*, a*), with error bars where a fit gives intervals.

    Args:
        ax: the panel.
        limits: a domain or a fit.
        scaled: the ordinate is a z instead of a.
        colour: edge of the star; the error bars have it too.
        label: enter it in the legend.
    """
    domain = as_domain(limits)
    factor = domain.z_star if scaled else 1.0
    state = domain.z_star, domain.a_star * factor
    if isinstance(limits, AccessibleFit):
        z, a = limits.z_star, limits.a_star
        ax.errorbar(
            [z.value],
            [a.value * factor],
            xerr=[[max(z.value - z.low, 0.0)], [max(z.high - z.value, 0.0)]],
            yerr=[[max(a.value - a.low, 0) * factor], [max(a.high - a.value, 0) * factor]],
            color=colour,
            lw=0.8,
            zorder=4.5,
        )
    ax.plot(
        [state[0]],
        [state[1]],
        "*",
        color=colour,
        ms=9 if label else 7.5,
        mfc="#f7d84a" if label else "white",
        mec=colour,
        mew=0.7,
        zorder=5,
        ls="none",
        label="critical state" if label else None,
    )
