"""The balance of grains that touch in several points: polyhedra of other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.errors import InvalidPacking
from granufab.fabric import balance, balance_run
from granufab.packing import Contacts, Grains, Packing

SHAPES = "<\nname Cube\nradius 0.01\nvolume 1\nnv 8\n>\n"


def _normals(rng: np.random.Generator, count: int) -> np.ndarray:
    normal = np.array([0.0, 0.0, 1.0]) + 0.2 * rng.normal(size=(count, 3))
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def _state(points: dict[tuple[int, int], np.ndarray]) -> Packing:
    """Grains in a row; each pair with its normals."""
    pair = [one for one, normal in points.items() for _ in normal]
    return Packing(
        grains=Grains(position=np.arange(12.0).reshape(4, 3), radius=np.full(4, 0.6)),
        contacts=Contacts(
            pair=np.array(pair).reshape(-1, 2),
            normal=np.concatenate(list(points.values())),
            branch=np.full((len(pair), 3), 3.0),
        ),
    )


def _closes(found: dict) -> None:
    change = found["gain"] - found["loss"] + found["current_in"] - found["current_out"]
    np.testing.assert_array_equal(found["after"], found["before"] + change)


def test_points_of_a_pair_are_matched_by_their_normals() -> None:
    rng = np.random.default_rng(3)
    normal = _normals(rng, 9)
    before = _state({(0, 1): normal[:3], (1, 2): normal[3:5], (2, 3): normal[5:6]})
    turned = normal + 1e-3 * rng.normal(size=normal.shape)
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    # Other order, other sense; 1–2 has one point more, 0–1 one less, 2–3 goes and 0–3 comes.
    after = _state({
        (1, 0): -turned[[2, 0]], (0, 3): turned[8:9], (1, 2): turned[[7, 4, 3]],
    })  # fmt: skip
    found = balance(before, after, criterion="listed", bins=24, direction=np.array([0, 0, 1.0]))
    counts = [int(found[name]) for name in ("gained", "lost", "persistent")]
    assert counts == [2, 2, 4]
    _closes({name: found[name].values for name in found})
    # Matched to the turned ones, none crosses more than an edge or two.
    assert int(found["crossings"].sum()) <= 2


def test_many_random_points_close() -> None:
    rng = np.random.default_rng(4)
    pairs = [(i, j) for i in range(4) for j in range(i + 1, 4)]

    def random_state() -> Packing:
        return _state({pair: _normals(rng, int(rng.integers(1, 5))) for pair in pairs})

    for _ in range(20):
        before, after = random_state(), random_state()
        found = balance(before, after, criterion="listed", bins=9)
        _closes({name: found[name].values for name in found})
        old, new = (np.bincount(4 * p.contacts.pair[:, 0] + p.contacts.pair[:, 1], minlength=16)
                    for p in (before, after) if p.contacts is not None)  # fmt: skip
        assert int(found["persistent"]) == np.minimum(old, new).sum()
        assert int(found["gained"]) == np.maximum(new - old, 0).sum()


def test_round_grains_touch_once() -> None:
    grains = Grains(position=[[0.0, 0], [1.0, 0]], radius=[0.5, 0.5])  # type: ignore[arg-type]
    normal = np.array([[1.0, 0], [-1.0, 0]])
    twice = Contacts(pair=np.array([[0, 1], [1, 0]]), normal=normal, branch=normal, gap=np.zeros(2))
    state = Packing(grains=grains, contacts=twice)
    with pytest.raises(InvalidPacking, match="listed twice"):
        balance(state, state, criterion="listed")


def test_cubes_of_rockable(tmp_path: Path) -> None:
    """Three cubes in a row along x: four corners on a face, then two, then four again."""
    (tmp_path / "my.shp").write_text(SHAPES)
    for frame, corners in enumerate((4, 2, 4)):
        body = "".join(
            f"Cube 0 0 1 {x} 0 0 0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0\n" for x in (0, 1.0, 2.0)
        )
        rows = "".join(
            f"{i} {i + 1} 0 {k} 0 -1 0 0 -0.001 {i + 0.5} {k % 2} {k // 2} 0 0 0 2 0 0 0 0 0 0 0\n"
            for i, count in ((0, 4), (1, corners))
            for k in range(count)
        )
        (tmp_path / f"conf{frame}").write_text(
            f"Rockable 21-08-2022\nt {frame}\nshapeFile my.shp\nnDriven 0\nParticles 3\n{body}"
            f"Interactions {4 + corners}\n{rows}Interfaces 0\n"
        )
    run = granufab.read(tmp_path, strain=0.01, axis="x")
    table = balance_run(run, criterion="force")
    assert table["gained"].values.tolist() == [0, 2]
    assert table["lost"].values.tolist() == [2, 0]
    assert table["persistent"].values.tolist() == [6, 6]
    _closes({name: table[name].values for name in table})
