"""Frictional problems (W, q, mu) built from bodies, shared by tests."""

from __future__ import annotations

import itertools

import numpy as np


def tower(boxes: int, *, g_step: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """(W, q) of cubes of side 1 and mass 1 on a floor, four contacts at each joint.

    Contact frames (n up, x, y); q is one step's fall h g. W has rank 6·boxes at most.
    """
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=2)))
    H = np.zeros((12 * boxes, 6 * boxes))
    axes = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for joint, (k, corner) in itertools.product(range(boxes), enumerate(corners)):
        for row, axis in enumerate(axes):
            at = 12 * joint + 3 * k + row
            for body, height, sign in ((joint, -0.5, 1.0), (joint - 1, 0.5, -1.0)):
                if body >= 0:
                    arm = np.array([*corner, height])
                    H[at, 6 * body : 6 * body + 3] += sign * axis
                    H[at, 6 * body + 3 : 6 * body + 6] += sign * np.cross(arm, axis)
    inverse = np.tile([1.0, 1, 1, 6, 6, 6], boxes)
    fall = np.tile([0.0, 0, -g_step, 0, 0, 0], boxes)
    return H @ (inverse[:, None] * H.T), H @ fall


def random_bodies(
    rng: np.random.Generator, contacts: int, dimension: int, freedoms: int
) -> tuple[np.ndarray, np.ndarray]:
    """(W, q) of ``freedoms`` velocities met at random by the contacts; solvable (u = 0 exists)."""
    H = rng.standard_normal((dimension * contacts, freedoms))
    return H @ H.T / freedoms, H @ rng.standard_normal(freedoms)


def enumerate_2d(W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> list[np.ndarray]:
    """Velocities of every solution of a small 2D problem: open, stick, slide ± at each contact."""
    found = []
    for states in itertools.product(("open", "stick", 1.0, -1.0), repeat=len(mu)):
        rows, columns = [], []
        for c, state in enumerate(states):
            unit = np.zeros((len(q), 2))
            unit[2 * c, 0] = unit[2 * c + 1, 1] = 1.0
            if state == "stick":
                columns += [unit[:, 0], unit[:, 1]]
                rows += [2 * c, 2 * c + 1]
            elif state != "open":
                columns.append(unit[:, 0] + state * mu[c] * unit[:, 1])
                rows.append(2 * c)
        r = np.zeros(len(q))
        if rows:
            basis = np.column_stack(columns)
            r = basis @ np.linalg.solve((W @ basis)[rows], -q[rows])
        u = W @ r + q
        if _is_solution(states, r.reshape(-1, 2), u.reshape(-1, 2), mu):
            found.append(u)
    return found


def _is_solution(states: tuple, r: np.ndarray, u: np.ndarray, mu: np.ndarray) -> bool:
    small = 1e-12
    for c, state in enumerate(states):
        if u[c, 0] < -small or r[c, 0] < -small:
            return False
        if state == "stick" and abs(r[c, 1]) > mu[c] * r[c, 0] + small:
            return False
        if isinstance(state, float) and state * u[c, 1] > small:
            return False
    return True
