"""Small dumps that the tests write: a lattice of spheres in a tilted periodic box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lattice:
    """Spheres at s = (k + 1/2 + noise)/n in a box H with origin o: state of one step."""

    step: int
    matrix: Array
    origin: Array
    fraction: Array
    radius: Array
    number: NDArray[np.int64]

    @property
    def position(self) -> Array:
        return self.origin + self.fraction @ self.matrix.T


def lattice(step: int = 0, tilt: float = 0.0, side: int = 4, seed: int = 1) -> Lattice:
    """``side``³ spheres of radius about 1/2 that touch neighbours through all faces."""
    generator = np.random.default_rng(seed)
    edge = 0.97 * side
    matrix = np.array([[edge, tilt * edge, 0.1], [0, edge, -0.2], [0, 0, edge]])
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    fraction = (grid + 0.5 + generator.uniform(-0.01, 0.01, grid.shape)) / side
    number = generator.permutation(len(grid)) + 1
    radius = generator.uniform(0.49, 0.53, len(grid))
    return Lattice(step, matrix, np.array([-1.0, 2.0, 0.5]), fraction, radius, number)


def contacts(state: Lattice, normal: float = 100.0, shear: float = 5.0) -> list[list[float]]:
    """Rows id id dist f(3) t(3), force on the first, by trying all pairs and all 27 images."""
    rows = []
    position, moves = state.position, np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), -1).reshape(-1, 3)
    shifts = moves @ state.matrix.T
    for i in range(len(position)):
        for j in range(i + 1, len(position)):
            for branch in position[j] - position[i] + shifts:
                length = float(np.linalg.norm(branch))
                overlap = state.radius[i] + state.radius[j] - length
                if overlap > 0:
                    n = branch / length
                    t = np.cross(n, [0.3, 0.5, 0.8])
                    f = -normal * overlap * n
                    ids = [float(state.number[i]), float(state.number[j])]
                    rows.append([*ids, length, *f, *(shear * overlap * t)])
    return rows


def bounds(state: Lattice, flags: str = "pp pp pp") -> str:
    """BOX BOUNDS of a tilted box: those of the box around it."""
    corners = np.stack(np.meshgrid(*[(0, 1)] * 3), -1).reshape(-1, 3) @ state.matrix.T
    low, high = state.origin + corners.min(axis=0), state.origin + corners.max(axis=0)
    tilts = state.matrix[0, 1], state.matrix[0, 2], state.matrix[1, 2]
    rows = np.column_stack([low, high, tilts]).tolist()
    lines = [" ".join(repr(value) for value in row) for row in rows]
    return f"ITEM: BOX BOUNDS xy xz yz {flags}\n" + "\n".join(lines) + "\n"


def atoms_text(state: Lattice, kind: str = "x", flags: str = "pp pp pp", box: str = "") -> str:
    """One frame of an atom dump with coordinates of a kind."""
    scaled = {"x": state.position, "xu": state.position, "xs": state.fraction}
    wanted = scaled.get(kind, state.fraction)
    axes = " ".join(kind.replace("x", axis, 1) for axis in "xyz")
    text = f"ITEM: TIMESTEP\n{state.step}\nITEM: NUMBER OF ATOMS\n{len(state.radius)}\n"
    text += (box or bounds(state, flags)) + f"ITEM: ATOMS type {axes} id diameter vx vy vz\n"
    for k, r in enumerate(state.radius):
        x, y, z = wanted[k].tolist()
        text += f"1 {x!r} {y!r} {z!r} {state.number[k]} {float(2 * r)!r} 0.5 {k} -1e-3 \n"
    return text


def local_text(state: Lattice, rows: list[list[float]], names: str = "") -> str:
    """One frame of a local dump."""
    text = f"ITEM: TIMESTEP\n{state.step}\nITEM: NUMBER OF ENTRIES\n{len(rows)}\n" + bounds(state)
    names = names or "index c_p[1] c_p[2] " + " ".join(f"c_l[{k}]" for k in range(1, 8))
    text += f"ITEM: ENTRIES {names}\n"
    for k, row in enumerate(rows, 1):
        numbers = " ".join(f"{value:.15g}" for value in row)
        text += f"{k} {numbers} \n"
    return text
