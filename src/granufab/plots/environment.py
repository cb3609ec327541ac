"""Two grains in contact, and a grain among its neighbours, drawn to scale (Fig. 2)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Circle, Wedge

from granufab.errors import MissingData
from granufab.fabric.environment import environment
from granufab.fabric.neighbours import branch_vectors
from granufab.packing import Array, Contacts, Packing
from granufab.plots.style import COLOURS, FIT, INK, new_figure, style

__all__ = ["contact_geometry", "grain_environment"]

FILL, EDGE = "#ececec", "#8a8a8a"
BRANCH, NORMAL, VECTOR = INK, COLOURS[1], COLOURS[0]


def contact_geometry(
    packing: Packing, contacts: Contacts, contact: int, *, ax: Axes | None = None
) -> Axes:
    """Branch ℓ, normal n and contact vector c of one contact [Radjai2012, Fig. 2a].

    For disks the three lie on one line; ℓ is drawn below it and c above it.

    Args:
        packing: a 2D state.
        contacts: its contacts that count.
        contact: which of them.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, its two axes equally scaled.
    Raises:
        MissingData: the packing is 3D.
    """
    _plane(packing)
    i, j = (int(k) for k in contacts.pair[contact])
    chosen = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    branch = branch_vectors(chosen)[contact]
    normal = contacts.normal[contact]
    across = np.array([-normal[1], normal[0]])
    one, two = packing.grains.radius[[i, j]]
    point = one * normal
    with style():
        ax = ax if ax is not None else new_figure(height=2.2)[1][0]
        for centre, radius in ((np.zeros(2), one), (branch, two)):
            ax.add_patch(Circle((centre[0], centre[1]), radius, fc=FILL, ec=EDGE, lw=0.8))
            ax.plot(*centre, "o", color=INK, ms=2.5, zorder=4)
        small = min(one, two)
        offset = 0.2 * small * across
        tangent = 0.75 * small * across
        ax.plot(*np.stack([point - tangent, point + tangent], axis=1), color=FIT, lw=0.6, ls="--")
        ax.plot([0, 0.8 * one], [0, 0], color=FIT, lw=0.6)
        _arrow(ax, np.zeros(2), branch, BRANCH)
        _arrow(ax, offset, point + offset, VECTOR)
        _arrow(ax, point, point + 0.6 * small * normal, NORMAL, 2.0)
        theta = float(np.arctan2(normal[1], normal[0]))
        _angle(ax, np.zeros(2), 0.0, theta, 0.5 * one)
        _letter(ax, 0.64 * one * np.array([np.cos(theta / 2), np.sin(theta / 2)]), r"$\theta$", INK)
        _letter(ax, 0.9 * branch - 1.1 * offset, r"$\boldsymbol{\ell}$", BRANCH)
        _letter(ax, 0.55 * point + 2.1 * offset, r"$\mathbf{c}$", VECTOR)
        _letter(ax, point + 0.45 * small * normal + 1.1 * offset, r"$\mathbf{n}$", NORMAL)
        _letter(ax, np.array([-0.2, 0.15]) * one, "$i$", INK)
        _letter(ax, branch + np.array([0.3, 0.2]) * two, "$j$", INK)
        _frame(ax, np.stack([np.zeros(2), branch]), np.array([one, two]))
    return ax


def grain_environment(
    packing: Packing, contacts: Contacts, grain: int, *, ax: Axes | None = None
) -> Axes:
    """A grain, its contact neighbours and their angular exclusions [Radjai2012, Fig. 2b].

    From each neighbour on, a shaded sector spans δθ, the angle that the sizes keep free of the
    next neighbour's centre, and the arc outside it spans the angle to the next centre, in
    degrees; the rest of that arc is the room left between two neighbours.

    Args:
        packing: a 2D state.
        contacts: its contacts that count.
        grain: index of the grain.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, its two axes equally scaled.
    Raises:
        MissingData: the packing is 3D, or the grain has fewer than two contacts.
    """
    _plane(packing)
    around = environment(packing, contacts, grain)
    radius = float(packing.grains.radius[grain])
    others = packing.grains.radius[around.neighbour]
    with style():
        ax = ax if ax is not None else new_figure(height=3.0)[1][0]
        ax.add_patch(Circle((0, 0), radius, fc="#cfcfcf", ec=EDGE, lw=0.8))
        for number, (place, size) in enumerate(zip(around.branch, others, strict=True)):
            ax.add_patch(Circle(tuple(place), size, fc=FILL, ec=EDGE, lw=0.8, zorder=0.8))
            ax.plot(*np.stack([np.zeros(2), place], axis=1), color=INK, lw=1.0, zorder=2.5)
            ax.plot(*place, "o", color=INK, ms=2.5, zorder=3)
            _letter(ax, 1.3 * place, f"${number + 1}$", INK)
        ax.plot(0, 0, "o", color=INK, ms=2.5, zorder=4)
        reach = 0.62 * radius
        for start, step, least in zip(around.angle, around.step, around.exclusion, strict=True):
            _exclusion(ax, float(start), float(least), reach)
            _angle(ax, np.zeros(2), float(start), float(start + step), 0.78 * radius)
            ray = np.array([np.cos(start + step / 2), np.sin(start + step / 2)])
            where = _free_place(ray, radius, around.branch, others)
            text = f"{np.degrees(step):.0f}°\n" rf"($\delta\theta$ {np.degrees(least):.0f}°)"
            ax.text(
                where[0],
                where[1],
                text,
                ha="center",
                va="center",
                fontsize=8,
                linespacing=1.1,
                zorder=5,
            )
        _frame(ax, np.vstack([np.zeros(2), around.branch]), np.concatenate([[radius], others]))
    return ax


def _free_place(ray: Array, radius: float, centres: Array, sizes: Array) -> Array:
    """The place nearest to the grain along a ray where a label covers no neighbour."""
    places = ray * (radius * np.arange(1.5, 3.0, 0.05))[:, None]
    room = np.linalg.norm(places[:, None] - centres, axis=-1) - sizes
    free = room.min(axis=1) > 0.42 * radius
    return places[int(np.argmax(free))] if free.any() else places[-1]


def _exclusion(ax: Axes, start: float, least: float, reach: float) -> None:
    turn = np.degrees([start, start + least])
    ax.add_patch(Wedge((0, 0), reach, *turn, fc=COLOURS[1], alpha=0.35, lw=0, zorder=2))


def _angle(ax: Axes, centre: Array, start: float, end: float, radius: float) -> None:
    low, high = np.degrees([start, end])
    arc = Arc(tuple(centre), 2 * radius, 2 * radius, theta1=low, theta2=high, color=INK, lw=0.7)
    ax.add_patch(arc)
    arc.set_zorder(2.4)


def _arrow(ax: Axes, start: Array, end: Array, colour: str, width: float = 1.1) -> None:
    ax.annotate(
        "",
        tuple(end),
        xytext=tuple(start),
        arrowprops={
            "arrowstyle": "-|>,head_length=0.45,head_width=0.18",
            "color": colour,
            "lw": width,
            "shrinkA": 0,
            "shrinkB": 0,
        },
        zorder=3,
    )


def _letter(ax: Axes, place: Array, text: str, colour: str) -> None:
    ax.text(place[0], place[1], text, color=colour, ha="center", va="center", fontsize=10, zorder=5)


def _frame(ax: Axes, centre: Array, radius: Array) -> None:
    ax.set_aspect("equal", adjustable="datalim")
    ax.update_datalim(np.vstack([centre - radius[:, None], centre + radius[:, None]]))
    ax.margins(0.02)
    ax.autoscale_view()
    ax.set_axis_off()


def _plane(packing: Packing) -> None:
    if packing.dimension != 2:
        raise MissingData("environments are drawn for disks; this packing is 3D")
