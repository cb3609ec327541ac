"""The small packing that the scripts beside this file write in the layouts of other programs.

It comes from a run of granufab itself. z, a and q/p are counted here with numpy alone, so that no
measure is checked by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np

import granufab as gf
from granufab.packing import Array, Cell, Contacts, Grains, Packing
from granufab.simulate.settings import Sample, Solver

__all__ = [
    "box", "compared", "counted", "counted_by_gap", "disks", "edges", "lines", "parts", "points",
    "spheres",
]  # fmt: skip


def disks(seed: int = 1) -> Packing:
    """200 disks, compressed and then sheared by 3 %."""
    return _sheared(2, 200, seed)


def spheres(seed: int = 1) -> Packing:
    """150 spheres, compressed and then sheared by 3 %."""
    return _sheared(3, 150, seed)


@cache
def _sheared(dimension: Any, count: int, seed: int) -> Packing:
    """The last state, its grains within the periodic cell, with the contacts that bear.

    Branches and normals are those of the positions: a run keeps those of the middle of its step.
    """
    solver = Solver(tolerance=1e-3)
    sample = gf.prepare(Sample(grain_count=count, dimension=dimension, friction=0.1, seed=seed))
    run = gf.shear(sample.packing, strain=0.03, inertial_number=5e-3, solver=solver)
    state = run.frames[-1].packing
    position = np.mod(state.grains.position - state.cell.origin, edges(state))
    push = np.einsum("ci,ci->c", state.contacts.force, state.contacts.normal)
    found = state.contacts.select(push > 1e-6 * push.mean())
    branch = position[found.pair[:, 1]] - position[found.pair[:, 0]]
    branch -= edges(state) * np.round(branch / edges(state))
    length = np.linalg.norm(branch, axis=1)
    return Packing(
        grains=Grains(position=position, radius=state.grains.radius, mass=state.grains.mass),
        contacts=Contacts(
            pair=found.pair,
            normal=branch / length[:, None],
            branch=branch,
            gap=length - state.grains.radius[found.pair].sum(axis=1),
            force=found.force,
        ),
        cell=Cell(matrix=state.cell.matrix),
        time=2.5,
    )


def edges(packing: Packing) -> Array:
    """Edges of the cell, which begins at the origin."""
    return np.diag(packing.cell.matrix)


def box(packing: Packing) -> tuple[float, ...]:
    """Lower corner and edges, as ``granufab.read`` takes them for files without a cell."""
    return (*[0.0] * packing.dimension, *edges(packing).tolist())


def parts(packing: Packing) -> tuple[Array, Array]:
    """Normal forces [shape (contact_count,)] and tangential ones (vectors) on the second grain."""
    contacts = packing.contacts
    push = np.einsum("ci,ci->c", contacts.force, contacts.normal)
    return push, contacts.force - push[:, None] * contacts.normal


def points(packing: Packing) -> Array:
    """Contact points, in the middle of the overlap, at the side of the first grain."""
    first, contacts = packing.contacts.pair[:, 0], packing.contacts
    reach = packing.grains.radius[first] + 0.5 * contacts.gap
    return packing.grains.position[first] + reach[:, None] * contacts.normal


def lines(*columns: Any, mark: str = " ") -> str:
    """Rows of text; a column is an array of numbers, of vectors, or one word for all rows."""
    count = max(len(column) for column in columns if isinstance(column, np.ndarray))
    rows = []
    for k in range(count):
        words: list[str] = []
        for column in columns:
            if isinstance(column, np.ndarray):
                words += [f"{number:.12g}" for number in np.atleast_1d(column[k])]
            else:
                words.append(str(column))
        rows.append(mark.join(words) + "\n")
    return "".join(rows)


def counted(packing: Packing) -> dict[str, float]:
    """z over all grains, a and q/p of the listed contacts."""
    contacts, dimension = packing.contacts, packing.dimension
    values = _of_normals(contacts.normal, packing.grains.count)
    stress = contacts.force.T @ contacts.branch
    principal = np.linalg.eigvalsh(0.5 * (stress + stress.T))
    deviator = (principal[-1] - principal[0]) / (2 if dimension == 2 else 3)
    return values | {"q_over_p": deviator / principal.mean()}


def counted_by_gap(packing: Packing, gap: float = 0.0) -> dict[str, float]:
    """z over all grains and a of all pairs at most ``gap`` mean diameters apart."""
    grains, size = packing.grains, edges(packing)
    reach = 2 * gap * grains.radius.mean()
    normals = []
    for i, j in combinations(range(grains.count), 2):
        branch = grains.position[j] - grains.position[i]
        branch -= size * np.round(branch / size)
        length = np.linalg.norm(branch)
        if length <= grains.radius[i] + grains.radius[j] + reach:
            normals.append(branch / length)
    return _of_normals(np.array(normals), grains.count)


def _of_normals(normal: Array, grain_count: int) -> dict[str, float]:
    low, *_, high = np.linalg.eigvalsh(normal.T @ normal / len(normal))
    factor = 2.0 if normal.shape[1] == 2 else 2.5
    return {"z": 2 * len(normal) / grain_count, "a": factor * float(high - low)}


def compared(found: Mapping[str, Any], wanted: Mapping[str, float]) -> float:
    """Print both and return their largest difference."""
    for name, value in wanted.items():
        print(f"{name:<9} counted {value:.6f}   granufab {found[name]:.6f}")
    return max(abs(found[name] - value) for name, value in wanted.items())
