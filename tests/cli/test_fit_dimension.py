"""``fit`` takes dimension, mode and b from what was run, from the sign of a', or from options."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from granufab.simulate.settings import Case, Sample, Stage, to_toml
from granufab.states import AccessibleDomain

Z_MIN, Z_MAX = 4.0, 6.0


def write_path(path: Path, domain: AccessibleDomain, *, sign: int = 1) -> Path:
    """A path that settles in the critical state of a domain; a' < 0 where ``sign`` is."""
    random = np.random.default_rng(5)
    strain = np.linspace(0, 0.3, 200)
    grown = 1 - np.exp(-strain / 0.02)
    z = 5.0 + (domain.z_star - 5.0) * grown + 0.004 * random.standard_normal(200)
    a = sign * (domain.a_star * grown + 0.004 * random.standard_normal(200))
    rows = [f"{s:.6f},{x:.6f},{abs(y):.6f},{y:.6f}" for s, x, y in zip(strain, z, a, strict=True)]
    path.write_text("\n".join(["eps_q,z,a,a_signed", *rows]) + "\n", encoding="utf-8")
    return path


def fitted(granufab, *arguments: object) -> dict:
    done = granufab("fit", *arguments, "--json")
    assert done.code == 0, done.err
    return json.loads(done.out)


def is_domain(found: dict) -> bool:
    pairs = ((found["z_min"]["value"], Z_MIN), (found["z_max"]["value"], Z_MAX))
    return all(abs(value - wanted) < 0.03 for value, wanted in pairs)


def domain_of(**options) -> AccessibleDomain:
    return AccessibleDomain(z_min=Z_MIN, z_max=Z_MAX, dimension=3, **options)


def test_the_settings_beside_a_series_tell_the_dimension(granufab, tmp_path: Path) -> None:
    file = write_path(tmp_path / "series.csv", domain_of())
    plane = fitted(granufab, file)
    assert plane["dimension"] == 2
    assert not is_domain(plane)  # the 2D limits are others
    (tmp_path / "settings.toml").write_text(to_toml(Case(sample=Sample(dimension=3))))
    solid = fitted(granufab, file)
    assert (solid["dimension"], solid["mode"], solid["b"]) == (3, "compression", None)
    assert is_domain(solid)
    assert fitted(granufab, file, "--dimension", 2)["dimension"] == 2


def test_a_plateau_of_negative_a_is_extension_in_3d(granufab, tmp_path: Path) -> None:
    file = write_path(tmp_path / "series.csv", domain_of(mode="extension"), sign=-1)
    found = fitted(granufab, file, "--dimension", 3)
    assert found["mode"] == "extension"
    assert is_domain(found)


def test_a_stage_with_b_and_its_reversal(granufab, tmp_path: Path) -> None:
    file = write_path(tmp_path / "series.csv", domain_of(b=0.25))
    for strain, b in ((0.3, 0.25), (-0.3, 0.75)):
        case = Case(sample=Sample(dimension=3), path=(Stage(strain=strain, b=b),))
        (tmp_path / "settings.toml").write_text(to_toml(case))
        found = fitted(granufab, file)
        assert (found["b"], found["mode"]) == (0.25, None)
        assert is_domain(found)


def test_simple_shear_in_3d_lies_midway(granufab, tmp_path: Path) -> None:
    file = write_path(tmp_path / "series.csv", domain_of(b=0.5))
    case = Case(sample=Sample(dimension=3), path=(Stage(loading="simple-shear"),))
    (tmp_path / "settings.toml").write_text(to_toml(case))
    assert is_domain(fitted(granufab, file))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--mode", "extension"), "2D"),
        (("--b", "0.5"), "2D"),
        (("--dimension", 3, "--mode", "extension", "--b", "0.5"), "not both"),
    ],
)
def test_options_that_do_not_fit(granufab, tmp_path: Path, options: tuple, words: str) -> None:
    done = granufab("fit", write_path(tmp_path / "series.csv", domain_of()), *options)
    assert done.code == 2
    assert words in done.err
    assert done.err.count("\n") == 1


def test_compression_and_extension_have_no_common_domain(granufab, tmp_path: Path) -> None:
    one = write_path(tmp_path / "one.csv", domain_of())
    two = write_path(tmp_path / "two.csv", domain_of(mode="extension"), sign=-1)
    done = granufab("fit", one, two, "--dimension", 3)
    assert done.code == 2
    assert "fit them apart" in done.err


def test_a_settings_file_of_another_program_is_left_alone(granufab, tmp_path: Path) -> None:
    file = write_path(tmp_path / "series.csv", domain_of())
    (tmp_path / "settings.toml").write_text("colour = 'blue'\n")
    assert fitted(granufab, file)["dimension"] == 2
