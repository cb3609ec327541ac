"""The contact network of spheres: a part of the packing, seen in depth (Fig. 1)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgb

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric import branch_vectors, select_contacts
from granufab.fabric.neighbours import wrap
from granufab.packing import Array, IntArray, Packing
from granufab.plots.style import COLUMN, new_figure, style

__all__ = ["network_3d"]

ELEVATION, AZIMUTH = 18.0, 32.0
"""Direction of the view, above and around the vertical [degree]."""

BOND, GRAIN, GRAIN_EDGE = "#8c1d18", "#d4d4d4", "#9a9a9a"
FADE = 0.9
"""How far the farthest item fades into the paper."""


def network_3d(
    packing: Packing,
    *,
    criterion: str = "force",
    part: float | None = 8.0,
    width: float = 0.08,
    grains: float = 0.3,
    up: int = 1,
    ax: Axes | None = None,
) -> Axes:
    """Contacts between spheres in a part of the packing [Radjai2012, Fig. 1].

    The part is a ball about the middle of the cell, so that it looks alike from every side; where
    it is larger than a periodic cell, images are drawn too. What lies farther from the eye is
    paler. A line joins the centres of two touching grains, its width
    proportional to the normal force (equal for all where the source has no forces). Grains are
    drawn smaller than they are, or the network would hide behind them; only those with a contact
    are shown.

    Args:
        packing: a 3D state.
        criterion: which pairs count as contacts: force, gap:DELTA or listed.
        part: diameter of the part that is drawn [mean diameters]; None for everything.
        width: width of the line that carries the mean force [mean diameters].
        grains: drawn size of a grain over its true size; 0 for none.
        up: axis that stands upright, 0, 1 or 2.
        ax: panel to draw into; a new column-wide figure by default.
    Returns:
        The panel, its two axes equally scaled.
    Raises:
        MissingData: the packing is two-dimensional or has no contacts in the part.
        InvalidSettings: ``up`` is no axis.
    """
    if packing.dimension != 3:
        raise MissingData("network_3d draws spheres; this packing is 2D, use network")
    if up not in (0, 1, 2):
        raise InvalidSettings(f"up is {up}, must be 0, 1 or 2")
    start, branch, pair, force = _bonds(packing, criterion, part)
    if not len(pair):
        raise MissingData("there are no contacts in the part that is drawn")
    diameter = 2 * float(packing.grains.radius.mean())
    with style():
        ax = ax if ax is not None else new_figure(height=COLUMN)[1][0]
        axes = _view(up)
        ends = np.stack([start, start + branch], axis=1) @ axes.T
        ax.set_aspect("equal")
        reach = 1.02 * (np.abs(ends[..., :2]).max() + grains * packing.grains.radius.max())
        ax.set_xlim(-reach, reach)
        ax.set_ylim(-reach, reach)
        unit = _points_per_length(ax, 2 * reach)
        lines = width * diameter * unit * force
        radius = grains * packing.grains.radius[pair]
        _draw(ax, ends, lines, radius)
        ax.set_axis_off()
    return ax


def _bonds(
    packing: Packing, criterion: str, part: float | None
) -> tuple[Array, Array, IntArray, Array]:
    """Start, branch, grains and force over its mean of the bonds in the part."""
    contacts = select_contacts(packing, criterion)
    chosen = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    branch = branch_vectors(chosen)
    centre, _ = wrap(packing.grains.position, packing.cell)
    middle = _middle(packing)
    start = centre[contacts.pair[:, 0]] - middle
    force = np.ones(contacts.count)
    if contacts.force is not None:
        force = np.maximum((contacts.force * contacts.normal).sum(axis=1), 0.0)
        force = force / (force.mean() or 1.0)
    keep = np.ones(contacts.count, dtype=bool)
    if part is not None:
        start, branch, owner = _with_images(packing, start, branch)
        contacts_pair, force = contacts.pair[owner], force[owner]
        half = 0.5 * part * 2 * float(packing.grains.radius.mean())
        keep = np.linalg.norm(start + branch / 2, axis=1) < half
        return start[keep], branch[keep], contacts_pair[keep], force[keep]
    return start, branch, contacts.pair, force


def _with_images(packing: Packing, start: Array, branch: Array) -> tuple[Array, Array, IntArray]:
    """Bonds and the copies of them in the neighbouring cells, with the bond each one is of."""
    count = len(start)
    if packing.cell is None:
        return start, branch, np.arange(count)
    steps = [range(-1, 2) if periodic else (0,) for periodic in packing.cell.periodic]
    shifts = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    moved = (shifts @ packing.cell.matrix.T)[:, None, :] + start[None]
    copies = len(shifts)
    return moved.reshape(-1, 3), np.tile(branch, (copies, 1)), np.tile(np.arange(count), copies)


def _middle(packing: Packing) -> Array:
    if packing.cell is None:
        return packing.grains.position.mean(axis=0)
    origin = packing.cell.origin if packing.cell.origin is not None else np.zeros(3)
    return origin + packing.cell.matrix.sum(axis=1) / 2


def _view(up: int) -> Array:
    """Unit vectors to the right, upwards and towards the eye, as rows."""
    vertical = np.eye(3)[up]
    front, side = np.eye(3)[(up + 1) % 3], np.eye(3)[(up + 2) % 3]
    elevation, azimuth = np.radians(ELEVATION), np.radians(AZIMUTH)
    flat = np.cos(azimuth) * front + np.sin(azimuth) * side
    eye = np.cos(elevation) * flat + np.sin(elevation) * vertical
    right = np.cross(vertical, eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def _points_per_length(ax: Axes, length: float) -> float:
    figure = ax.get_figure(root=True)
    assert figure is not None
    box = ax.get_position()
    inch = figure.get_size_inches() * np.array([box.width, box.height])
    return float(72 * inch.min() / length)


def _draw(ax: Axes, ends: Array, lines: Array, radius: Array) -> None:
    """Bonds from back to front; each end carries its grain, at the depth of the centre."""
    depth = ends[..., 2]
    low, high = float(depth.min()), float(depth.max())
    near = (depth - low) / max(high - low, 1e-30)
    for layer in np.array_split(np.argsort(depth.mean(axis=1), kind="stable"), 24):
        if not len(layer):
            continue
        share = float(near[layer].mean())
        height = 1 + share
        flat = ends[layer][..., :2]
        halo = LineCollection(
            list(flat), linewidths=lines[layer] + 0.7, colors="white", zorder=height
        )
        bond = LineCollection(
            list(flat),
            linewidths=lines[layer],
            colors=_faded(BOND, share),
            capstyle="round",
            zorder=height + 1e-4,
        )
        size = 2 * radius[layer].ravel()
        balls = EllipseCollection(
            size,
            size,
            np.zeros(len(size)),
            units="xy",
            offsets=flat.reshape(-1, 2),
            offset_transform=ax.transData,
            facecolors=_faded(GRAIN, share),
            edgecolors=_faded(GRAIN_EDGE, share),
            linewidths=0.3,
            zorder=height + 2e-4,
        )
        for item in (halo, bond, balls):
            ax.add_collection(item, autolim=False)


def _faded(colour: str, share: float) -> tuple[float, float, float]:
    """A colour mixed with the white of the paper, the more the farther it is."""
    mix = FADE * (1 - share) ** 1.5
    red, green, blue = (float(c * (1 - mix) + mix) for c in to_rgb(colour))
    return red, green, blue
