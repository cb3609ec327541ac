"""Limit lines, accessible region and critical state on the (z, a) and (z, az) planes."""

from __future__ import annotations

from dataclasses import replace

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

    Where the data lie at negative a', as in 3D extension or after a reversal, the limits are
    drawn there: in 3D those of extension.

    Args:
        ax: panel whose limits are already set; the view is widened to hold the critical state.
        limits: a domain or a fit; the intervals of a fit's z_min and z_max become bands.
        scaled: the ordinate is a z instead of a.
        colour: of the lines.
        shade: tint the accessible region, and draw the bands.
    """
    low, high = ax.get_xlim()
    domain = as_domain(limits)
    low, high = min(low, domain.z_min - 0.02), max(high, domain.z_max + 0.02)
    z = np.linspace(max(low, 1e-3), high, 400)
    view = ax.get_ylim()
    for sign, own in _sides(limits, view, scaled):
        reached = sign * 1.22 * _apex(as_domain(own), scaled)
        view = min(view[0], reached), max(view[1], reached)
        _draw_side(ax, own, z, sign, scaled, colour, shade)
    ax.set_xlim(low, high)
    ax.set_ylim(view)


def _sides(limits: Limits, view: tuple[float, float], scaled: bool) -> list[tuple[float, Limits]]:
    """The signs of a' that the view shows, each with its limits; a ≥ 0 where it shows little."""
    domain = as_domain(limits)
    tall = 0.25 * _apex(domain, scaled)
    negative = view[0] < -tall
    sides: list[tuple[float, Limits]] = [(1.0, limits)] if view[1] > tall or not negative else []
    if negative:
        turned = domain.dimension == 3 and domain.b is None and domain.mode == "compression"
        sides.append((-1.0, replace(domain, mode="extension") if turned else limits))
    return sides


def _apex(domain: AccessibleDomain, scaled: bool) -> float:
    return domain.a_star * (domain.z_star if scaled else 1.0)


def _draw_side(
    ax: Axes, limits: Limits, z: Array, sign: float, scaled: bool, colour: str, shade: bool
) -> None:
    domain = as_domain(limits)
    loss, gain = _lines(domain, z, scaled)
    dash = (0, (5, 2))
    if not shade:
        # Several domains in one panel stay readable if each line ends at its critical state.
        apex = _apex(domain, scaled)
        loss, gain = (np.where(line <= 1.02 * apex, line, np.nan) for line in (loss, gain))
    for line in (loss, gain):
        ax.plot(z, sign * line, color=colour, lw=0.8, ls="-" if shade else dash, zorder=2)
    if shade:
        inside = np.maximum(np.minimum(loss, gain), 0)
        ax.fill_between(z, 0, sign * inside, color=FIT, alpha=0.12, lw=0, zorder=0.5)
        if isinstance(limits, AccessibleFit):
            _bands(ax, limits, z, sign, scaled)


def _lines(domain: AccessibleDomain, z: Array, scaled: bool) -> tuple[Array, Array]:
    if scaled:
        return domain.loss_line(z), domain.gain_line(z)
    return domain.loss_saturation(z), domain.gain_saturation(z)


def _bands(ax: Axes, fit: AccessibleFit, z: Array, sign: float, scaled: bool) -> None:
    loss, gain = fit.domain.slopes
    factor = sign * (z if scaled else np.ones_like(z))
    for edges in (
        [loss * (1 - bound / z) * factor for bound in (fit.z_min.low, fit.z_min.high)],
        [gain * (bound / z - 1) * factor for bound in (fit.z_max.low, fit.z_max.high)],
    ):
        ax.fill_between(z, edges[0], edges[1], color=FIT, alpha=0.3, lw=0, zorder=1)


def critical_marker(
    ax: Axes, limits: Limits, *, scaled: bool, colour: str = INK, label: bool = True
) -> None:
    """Draw the critical state (z*, a*), with error bars where a fit gives intervals.

    On the sides of a' that :func:`limit_lines` has drawn: call it first.

    Args:
        ax: the panel.
        limits: a domain or a fit.
        scaled: the ordinate is a z instead of a.
        colour: edge of the star; the error bars have it too.
        label: enter it in the legend.
    """
    named = label
    for sign, own in _sides(limits, ax.get_ylim(), scaled):
        domain = as_domain(own)
        factor = sign * (domain.z_star if scaled else 1.0)
        if isinstance(own, AccessibleFit):
            _draw_intervals(ax, own, factor, colour)
        ax.plot(
            [domain.z_star],
            [domain.a_star * factor],
            "*",
            color=colour,
            ms=9 if label else 7.5,
            mfc="#f7d84a" if label else "white",
            mec=colour,
            mew=0.7,
            zorder=5,
            ls="none",
            label="critical state" if named else None,
        )
        named = False


def _draw_intervals(ax: Axes, fit: AccessibleFit, factor: float, colour: str) -> None:
    z, a = fit.z_star, fit.a_star
    below, above = max(a.value - a.low, 0.0), max(a.high - a.value, 0.0)
    down, up = (below, above) if factor > 0 else (above, below)
    ax.errorbar(
        [z.value],
        [a.value * factor],
        xerr=[[max(z.value - z.low, 0.0)], [max(z.high - z.value, 0.0)]],
        yerr=[[down * abs(factor)], [up * abs(factor)]],
        color=colour,
        lw=0.8,
        zorder=4.5,
    )
