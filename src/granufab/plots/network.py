"""The contact network: grains, and lines as wide as the normal force (Fig. 1)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.patches import Polygon

from granufab.errors import MissingData
from granufab.fabric import select_contacts
from granufab.fabric.neighbours import wrap
from granufab.packing import Array, Cell, Contacts, IntArray, Packing, require
from granufab.plots.style import COLUMN, INK, new_figure, style

__all__ = ["network"]


def network(
    packing: Packing,
    *,
    criterion: str = "force",
    width: float = 0.2,
    outlines: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Grains and their contacts in the cell [Radjai2012, Fig. 1].

    Grains are wrapped into the cell and clipped at its edge, so each part of a grain is drawn
    once. A line joins the centres of two touching grains; its width is proportional to the
    normal force, and equal for all where the source has no forces. Grains without contacts are
    white.

    Args:
        packing: a 2D state.
        criterion: which pairs count as contacts: force, gap:DELTA or listed.
        width: width of the line that carries the mean force [mean diameters].
        outlines: draw the grains.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, its two axes equally scaled.
    Raises:
        MissingData: the packing is three-dimensional or has no contacts.
    """
    if packing.dimension != 2:
        raise MissingData("the contact network is drawn for disks; this packing is 3D")
    contacts = select_contacts(packing, criterion)
    with style():
        corners = _corners(packing)
        extent = np.ptp(corners, axis=0)
        if ax is None:
            ax = new_figure(height=COLUMN * min(extent[1] / extent[0], 2.0))[1][0]
        ax.set_aspect("equal")
        pad = 0.01 * extent.max()
        ax.set_xlim(corners[:, 0].min() - pad, corners[:, 0].max() + pad)
        ax.set_ylim(corners[:, 1].min() - pad, corners[:, 1].max() + pad)
        outline = Polygon(corners, closed=True, fill=False, ec=INK, lw=0.6, zorder=4)
        ax.add_patch(outline)
        centre, _ = wrap(packing.grains.position, packing.cell)
        if outlines:
            _draw_grains(ax, packing, contacts, centre, outline)
        _draw_forces(ax, packing, contacts, centre, outline, width)
        ax.set_axis_off()
    return ax


def _corners(packing: Packing) -> Array:
    if packing.cell is not None:
        unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        origin = require(packing.cell.origin, "cell origin")
        return origin + unit @ packing.cell.matrix.T
    radius = packing.grains.radius[:, None]
    low = (packing.grains.position - radius).min(axis=0)
    high = (packing.grains.position + radius).max(axis=0)
    return np.array([low, [high[0], low[1]], high, [low[0], high[1]]])


def _images(points: Array, reach: Array, cell: Cell | None) -> tuple[IntArray, Array]:
    """Index and shift of each periodic copy whose circle of radius ``reach`` enters the cell."""
    index = [np.arange(len(points))]
    shift = [np.zeros_like(points)]
    if cell is None:
        return index[0], shift[0]
    origin = require(cell.origin, "cell origin")
    inverse = np.linalg.inv(cell.matrix)
    share = (points - origin) @ inverse.T
    # Distance of a point to a face, in shares of that axis: reach × |row of the inverse|.
    room = reach[:, None] * np.linalg.norm(inverse, axis=1)
    for first in (-1, 0, 1):
        for second in (-1, 0, 1):
            step = np.array([first, second])
            if not step.any() or any(step[k] and not cell.periodic[k] for k in range(2)):
                continue
            inside = ((share + step > -room) & (share + step < 1 + room)).all(axis=1)
            index.append(np.flatnonzero(inside))
            shift.append(np.tile(cell.matrix @ step, (int(inside.sum()), 1)))
    return np.concatenate(index), np.concatenate(shift)


def _draw_grains(
    ax: Axes, packing: Packing, contacts: Contacts, centre: Array, outline: Polygon
) -> None:
    radius = packing.grains.radius
    index, shift = _images(centre, radius, packing.cell)
    touching = np.zeros(len(radius), dtype=bool)
    touching[contacts.pair.ravel()] = True
    size = 2 * radius[index]
    disks = EllipseCollection(
        size,
        size,
        np.zeros(len(index)),
        units="xy",
        offsets=centre[index] + shift,
        offset_transform=ax.transData,
        facecolors=np.where(touching[index], "#e6e6e6", "#ffffff").tolist(),
        edgecolors="#a8a8a8",
        linewidths=min(0.5, 12.0 / np.sqrt(len(radius))),
        zorder=1,
    )
    ax.add_collection(disks)
    disks.set_clip_path(outline)


def _draw_forces(
    ax: Axes,
    packing: Packing,
    contacts: Contacts,
    centre: Array,
    outline: Polygon,
    width: float,
) -> None:
    if contacts.count == 0:
        return
    start = centre[contacts.pair[:, 0]]
    branch = contacts.branch
    if branch is None:
        reach = packing.grains.radius[contacts.pair].sum(axis=1)
        branch = contacts.normal * reach[:, None]
    length = np.linalg.norm(branch, axis=1)
    index, shift = _images(start + branch / 2, length / 2, packing.cell)
    first = start[index] + shift
    lines = LineCollection(
        np.stack([first, first + branch[index]], axis=1).tolist(),
        linewidths=_line_widths(ax, packing, contacts, width)[index].tolist(),
        colors="#8c1d18",
        capstyle="round",
        zorder=2,
    )
    ax.add_collection(lines, autolim=False)
    lines.set_clip_path(outline)


def _line_widths(ax: Axes, packing: Packing, contacts: Contacts, width: float) -> Array:
    """Line widths [point]: ``width`` mean diameters for the mean normal force."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    low, high = ax.get_xlim()
    box = ax.get_position()
    inch = min(
        figure.get_size_inches()[0] * box.width / (high - low),
        figure.get_size_inches()[1] * box.height / np.ptp(ax.get_ylim()),
    )
    unit = 72 * inch * 2 * float(packing.grains.radius.mean()) * width
    if contacts.force is None:
        return np.full(contacts.count, unit)
    force = np.maximum((contacts.force * contacts.normal).sum(axis=1), 0.0)
    mean = force.mean()
    return unit * (force / mean if mean > 0 else np.ones(contacts.count))
