"""Dense packed states of any size, cheaply: a small periodic sample repeated along every axis.

Copies of a state at equilibrium are in equilibrium, contact by contact, so the tiled state has
the stress, coordination and residual of its source. Copies alike would make the solver's work
alike too; so velocities and forces can be shaken a little, and a sheared state is sheared on
until its copies differ.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from granufab.errors import InvalidSettings
from granufab.kernels.neighbours import morton_order
from granufab.packing import Array, Cell, Contacts, Grains, IntArray, Packing, require
from granufab.simulate import Biaxial, Loading, Record, compress, random_sample, shear
from granufab.simulate.scales import Scales

__all__ = [
    "FRICTION",
    "biaxial_loading",
    "copies_for",
    "isotropic_state",
    "sheared_state",
    "tile",
]

FRICTION = 0.4
COMPACTION_FRICTION = 0.3
INERTIAL_NUMBER = 1e-3
SHEARED_STRAIN, FURTHER_STRAIN = 0.2, 0.01
SHAKEN_FORCE, SHAKEN_VELOCITY = 0.05, 1e-3
SOURCE_SIZES = {2: 800, 3: 400}
FEWEST = 20
SEED = 1


def tile(packing: Packing, copies: int, *, shake: float = 0.0, seed: int = SEED) -> Packing:
    """Repeat a fully periodic packing ``copies`` times along every axis.

    Grains are numbered afresh along a Z-curve, as the samples' are.

    Args:
        packing: with contacts, their images and a periodic cell.
        copies: along each axis.
        shake: 1 changes each force by a random share up to 5 % and each velocity by up to 10⁻³
            of d/√(m/p) (2D); 0 leaves exact copies.
        seed: of the random changes.
    Raises:
        MissingData: contacts, their images or the cell are missing.
        InvalidSettings: the cell is not fully periodic, or there is less than one copy.
    """
    cell = require(packing.cell, "the cell", "give Packing.cell")
    contacts = require(packing.contacts, "contacts")
    if copies < 1 or not all(cell.periodic):
        raise InvalidSettings(
            f"tiling takes a fully periodic packing and at least 1 copy, got {copies} copies of "
            f"one with periodic = {cell.periodic}"
        )
    offset = _grid(copies, packing.dimension)
    origin = np.zeros(packing.dimension) if cell.origin is None else cell.origin
    wide = Cell(matrix=cell.matrix * copies, periodic=cell.periodic, origin=origin, rate=cell.rate)
    position = packing.grains.position + (offset @ cell.matrix.T)[:, None]
    position = position.reshape(-1, packing.dimension)
    order = morton_order(position, origin, np.linalg.inv(wide.matrix))
    generator = np.random.default_rng(np.random.SeedSequence(seed))
    new = replace(
        packing,
        grains=_repeated(packing.grains, len(offset), position, order),
        contacts=_linked(contacts, packing.grains.count, copies, offset, np.argsort(order)),
        cell=wide,
        wall_contacts=None,
        source=f"{packing.source}, {len(offset)} copies",
    )
    return _shaken(new, shake, generator) if shake else new


def _grid(copies: int, dimension: int) -> IntArray:
    axes = np.meshgrid(*[np.arange(copies)] * dimension, indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1).astype(np.int64)


def _repeated(grains: Grains, times: int, position: Array, order: IntArray) -> Grains:
    def copied(value: Array | None) -> Array | None:
        return None if value is None else np.concatenate([value] * times)[order]

    return Grains(
        position=position[order],
        radius=np.tile(grains.radius, times)[order],
        mass=copied(grains.mass),
        velocity=copied(grains.velocity),
        spin=copied(grains.spin),
    )


def _linked(
    contacts: Contacts, count: int, copies: int, offset: IntArray, place: IntArray
) -> Contacts:
    """Contacts of every copy; those across the old cell's faces join neighbouring copies.

    ``place`` tells the new number of grain i of copy k, which is item k·count + i.
    """
    image = require(contacts.image, "images of the contacts")
    dimension, times = offset.shape[1], len(offset)
    target = (offset[:, None] + image).reshape(-1, dimension)
    inside = np.ravel_multi_index((target % copies).T, (copies,) * dimension)
    first = (np.arange(times)[:, None] * count + contacts.pair[:, 0]).ravel()
    second = inside * count + np.tile(contacts.pair[:, 1], times)

    def copied(value: Array | None) -> Array | None:
        return None if value is None else np.concatenate([value] * times)

    return Contacts(
        pair=np.stack([place[first], place[second]], axis=1),
        normal=np.concatenate([contacts.normal] * times),
        branch=copied(contacts.branch),
        gap=copied(contacts.gap),
        force=copied(contacts.force),
        image=target // copies,
    )


def _shaken(packing: Packing, shake: float, generator: np.random.Generator) -> Packing:
    grains, contacts = packing.grains, require(packing.contacts, "contacts")
    force = require(contacts.force, "contact forces")
    scales = Scales.of(packing, 1.0)
    velocity = np.zeros_like(grains.position) if grains.velocity is None else grains.velocity
    speed = shake * SHAKEN_VELOCITY * scales.diameter / scales.time
    share = 1 + shake * SHAKEN_FORCE * generator.uniform(-1, 1, len(force))
    return replace(
        packing,
        grains=replace(
            grains, velocity=velocity + speed * generator.uniform(-1, 1, velocity.shape)
        ),
        contacts=replace(contacts, force=force * share[:, None]),
    )


def copies_for(grain_count: int, dimension: int, source: int | None = None) -> tuple[int, int]:
    """(copies along each axis, grains of the source) that together make about ``grain_count``.

    Args:
        grain_count: wanted.
        dimension: 2 or 3.
        source: grains that a source has at most; default 800 disks or 400 spheres.
    Raises:
        InvalidSettings: fewer than 20 grains a copy.
    """
    largest = source or SOURCE_SIZES[dimension]
    copies = max(1, int(np.ceil((grain_count / largest) ** (1 / dimension) - 1e-9)))
    count = round(grain_count / copies**dimension)
    if count < FEWEST:
        raise InvalidSettings(
            f"{grain_count} grains in copies of at most {largest}, allowed from {FEWEST} a copy"
        )
    return copies, count


@cache
def _isotropic_source(grain_count: int, dimension: int) -> Packing:
    start = random_sample(grain_count, dimension=dimension, seed=SEED)
    return compress(start, friction=COMPACTION_FRICTION)


@cache
def _sheared_source(grain_count: int, strain: float) -> Packing:
    return _biaxial(_isotropic_source(grain_count, 2), strain)


def _biaxial(packing: Packing, strain: float) -> Packing:
    run = shear(
        packing,
        strain=strain,
        friction=FRICTION,
        inertial_number=INERTIAL_NUMBER,
        loading="biaxial",
        record_settings=Record(frame_interval=strain, series_interval=strain),
    )
    return run.frames[-1].packing


def isotropic_state(
    grain_count: int, dimension: int = 2, *, source: int | None = None, shake: float = 1.0
) -> Packing:
    """About ``grain_count`` grains at rest under p = 1."""
    copies, count = copies_for(grain_count, dimension, source)
    return tile(_isotropic_source(count, dimension), copies, shake=shake)


def biaxial_loading(packing: Packing) -> Loading:
    """Biaxial compression at the inertial number of the sheared states, p = 1."""
    rate = INERTIAL_NUMBER / Scales.of(packing, 1.0).inertial_time
    return Biaxial(axial_rate=rate / 2)


@cache
def sheared_state(
    grain_count: int,
    *,
    source: int | None = None,
    strain: float = SHEARED_STRAIN,
    further: float = FURTHER_STRAIN,
) -> Packing:
    """About ``grain_count`` disks in biaxial compression at ε_q = ``strain``.

    Args:
        grain_count: wanted.
        source: grains of the source at most.
        strain: ε_q of the source.
        further: ε_q after tiling, in which the shaken copies come to differ.
    """
    copies, count = copies_for(grain_count, 2, source)
    tiled = tile(_sheared_source(count, strain), copies, shake=1.0)
    return _biaxial(tiled, further) if further > 0 else tiled
