"""Standard errors of z and a' of a single state, by resampling its grains."""

from __future__ import annotations

import math

import numpy as np

from granufab.errors import MissingData
from granufab.fabric.coordination import ZDefinition
from granufab.fabric.criterion import Criterion
from granufab.fabric.neighbours import cell_fractions, wrap
from granufab.fabric.network import Network, select_network
from granufab.fabric.tensors import axial_anisotropy, fabric_tensor, major_direction
from granufab.packing import Array, IntArray, Packing

__all__ = ["bootstrap_errors", "network_errors"]

_BLOCK_GRAINS = 25
_FEWEST_BLOCKS = 8


def bootstrap_errors(
    packing: Packing,
    *,
    criterion: str | Criterion = "force",
    z_definition: ZDefinition = "z_backbone",
    direction: Array | None = None,
    minimum: int = 2,
    reach: float | None = None,
    replicas: int = 400,
    seed: int = 0,
) -> dict[str, float]:
    """Standard errors of z and of the signed anisotropy, from resampled blocks of grains.

    Grains are drawn with replacement in spatial blocks of about 25 neighbours; each end of a
    contact goes with its grain. Single grains would not do: a contact belongs to two of them,
    so that independent contacts would seem √2 more certain than they are. On made states of
    600 to 1000 grains the error of a' is within 10 % of the spread between replicas and that of
    z between 1 and 1.4 times it. Constraints on the whole sample (isostaticity fixes N_c given
    N_b) stay invisible to one state: replicas are better.

    Args:
        packing: positions are used to form the blocks.
        criterion: contact criterion.
        z_definition: the z, and the grains and contacts that it counts.
        direction: axis of a', shape (D,); default the state's own major direction.
        minimum: fewest contacts that hold a grain.
        reach: as for :func:`~granufab.fabric.select_contacts`.
        replicas: number of resampled states.
        seed: of the resampling.
    Returns:
        ``z`` and ``a_signed``, standard errors [-].
    Raises:
        MissingData: no contacts, or too few grains for 8 blocks.
    """
    network = select_network(
        packing, criterion=criterion, z_definition=z_definition, minimum=minimum, reach=reach
    )
    errors = network_errors(packing, network, direction=direction, replicas=replicas, seed=seed)
    return {name: errors[name] for name in ("z", "a_signed")}


def network_errors(
    packing: Packing,
    network: Network,
    *,
    direction: Array | None = None,
    replicas: int = 400,
    seed: int = 0,
) -> dict[str, float]:
    """Standard errors as :func:`bootstrap_errors`, of a network that is already picked.

    The same seed draws the same blocks, so that errors of one state under several criteria
    belong together.

    Args:
        packing: positions are used to form the blocks.
        network: contacts and grains in use.
        direction: axis of a', shape (D,); default the network's own major direction.
        replicas: number of resampled states.
        seed: of the resampling.
    Returns:
        ``z``, ``a_signed``, ``az`` (of a' times z) and ``rattler_fraction``, standard errors [-].
    Raises:
        MissingData: no contacts, or too few grains for 8 blocks.
    """
    if direction is None:
        direction = major_direction(fabric_tensor(network.contacts))
    sums = _block_sums(packing, network, np.asarray(direction, dtype=float))
    blocks = len(sums)
    if blocks < _FEWEST_BLOCKS:
        raise MissingData(
            f"a bootstrap needs {_FEWEST_BLOCKS} blocks of {_BLOCK_GRAINS} grains, "
            f"got {packing.grains.count} grains; use replicas instead"
        )
    generator = np.random.default_rng(seed)
    weight = generator.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=replicas)
    grains, ends, all_ends, along, everything, held = (weight @ sums).T
    with np.errstate(invalid="ignore", divide="ignore"):
        z = ends / grains
        square = along / all_ends
    a = axial_anisotropy(square, packing.dimension)
    # Sampling with replacement from B blocks shrinks the variance by (B − 1)/B.
    scale = math.sqrt(blocks / (blocks - 1))
    resampled = {"z": z, "a_signed": a, "az": a * z, "rattler_fraction": 1.0 - held / everything}
    return {name: scale * float(np.nanstd(value)) for name, value in resampled.items()}


def _block_sums(packing: Packing, network: Network, direction: Array) -> Array:
    """Per block: counted grains, counted contact ends, all ends of contacts in use, Σ(n·d)², all
    grains, grains of the backbone."""
    block = _blocks(packing)
    ends = network.contacts.pair.ravel()
    along = (network.contacts.normal @ direction) ** 2 / float(direction @ direction)
    owner, count = block[ends], int(block.max()) + 1
    sums = [
        np.bincount(block, weights=network.counted, minlength=count),
        np.bincount(owner, weights=network.counted[ends], minlength=count),
        np.bincount(owner, minlength=count),
        np.bincount(owner, weights=np.repeat(along, 2), minlength=count),
        np.bincount(block, minlength=count),
        np.bincount(block, weights=network.coordination.held, minlength=count),
    ]
    table = np.column_stack(sums).astype(np.float64)
    return table[np.bincount(block, minlength=count) > 0]


def _blocks(packing: Packing) -> IntArray:
    """Index of each grain's block of a regular grid, shape (grain_count,)."""
    position, cell = packing.grains.position, packing.cell
    if cell is not None:
        fraction = cell_fractions(wrap(position, cell)[0], cell)
    else:
        low = position.min(axis=0)
        fraction = (position - low) / np.maximum(position.max(axis=0) - low, 1e-300)
    side = max(1, round((len(position) / _BLOCK_GRAINS) ** (1.0 / packing.dimension)))
    index = np.clip((fraction * side).astype(np.int64), 0, side - 1)
    return index @ (side ** np.arange(packing.dimension))
