"""``fit --evolution`` writes a law that ``predict`` walks along any path."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from granufab.states import (
    EvolutionLaw,
    StrainStage,
    fabric_from_state,
    predict_evolution,
    proportional_gradient,
)

LAW = EvolutionLaw(z_min=2.75, z_max=3.65, gain_rate=35.0, loss_rate=35.0)


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded path that the minimal form walked from z_0 = 3.5, a little noise added."""
    stage = StrainStage(gradient=proportional_gradient(2), times=np.linspace(0, 0.3, 151))
    walked = predict_evolution(LAW, fabric_from_state(3.5), [stage])
    noise = np.random.default_rng(2).normal(0, 0.004, (2, 151))
    noise[:, 0] = 0.0
    rows = zip(walked.eps_q.values, walked.z + noise[0], walked.a_signed + noise[1], strict=True)
    path = tmp_path_factory.mktemp("series") / "mine.csv"
    lines = ["eps_q,z,a_signed", *(",".join(f"{float(x):.6f}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture
def law_file(granufab, series: Path, tmp_path: Path) -> Path:
    path = tmp_path / "fit.json"
    done = granufab("fit", series, "--evolution", path, "--form", "minimal", "--json")
    assert done.code == 0, done.err
    return path


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def predicted(granufab: Any, law_file: Path, path: Path) -> list[dict[str, Any]]:
    done = granufab("predict", law_file, "--path", path, "--json")
    assert done.code == 0, done.err
    return json.loads(done.out)


def test_fit_writes_and_reports_the_law(granufab, series: Path, tmp_path: Path) -> None:
    out = tmp_path / "fit.json"
    done = granufab("fit", series, "--evolution", out, "--form", "minimal", "--json")
    assert done.code == 0, done.err
    shown = json.loads(done.out)
    assert shown["z_star"]["value"] == pytest.approx(3.2, abs=0.01)
    law = shown["evolution"]
    assert law["form"] == "minimal"
    assert law["rms"]["z"] == pytest.approx(0.004, abs=0.001)
    for name in ("gain_rate", "loss_rate"):
        estimate = law["parameters"][name]
        assert estimate["low"] <= estimate["value"] <= estimate["high"]
        assert estimate["value"] == pytest.approx(35.0, rel=0.15)
    kept = json.loads(out.read_text(encoding="utf-8"))
    assert kept["kind"] == "evolution"
    assert kept["series"] == [str(series)]
    again = granufab("fit", series, "--evolution", out)
    assert again.code == 2
    assert "--force" in again.err


def test_the_law_for_people(granufab, series: Path, tmp_path: Path) -> None:
    done = granufab("fit", series, "--evolution", tmp_path / "f.json", "--form", "minimal")
    assert done.code == 0
    assert "gain_rate" in done.out and "rms residuals" in done.out


def test_a_reversal(granufab, law_file: Path, tmp_path: Path) -> None:
    path = write(
        tmp_path / "path.toml",
        "interval = 0.01\n[start]\nz = 3.5\n[[path]]\nstrain = 0.3\n[[path]]\nstrain = -0.4\n",
    )
    rows = predicted(granufab, law_file, path)
    assert len(rows) == 71
    assert rows[0]["z"] == pytest.approx(3.5) and rows[0]["a_signed"] == pytest.approx(0.0)
    turn, last = rows[30], rows[-1]
    assert (turn["eps_q"], last["eps_q"]) == pytest.approx((0.3, -0.1))
    assert last["eps_q_total"] == pytest.approx(0.7)
    # 2D: a* = 2(z_max − z_min)/(z_max + z_min), z* = (z_min + z_max)/2
    assert turn["a_signed"] == pytest.approx(0.28, abs=0.02)
    assert last["a_signed"] == pytest.approx(-0.28, abs=0.02)
    assert last["z"] == pytest.approx(3.2, abs=0.02)
    assert all(row["a_low"] < row["a_signed"] < row["a_high"] for row in rows)
    assert np.trace(last["fabric"]) == pytest.approx(last["z"] / 2)


def test_a_case_is_a_path(granufab, law_file: Path, tmp_path: Path) -> None:
    case = write(
        tmp_path / "case.toml",
        "[sample]\ncoordination = 3.5\n[[path]]\nloading = 'isotropic'\n"
        "[[path]]\nloading = 'biaxial'\nstrain = 0.1\n[record]\nseries_interval = 0.01\n",
    )
    done = granufab("predict", law_file, "--path", case, "--json")
    assert done.code == 0, done.err
    assert "1 stage" in done.err
    plain = write(
        tmp_path / "p.toml", "interval = 0.01\n[start]\nz = 3.5\n[[path]]\nstrain = 0.1\n"
    )
    assert json.loads(done.out) == predicted(granufab, law_file, plain)


def test_simple_shear_is_the_gradient_it_stands_for(
    granufab, law_file: Path, tmp_path: Path
) -> None:
    head = "interval = 0.02\n[start]\nz = 3.5\n[[path]]\nstrain = 0.2\n"
    named = write(tmp_path / "n.toml", head + "loading = 'simple-shear'\n")
    given = write(tmp_path / "g.toml", head + "gradient = [[0.0, 3.0], [0.0, 0.0]]\n")
    one, two = predicted(granufab, law_file, named), predicted(granufab, law_file, given)
    for name in ("z", "a_signed", "eps_q"):
        assert [r[name] for r in one] == pytest.approx([r[name] for r in two], abs=1e-9)
    # the spin carries the fabric beyond the contraction axis, so a' is below a
    assert one[-1]["a_signed"] < one[-1]["a"] - 1e-4


def test_extension_turns_the_sign(granufab, law_file: Path, tmp_path: Path) -> None:
    rows = {
        name: predicted(
            granufab,
            law_file,
            write(tmp_path / f"{name}.toml", f"[start]\nz=3.5\n[[path]]\n{text}\n"),
        )
        for name, text in {
            "extension": "loading='extension'\nstrain=0.1",
            "negative": "strain=-0.1",
        }.items()
    }
    assert rows["extension"] == rows["negative"]
    assert rows["extension"][-1]["a_signed"] < -0.1


def test_the_template_is_a_path_file(granufab, law_file: Path, tmp_path: Path) -> None:
    done = granufab("predict", "--template")
    assert done.code == 0
    assert len(tomllib.loads(done.out)["path"]) == 2
    assert len(predicted(granufab, law_file, write(tmp_path / "t.toml", done.out))) == 601


def test_the_table_for_people(granufab, law_file: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "p.toml", "[start]\nz = 3.5\n[[path]]\nstrain = 0.3\n")
    done = granufab("predict", law_file, "--path", path)
    assert done.code == 0
    assert "a'" in done.out
    assert len(done.out.splitlines()) < 40


def test_spheres_report_b(granufab, tmp_path: Path, law_file: Path) -> None:
    data = json.loads(law_file.read_text(encoding="utf-8"))
    data["law"] |= {"dimension": 3, "z_min": 4.0, "z_max": 6.0}
    data["draws"] = []
    solid = write(tmp_path / "fit3.json", json.dumps(data))
    text = "interval = 0.1\n[start]\nz = 5.0\n[[path]]\nb = 0.3\nstrain = 2.0\n"
    last = predicted(granufab, solid, write(tmp_path / "b.toml", text))[-1]
    assert last["b_g"] == pytest.approx(0.3, abs=1e-3)
    assert last["z"] == pytest.approx((6.0 + 8.0 + 0.3 * 2.0) / 3.0, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[start]\nz=3.5\n[[path]]\nstrian=0.1\n", ("path.0.strian", "did you mean strain")),
        ("[start]\nzz=3.5\n[[path]]\n", ("start.zz", "did you mean z")),
        ("[start]\nz=-1\n[[path]]\n", ("start.z", "-1")),
        ("[start]\n[[path]]\n", ("start", "either z")),
        ("[start]\nz=3.5\n", ("path",)),
        ("[start]\nz=3.5\n[[path]]\naxis=2\n", ("path.0.axis", "0..1")),
        ("[start]\nz=3.5\n[[path]]\nb=0.5\n", ("path.0.b", "3D")),
        ("[start]\nz=3.5\n[[path]]\nstrain=0\n", ("strain must not be 0",)),
        ("[start]\nz=3.5\n[[path]]\ngradient=[[1,0],[0,1]]\n", ("path.0.gradient",)),
        ("[start]\nz=3.5\n[[path]]\ngradient=[[1,0]]\n", ("path.0.gradient", "2 rows")),
        ("[start]\nz=3.5\na=3\n[[path]]\n", ("a' is 3",)),
        ("[sample]\ncoordination=3.5\ndimension=3\n[[path]]\n", ("dimension", "2D")),
        ("[sample]\ngrain_count=9\n[[path]]\n", ("coordination",)),
        ("[start]\nfabric=[[1,0.5],[0,1]]\n[[path]]\n", ("fabric", "symmetric")),
        ("[start]\nfabric=[[2,0],[0,-0.5]]\n[[path]]\n", ("fabric", "negative")),
        ("interval=1e-9\n[start]\nz=3.5\n[[path]]\n", ("interval", "3e-06")),
        ("[start\n", ("TOML",)),
    ],
)
def test_bad_path_files(
    granufab, law_file: Path, tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    done = granufab("predict", law_file, "--path", write(tmp_path / "bad.toml", text))
    assert done.code == 2
    assert done.err.count("\n") == 1
    for word in ("bad.toml", *words):
        assert word in done.err


def test_bad_fit_files(granufab, series: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "p.toml", "[start]\nz = 3.5\n[[path]]\n")
    wrong = write(tmp_path / "wrong.json", '{"z_min": 3}')
    for arguments, word in (
        (("predict", tmp_path / "none.json", "--path", path), "no such file"),
        (("predict", series, "--path", path), "not JSON"),
        (("predict", wrong, "--path", path), "--evolution"),
        (("predict",), "--template"),
    ):
        done = granufab(*arguments)
        assert done.code == 2
        assert word in done.err
        assert done.err.count("\n") == 1
