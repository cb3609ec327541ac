"""Mean velocity field around a grain: where the affine flow ends and exclusion begins (Fig. 4)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from granufab.errors import InvalidSettings, MissingData
from granufab.fabric.criterion import Criterion, parse_criterion, select_contacts
from granufab.fabric.displacements import Range, State, States, mean_motion, select_states
from granufab.fabric.neighbours import branch_vectors
from granufab.fabric.relative_velocity import (
    FEWEST_CLUSTERS,
    SHELL,
    PairSums,
    Section,
    cluster_error,
    pair_motion,
    reach_limit,
)
from granufab.fabric.variables import describe
from granufab.history import packing_of
from granufab.packing import Array, Cell, Packing, require

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["velocity_field"]

SectionName = Literal["auto", "axisymmetric", "slab"]

_REACH = {2: 4.0, 3: 3.0}
_AXIAL = 0.1
_ERROR = {
    True: "groups of consecutive states taken as independent (8 to 16 groups)",
    False: "spatial blocks taken as independent (fewer than 8 states): an upper mark",
}
_VELOCITY = "strain rate times mean branch length"


def velocity_field(
    states: States,
    *,
    window: int = 0,
    stage: int | None = None,
    strain: Range = None,
    reach: float | None = None,
    spacing: float = 0.4,
    far: float | None = None,
    criterion: str | Criterion = "force",
    section: SectionName = "auto",
    axis: Array | None = None,
    thickness: float = 1.0,
) -> xr.Dataset:
    r"""Mean relative velocity around a grain, :math:`\langle v_j-v_i\,|\,r_j-r_i\rangle`.

    [Radjai2012, Fig. 4]. Over all pairs of grains within reach, in contact or not, through the
    images of a periodic cell: v_j − v_i = c_j − c_i + L·(r_j − r_i), with c the fluctuations
    and L the cell's velocity gradient. Each pair counts both ways round. Lengths are in <ℓ>,
    the mean branch of the contacts; velocities in ε̇_q <ℓ> with each state's own ε̇_q and <ℓ>.
    States are read one at a time.

    Args:
        states: a run, frames or packings of one stage.
        window: 0 for the instantaneous velocities (in Contact Dynamics they jump); else mean
            velocities over so many frame intervals (:func:`mean_motion`), without overlap.
        stage: keep the frames of this stage.
        strain: keep the frames with ∫|dε_q| in this range.
        reach: half side of the map [<ℓ>]; default 4 in 2D, 3 in 3D, at most half of the cell.
        spacing: side of the map's boxes [<ℓ>]; the nearest that divides ``reach`` is taken.
        far: the far field begins at this distance [<ℓ>]; default half of the reach.
        criterion: contacts whose mean branch is <ℓ>.
        section: for 3D: ``axisymmetric``, the mean round the axis of the loading by distance
            from the axis (x) and along it (y); ``slab``, the plane of the largest and smallest
            principal strain rate; ``auto`` takes the one that suits the loading.
        axis: axis of the axisymmetric mean, shape (3,); default the principal strain rate that
            stands apart.
        thickness: of the slab [<ℓ>].
    Returns:
        Over ``component``, ``y``, ``x`` (box centres [<ℓ>]): velocity, affine, difference
        (velocity − affine), error (of both), position (mean of the pairs in the box). Over
        ``y``, ``x``: count. Over ``distance``: normal_share and tangential_share, the regression
        of the relative velocity along and across the branch on its affine value (1: affine;
        0: no relative motion), with errors. Over ``i``, ``j``: rate (imposed L/ε̇_q), rate_far
        and rate_far_error (least squares over the pairs of the far field). Errors take groups
        of consecutive states as independent; with fewer than 8 states spatial blocks of the
        sample, which gives too large errors. NaN where fewer than 4 of these hold pairs.
    Raises:
        MissingData: there is no state, no cell, no velocity, or no contact.
        InvalidSettings: a setting is out of range, states of several stages, or no shear.
    """
    rule = parse_criterion(criterion)
    if window < 0 or not spacing > 0:
        raise InvalidSettings(f"window must be ≥ 0 and spacing > 0, got {window} and {spacing}")
    sums: PairSums | None = None
    lengths: list[float] = []
    chosen = select_states(states, stage=stage, strain=strain)
    for packing, length in _motions(chosen, window, rule):
        if sums is None:
            plane = _section(packing, section, axis, thickness)
            sums = _empty_sums(packing, length, plane, (reach, spacing, far))
        sums.add(pair_motion(packing, length, sums.reach))
        lengths.append(length)
    if sums is None:
        raise MissingData(f"no {window + 1} states in the wanted stage and range of strain")
    return _dataset(sums).assign_attrs(
        length=float(np.mean(lengths)),
        excluded_radius=1.0,
        window=window,
        states=sums.maps.states,
        criterion=rule.text,
        section=sums.section.kind,
        basis=sums.section.basis.ravel(),
        far=sums.far,
        definition="mean of v_j - v_i over the pairs with r_j - r_i in the box, both ways round",
        error_bars=_ERROR[sums.maps.by_states],
    )


def _motions(
    states: Iterator[State], window: int, rule: Criterion
) -> Iterator[tuple[Packing, float]]:
    """States with velocities, and their <ℓ>."""
    before: State | None = None
    since = 0
    for state in states:
        since += 1
        if window == 0:
            packing = packing_of(state)
            yield packing, _mean_branch(packing, rule)
        elif before is None:
            before, since = state, 0
        elif since == window:
            yield mean_motion(before, state), _mean_branch(packing_of(before), rule)
            before, since = state, 0


def _mean_branch(packing: Packing, rule: Criterion) -> float:
    contacts = select_contacts(packing, rule)
    if contacts.count == 0:
        raise MissingData(f"there are no contacts ({rule.text}), so <ℓ> is not defined")
    chosen = Packing(grains=packing.grains, contacts=contacts, cell=packing.cell)
    return float(np.linalg.norm(branch_vectors(chosen), axis=1).mean())


def _empty_sums(
    packing: Packing,
    length: float,
    section: Section,
    grid: tuple[float | None, float, float | None],
) -> PairSums:
    reach, spacing, far = grid
    dimension = packing.dimension
    cell = require(packing.cell, "cell lengths", "give the cell of the packing")
    if reach is None:
        # A sheared cell tilts by a half at most, and <ℓ> varies little between states.
        reach = min(_REACH[dimension], 0.85 * reach_limit(cell, length))
    far = 0.5 * reach if far is None else far
    if not 0 <= far < reach:
        raise InvalidSettings(f"the far field must begin before the reach {reach:.4g}, got {far}")
    return PairSums(
        section=section,
        reach=reach,
        cells=2 * max(1, round(reach / spacing)),
        far=far,
        dimension=dimension,
    )


def _section(packing: Packing, name: str, axis: Array | None, thickness: float) -> Section:
    if name not in ("auto", "axisymmetric", "slab"):
        raise InvalidSettings(f"section {name!r} is unknown; allowed: auto, axisymmetric, slab")
    if packing.dimension == 2:
        return Section(kind="plane", basis=np.eye(2))
    cell: Cell = require(packing.cell, "cell lengths", "give the cell of the packing")
    rate = np.asarray(cell.rate)
    values, vectors = np.linalg.eigh(0.5 * (rate + rate.T))
    low, high = np.diff(values)
    if name == "auto":
        name = "axisymmetric" if min(low, high) < _AXIAL * (low + high) else "slab"
    if axis is not None or name == "axisymmetric":
        chosen = vectors[:, 0 if low >= high else 2] if axis is None else np.asarray(axis, float)
        if chosen.shape != (3,) or not np.linalg.norm(chosen) > 0:
            raise InvalidSettings(f"axis must be a non-zero vector of 3 numbers, got {axis}")
        chosen = chosen * np.sign(chosen[np.argmax(np.abs(chosen))])
        return Section(kind="axisymmetric", basis=(chosen / np.linalg.norm(chosen))[None])
    return Section(kind="slab", basis=_plane_axes(vectors[:, 1]), thickness=thickness)


def _plane_axes(normal: Array) -> Array:
    """Two unit vectors across ``normal``, along axes of the frame where these lie in the plane."""
    first, second = np.sort(np.argsort(np.abs(normal), kind="stable")[:2])
    x = np.eye(3)[first] - normal[first] * normal
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    return np.stack([x, y * (np.sign(y[second]) or 1.0)])


def _dataset(sums: PairSums) -> xr.Dataset:
    import xarray as xr  # slow to import: only where a Dataset is made

    maps = sums.folded_maps()
    whole = maps.sum(axis=0)
    count = whole[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        position, affine, difference = (whole[k : k + 2] / count for k in (1, 3, 5))
    counts = np.repeat(maps[:, :1], 2, axis=1)
    field = ("component", "y", "x")
    step = 2.0 * sums.reach / sums.cells
    y = (np.arange(sums.cells) + 0.5) * step - sums.reach
    x = (np.arange(count.shape[1]) + 0.5) * step
    if sums.section.kind != "axisymmetric":
        x = x - sums.reach
    data: dict[str, Any] = {
        "velocity": (field, affine + difference, describe("mean relative velocity", _VELOCITY)),
        "affine": (field, affine, describe("its affine part", _VELOCITY)),
        "difference": (field, difference, describe("velocity less its affine part", _VELOCITY)),
        "error": (
            field,
            cluster_error(maps[:, 5:7], counts),
            describe("standard error of velocity and difference", _VELOCITY),
        ),
        "position": (field, position, describe("mean place of the pairs", "mean branch length")),
        "count": (("y", "x"), count, describe("pairs in the box, both ways round", "-")),
    }
    data |= _profile(sums) | _far_field(sums)
    shells = (np.arange(sums.shells.by_block.shape[2]) + 0.5) * SHELL
    coordinates = {
        "x": ("x", x, describe(_axis_names(sums.section)[0], "mean branch length")),
        "y": ("y", y, describe(_axis_names(sums.section)[1], "mean branch length")),
        "component": ["x", "y"],
        "distance": ("distance", shells, describe("distance of the pair", "mean branch length")),
    }
    return xr.Dataset(data, coords=coordinates)


def _axis_names(section: Section) -> tuple[str, str]:
    if section.kind == "axisymmetric":
        return "distance from the axis", "place along the axis"
    return "first axis of the plane", "second axis of the plane"


def _profile(sums: PairSums) -> dict[str, Any]:
    shells = sums.shells.clusters
    total = shells.sum(axis=0)
    data: dict[str, Any] = {
        "pair_count": ("distance", total[0], describe("pairs in the shell, each once", "-"))
    }
    for name, k, text in (("normal", 1, "along"), ("tangential", 3, "across")):
        with np.errstate(invalid="ignore", divide="ignore"):
            share = total[k] / total[k + 1]
        error = cluster_error(shells[:, k], shells[:, k + 1])
        words = f"relative velocity {text} the branch over its affine value"
        data[f"{name}_share"] = ("distance", share, describe(words, "-"))
        data[f"{name}_share_error"] = ("distance", error, describe("standard error of it", "-"))
    return data


def _far_field(sums: PairSums) -> dict[str, Any]:
    """Least squares of the non-affine part added to the imposed L, with clusters' errors."""
    square, product = sums.far_moment.clusters.swapaxes(0, 1)
    inverse = np.linalg.pinv(square.sum(axis=0))
    excess = product.sum(axis=0) @ inverse
    residual = (product - excess @ square) @ inverse
    held = int((np.trace(square, axis1=1, axis2=2) > 0).sum())
    error = np.full_like(excess, np.nan)
    if held >= FEWEST_CLUSTERS:
        error = np.sqrt(held / (held - 1.0) * (residual**2).sum(axis=0))
    pairs, unit = ("i", "j"), "deviatoric strain rate"
    rate = sums.rate / sums.maps.states
    return {
        "rate": (pairs, rate, describe("imposed velocity gradient", unit)),
        "rate_far": (pairs, rate + excess, describe("velocity gradient of the far field", unit)),
        "rate_far_error": (pairs, error, describe("standard error of rate_far", unit)),
    }
