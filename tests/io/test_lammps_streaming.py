"""A long dump of many grains is read frame by frame: little memory, faster than loadtxt."""

from __future__ import annotations

import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import granufab
from granufab.fabric import fabric_tensor

FRAMES, SIDE = 20, 47
COUNT = SIDE**3


def _frame(step: int, label: str, columns: str, body: str, rows: int) -> str:
    tilt = 0.01 * step * SIDE
    return (
        f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF {label}\n{rows}\n"
        f"ITEM: BOX BOUNDS xy xz yz pp pp pp\n0 {SIDE + tilt!r} {tilt!r}\n0 {SIDE} 0\n0 {SIDE} 0\n"
        f"ITEM: {label} {columns}\n{body}\n"
    )


def _lines(table: np.ndarray, integers: int) -> str:
    style = "%d " * integers + "%.10g " * (table.shape[1] - integers)
    return "\n".join(style % tuple(row) for row in table.tolist())


def _generate(atoms: Path, local: Path) -> None:
    """A cubic lattice of touching spheres in scaled coordinates, in a box that shears.

    Branches are the lattice's; forces along the unsheared edges are kept, with shear parts, so
    that only the box changes from frame to frame.
    """
    grid = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), -1).reshape(-1, 3)
    number, generator = np.arange(1, COUNT + 1), np.random.default_rng(0)
    velocity = generator.normal(size=(COUNT, 3))
    table = np.column_stack([number, np.full(COUNT, 0.5025), grid / SIDE, velocity])
    grains = _lines(table, 1)
    rows = []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        other = ((grid + step) % SIDE) @ [SIDE * SIDE, SIDE, 1] + 1
        size = generator.uniform(1, 2, (COUNT, 1))
        rows.append(np.column_stack([number, other, -size * step, 0.1 * size * np.roll(step, 1)]))
    contacts = _lines(np.concatenate(rows), 2)
    with atoms.open("w") as one, local.open("w") as two:
        for k in range(FRAMES):
            one.write(_frame(k, "ATOMS", "id radius xs ys zs vx vy vz", grains, COUNT))
            names = " ".join(f"c_{n}" for n in range(1, 9))
            two.write(_frame(k, "ENTRIES", names, contacts, 3 * COUNT))


def _size(record: object) -> int:
    """Bytes of a record's arrays."""
    arrays = [getattr(record, name) for name in record.__slots__]  # type: ignore[attr-defined]
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))


@pytest.mark.slow
def test_twenty_frames_of_a_hundred_thousand_grains(tmp_path: Path) -> None:
    atoms, local = tmp_path / "atoms.dump", tmp_path / "contacts.dump"
    _generate(atoms, local)
    text = (atoms.stat().st_size + local.stat().st_size) / FRAMES
    order = {"contacts": {"order": "i j fx fy fz ftx fty ftz"}}
    granufab.read(atoms, local, columns=order)
    tracemalloc.start()
    start = time.perf_counter()
    run = granufab.read(atoms, local, columns=order)
    opened = time.perf_counter() - start
    worth, peaks, seconds = 0, [], []
    for k in range(FRAMES):
        tracemalloc.reset_peak()
        begun = time.perf_counter()
        packing = run.frames[k].packing
        seconds.append(time.perf_counter() - begun)
        peaks.append(tracemalloc.get_traced_memory()[1])
        worth = _size(packing.grains) + _size(packing.contacts)
        found = packing.contacts
        assert found is not None
        assert packing.grains.count == COUNT >= 100_000
        assert found.count == 3 * COUNT
        stretched = np.array([1.0, 1.0 + (0.01 * k) ** 2, 1.0])
        wanted = np.diag([1.0, 1 / stretched[1], 1.0]) / 3
        wanted[0, 0] += (0.01 * k) ** 2 / stretched[1] / 3
        assert np.diag(fabric_tensor(found)) == pytest.approx(np.diag(wanted), abs=1e-9)
        del packing, found
    tracemalloc.reset_peak()
    values = granufab.fabric.measure_run(run)
    peaks.append(tracemalloc.get_traced_memory()[1])
    assert (values.z == 6).all()
    tracemalloc.stop()
    print(
        f"\na frame is {text / 1e6:.1f} MB of text, {worth / 1e6:.1f} MB of packing; opened in "
        f"{opened:.2f} s, {np.median(seconds):.2f} s a frame, peak {max(peaks[:-1]) / 1e6:.1f} MB, "
        f"measured {peaks[-1] / 1e6:.1f} MB"
    )
    assert max(peaks) < 3 * worth


@pytest.mark.slow
def test_parsing_is_faster_than_loadtxt(tmp_path: Path) -> None:
    from granufab.io.number_rows import number_rows

    generator, path = np.random.default_rng(1), tmp_path / "rows"
    table = generator.normal(size=(COUNT, 8))
    path.write_text(_lines(table, 0) + "\n")
    number_rows(path, 0, 30, rows=0, columns=8, use=range(8), place="rows")

    def mine() -> np.ndarray:
        size = path.stat().st_size
        return number_rows(path, 0, size, rows=COUNT, columns=8, use=range(8), place="rows")

    assert mine().tobytes() == np.loadtxt(path).tobytes()
    times: dict[str, list[float]] = {"mine": [], "loadtxt": []}
    for _ in range(3):
        for name, call in (("mine", mine), ("loadtxt", lambda: np.loadtxt(path))):
            start = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - start)
    best = {name: min(seconds) for name, seconds in times.items()}
    print(f"\n{COUNT} rows of 8: {best['mine']:.3f} s, loadtxt {best['loadtxt']:.3f} s")
    assert best["mine"] < best["loadtxt"]
