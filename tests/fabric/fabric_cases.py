"""States with a known fabric, shared by the tests of the measures."""

from __future__ import annotations

import numpy as np

from granufab.packing import Cell, Contacts, Grains, Packing


def lattice(vectors, repeats=1, radius=0.5):
    """A Bravais lattice of touching grains; ``vectors`` are rows."""
    vectors = np.array(vectors, dtype=float)
    steps = np.stack(np.meshgrid(*[np.arange(repeats)] * len(vectors)), axis=-1)
    position = steps.reshape(-1, len(vectors)) @ vectors
    matrix = repeats * vectors.T
    return Packing(
        grains=Grains(position=position, radius=np.full(len(position), radius)),
        cell=Cell(matrix=matrix),
    )


def hexagonal(repeats=6):
    return lattice([[1.0, 0.0], [0.5, np.sqrt(0.75)]], repeats)


def square(repeats=5):
    return lattice(np.eye(2), repeats)


def face_centred(repeats=3):
    return lattice(np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1.0]])[::-1] / np.sqrt(2), repeats)


def body_centred(repeats=3):
    return lattice(np.array([[-1, 1, 1], [1, -1, 1], [1, 1, -1.0]]) / np.sqrt(3), repeats)


def draw_plane(count, a, theta_c, generator, modes=()):
    """Normals from P(θ) = (1/π)(1 + a cos 2(θ−θc) + Σ A_m cos m(θ−θ_m)), by rejection."""
    angles = np.zeros(0)
    top = 1.0 + a + sum(abs(amplitude) for _, amplitude, _ in modes)
    while len(angles) < count:
        theta = generator.uniform(0, np.pi, 2 * count)
        density = 1.0 + a * np.cos(2 * (theta - theta_c))
        for mode, amplitude, phase in modes:
            density += amplitude * np.cos(mode * (theta - phase))
        angles = np.concatenate([angles, theta[generator.uniform(0, top, len(theta)) < density]])
    angles = angles[:count] + np.pi * generator.integers(0, 2, count)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def draw_sphere(count, a, axis, generator):
    """Normals from P = (1/2π)(1 + a(3 cos²θ − 1)) about ``axis``, by rejection."""
    axis = np.array(axis, dtype=float) / np.linalg.norm(axis)
    found = np.zeros((0, 3))
    while len(found) < count:
        normal = generator.normal(size=(2 * count, 3))
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        density = 1.0 + a * (3.0 * (normal @ axis) ** 2 - 1.0)
        top = 1.0 + max(2 * a, -a)
        keep = generator.uniform(0, top, len(normal)) < density
        found = np.concatenate([found, normal[keep]])
    return found[:count]


def contacts_of(normal, grain_count=None):
    """Contacts with these normals between arbitrary distinct grains."""
    count = len(normal)
    grain_count = grain_count or 2 * count
    first = np.arange(count) % grain_count
    pair = np.column_stack([first, (first + 1 + np.arange(count) // grain_count) % grain_count])
    return Contacts(pair=pair, normal=normal)


def jittered(generator, grain_count=400, dimension=2, spread=0.25, gap=0.0, matrix=None):
    """A disordered periodic state: a lattice of grains moved at random."""
    side = round(grain_count ** (1.0 / dimension))
    steps = np.stack(np.meshgrid(*[np.arange(side)] * dimension), axis=-1)
    fraction = (steps.reshape(-1, dimension) + 0.5) / side
    fraction = fraction + generator.uniform(-spread, spread, fraction.shape) / side
    matrix = np.eye(dimension) * side if matrix is None else matrix
    return Packing(
        grains=Grains(position=fraction @ matrix.T, radius=np.full(len(fraction), 0.5)),
        cell=Cell(matrix=matrix),
    )
