"""``fit`` recovers the critical state that a made-up series was given."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest


def write_csv(path: Path, *, columns: tuple[str, ...] = ("eps_q", "z", "a"), sign: int = 1) -> Path:
    """A path that settles at z* = 3.5, a* = 0.3 with a little noise."""
    noise = np.random.default_rng(3).normal(0, 0.005, (2, 200))
    strain = np.linspace(0, 0.3, 200)
    z = 3.5 + 0.4 * np.exp(-strain / 0.02) + noise[0]
    a = sign * (0.3 * (1 - np.exp(-strain / 0.02)) + noise[1])
    table = dict(zip(("eps_q", "z", "a"), (strain, z, a), strict=True))
    lines = [",".join(columns)]
    lines += [",".join(f"{table[name][k]:.6f}" for name in columns) for k in range(200)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def inside(estimate: dict[str, float], value: float, tolerance: float = 0.0) -> bool:
    return estimate["low"] - tolerance <= value <= estimate["high"] + tolerance


def test_critical_state_of_a_users_csv(granufab, tmp_path: Path) -> None:
    done = granufab("fit", write_csv(tmp_path / "mine.csv"), "--json")
    assert done.code == 0
    assert done.err == ""
    found = json.loads(done.out)
    assert inside(found["z_star"], 3.5, 0.002)
    assert inside(found["a_star"], 0.3, 0.002)
    # 2D: z_min, z_max = z* (1 ∓ a*/2)
    assert found["z_min"]["value"] == pytest.approx(3.5 * 0.85, abs=0.01)
    assert found["z_max"]["value"] == pytest.approx(3.5 * 1.15, abs=0.01)
    assert 0.0 <= found["outside_fraction"] <= 1.0
    assert found["z_definition"] == "z"


def test_extension_gives_the_same_size_of_a(granufab, tmp_path: Path) -> None:
    found = json.loads(granufab("fit", write_csv(tmp_path / "e.csv", sign=-1), "--json").out)
    assert found["a_star"]["value"] == pytest.approx(0.3, abs=0.005)


def test_strain_may_be_missing(granufab, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "mine.csv", columns=("z", "a"))
    found = json.loads(granufab("fit", path, "--json").out)
    assert found["z_star"]["value"] == pytest.approx(3.5, abs=0.005)


@pytest.mark.parametrize("method", ["critical", "envelope", "lines"])
def test_every_method_finds_the_limits(granufab, tmp_path: Path, method: str) -> None:
    path = write_csv(tmp_path / "mine.csv")
    done = granufab("fit", path, "--json", "--method", method)
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["z_min"]["value"] == pytest.approx(2.975, abs=0.1)
    assert found["z_max"]["value"] == pytest.approx(4.025, abs=0.1)


def test_a_run_file_and_its_definition(granufab, run_file: Path) -> None:
    found = json.loads(granufab("fit", run_file, "--json").out)
    assert found["z_definition"] == "z_backbone"
    assert found["z_star"]["value"] == pytest.approx(3.4, abs=0.01)
    other = json.loads(granufab("fit", run_file, "--json", "--z-definition", "z").out)
    assert other["z_star"]["value"] == pytest.approx(3.0, abs=0.01)


def test_paths_in_one_file_are_told_apart(granufab, tmp_path: Path) -> None:
    lines = write_csv(tmp_path / "one.csv").read_text(encoding="utf-8").splitlines()
    both = [f"path,{lines[0]}"]
    both += [f"{name},{line}" for name in ("dense", "loose") for line in lines[1:]]
    path = tmp_path / "both.csv"
    path.write_text("\n".join(both) + "\n", encoding="utf-8")
    done = granufab("fit", path, "--json")
    assert done.code == 0, done.err  # joined end to end, the strain would turn back
    assert json.loads(done.out)["z_star"]["value"] == pytest.approx(3.5, abs=0.005)


def test_only_the_part_before_a_reversal_counts(granufab, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "mine.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    back = [f"{0.3 - 0.001 * k:.6f},9.0,-0.9" for k in range(1, 100)]
    path.write_text("\n".join([*lines, *back]) + "\n", encoding="utf-8")
    found = json.loads(granufab("fit", path, "--json").out)
    assert found["z_star"]["value"] == pytest.approx(3.5, abs=0.005)


def test_the_table_for_people(granufab, tmp_path: Path) -> None:
    done = granufab("fit", write_csv(tmp_path / "mine.csv"))
    assert done.code == 0
    for word in ("z_min", "z_max", "z_star", "a_star", "outside"):
        assert word in done.out


def test_too_few_states(granufab, tmp_path: Path) -> None:
    path = tmp_path / "short.csv"
    path.write_text("eps_q,z,a\n0,3.5,0.1\n0.1,3.4,0.2\n", encoding="utf-8")
    done = granufab("fit", path)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert "states" in done.err


def test_a_csv_without_the_columns(granufab, tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("time,speed\n0,1\n1,2\n", encoding="utf-8")
    done = granufab("fit", path)
    assert done.code == 2
    assert "z" in done.err
    assert "time, speed" in done.err
