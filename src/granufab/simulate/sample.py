"""Grain sizes and the dilute random start."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from granufab.errors import InvalidSettings
from granufab.kernels.insertion import insert_randomly
from granufab.kernels.neighbours import morton_order
from granufab.packing import Array, Cell, Grains, Packing
from granufab.simulate.settings import Sizes

__all__ = ["draw_radii", "grain_mass", "random_sample"]

RANDOM_LIMIT = {2: 0.5, 3: 0.32}
RANDOM_DEFAULT = {2: 0.45, 3: 0.3}


def draw_radii(
    grain_count: int,
    sizes: Sizes,
    *,
    diameter: float = 1.0,
    dimension: int = 2,
    generator: np.random.Generator,
) -> Array:
    """Radii of a size distribution, scaled so that the mean diameter is ``diameter`` [m].

    Args:
        grain_count: how many.
        sizes: the distribution; ``uniform-by-volume`` is uniform in grain area (2D) or volume
            (3D) over diameters d (1 ± spread): each diameter class holds equal solid volume.
        diameter: mean diameter [m]; a file's radii are used as they are.
        dimension: 2 or 3.
        generator: random stream.
    Raises:
        InvalidSettings: the file is missing, holds no number or too few.
    """
    if sizes.kind == "file":
        return _read_radii(Path(str(sizes.file)), grain_count)
    if sizes.kind == "monodisperse":
        drawn = np.ones(grain_count)
    elif sizes.kind == "bidisperse":
        drawn = np.ones(grain_count)
        drawn[: round(sizes.large_fraction * grain_count)] = sizes.ratio
        generator.shuffle(drawn)
    elif sizes.kind == "log-normal":
        drawn = np.exp(sizes.spread * generator.standard_normal(grain_count))
    elif sizes.kind == "uniform":
        drawn = generator.uniform(1 - sizes.spread, 1 + sizes.spread, grain_count)
    else:
        drawn = _uniform_by_volume(grain_count, sizes.spread, dimension, generator)
    return 0.5 * diameter * drawn / drawn.mean()


def _uniform_by_volume(
    count: int, spread: float, dimension: int, generator: np.random.Generator
) -> Array:
    """Density of diameters ∝ d^{−D}, so that solid volume is uniform in d (inverse transform)."""
    low, high = 1 - spread, 1 + spread
    if spread == 0:
        return np.ones(count)
    power = 1 - dimension
    drawn = generator.uniform(0, 1, count)
    return (low**power + drawn * (high**power - low**power)) ** (1 / power)


def _read_radii(path: Path, grain_count: int) -> Array:
    try:
        text = path.read_text(encoding="utf-8").split()
    except OSError as error:
        raise InvalidSettings(f"sample.sizes.file {path}: cannot be read ({error})") from None
    try:
        radii = np.array([float(word) for word in text])
    except ValueError as error:
        raise InvalidSettings(f"sample.sizes.file {path}: {error}") from None
    if len(radii) < grain_count:
        raise InvalidSettings(
            f"sample.sizes.file {path} holds {len(radii)} radii, grain_count is {grain_count}"
        )
    if not (np.isfinite(radii).all() and (radii > 0).all()):
        raise InvalidSettings(f"sample.sizes.file {path}: every radius must be finite and > 0")
    return radii[:grain_count]


def grain_mass(radius: Array, density: float, dimension: int) -> Array:
    """Mass of disks, π R² ρ (per length), or spheres, (4/3) π R³ ρ [kg]."""
    if dimension == 2:
        return density * math.pi * radius**2
    return density * (4 / 3) * math.pi * radius**3


def random_sample(
    grain_count: int,
    *,
    dimension: int = 2,
    sizes: Sizes | None = None,
    diameter: float = 1.0,
    density: float = 1.0,
    solid_fraction: float | None = None,
    boundary: str = "periodic",
    seed: int = 1,
) -> Packing:
    """Dilute random packing without contacts, in a square or cubic cell.

    Args:
        grain_count: number of grains.
        dimension: 2 or 3.
        sizes: distribution of diameters; default uniform ±20 %.
        diameter: mean diameter d [m].
        density: [kg/m²] in 2D, [kg/m³] in 3D.
        solid_fraction: wanted φ, at most 0.5 (2D) or 0.32 (3D); default 0.45 or 0.3.
        boundary: "periodic" or "walls".
        seed: of the random stream; the same seed gives the same bits.
    Raises:
        InvalidSettings: grain_count is not positive, or the solid fraction is out of reach.
    """
    if grain_count < 1:
        raise InvalidSettings(f"grain_count is {grain_count}, must be at least 1")
    sizes = sizes or Sizes()
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    radius = draw_radii(
        grain_count, sizes, diameter=diameter, dimension=dimension, generator=generator
    )
    mass = grain_mass(radius, density, dimension)
    fraction = RANDOM_DEFAULT[dimension] if solid_fraction is None else solid_fraction
    if fraction > RANDOM_LIMIT[dimension]:
        raise InvalidSettings(
            f"solid_fraction is {fraction}, random placing in {dimension}D allows up to "
            f"{RANDOM_LIMIT[dimension]}"
        )
    edge = (float(mass.sum()) / density / fraction) ** (1 / dimension)
    edge = max(edge, 2.05 * float(radius.max()))
    largest_first = np.argsort(-radius, kind="stable")
    periodic = np.full(dimension, boundary == "periodic")
    position, placed = insert_randomly(
        radius[largest_first],
        np.full(dimension, edge),
        periodic,
        100_000,
        int(generator.integers(2**31)),
    )
    if placed < grain_count:
        raise InvalidSettings(
            f"only {placed} of {grain_count} grains fit at solid fraction {fraction}; "
            "lower sample.solid_fraction"
        )
    matrix = np.eye(dimension) * edge
    order = morton_order(position, np.zeros(dimension), np.linalg.inv(matrix))
    keep = largest_first[order]
    return Packing(
        grains=Grains(
            position=position[order],
            radius=radius[keep],
            mass=mass[keep],
            velocity=np.zeros((grain_count, dimension)),
            spin=np.zeros((grain_count, 1 if dimension == 2 else 3)),
        ),
        cell=Cell(matrix=matrix, periodic=tuple(bool(p) for p in periodic)),
        time=0.0,
        source=f"random_sample(grain_count={grain_count}, seed={seed})",
    )
