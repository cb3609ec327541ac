"""Each bad input ends in one line on standard error, exit code 2, and changes nothing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

VERBS = ["new", "run", "reproduce", "measure", "fit", "plot", "info", "doctor", "bench"]


def one_line(done, *words: str) -> None:
    """Exit code 2, nothing on standard output, one line that holds the words."""
    assert done.code == 2, done
    assert done.out == ""
    assert done.err.startswith("granufab: ")
    assert done.err.count("\n") == 1, done.err
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err


@pytest.fixture
def case_file(tmp_path: Path):
    def write(text: str) -> Path:
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[material]\nfricton = 0.3\n", ("material.fricton", "did you mean friction?")),
        ("[sampel]\ngrain_count = 10\n", ("sampel", "did you mean sample?")),
        ("[material]\nfriction = -0.1\n", ("material.friction", "-0.1", "greater than")),
        ("[sample]\ngrain_count = 0\n", ("sample.grain_count", "0", "greater than")),
        ("[sample]\ngrain_count = 'many'\n", ("sample.grain_count", "many")),
        ("[material]\nfriction = nan\n", ("material.friction", "nan")),
        ("[sample]\ndimension = 4\n", ("sample.dimension", "4")),
        ("[[path]]\nloading = 'twist'\n", ("path.0.loading", "twist", "biaxial")),
        ("[material\n", ("not valid TOML", "line 1")),
    ],
)
def test_bad_case(granufab, case_file, tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    out = tmp_path / "out"
    one_line(granufab("run", case_file(text), "--out", out), *words, "case.toml")
    assert not out.exists()


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("material.friction=-1", ("material.friction", "-1")),
        ("material.fricton=1", ("did you mean friction?",)),
        ("material.friction", ("expected section.key=value",)),
        ("path.3.strain=1", ("no entry 3",)),
    ],
)
def test_bad_override(granufab, case_file, tmp_path, assignment: str, words) -> None:
    case = case_file("[[path]]\nstrain = 0.1\n")
    out = tmp_path / "out"
    one_line(granufab("run", case, "--out", out, "--set", assignment), *words)
    assert not out.exists()


@pytest.mark.parametrize("verb", ["run", "measure", "fit", "info"])
def test_missing_file(granufab, tmp_path: Path, verb: str) -> None:
    one_line(granufab(verb, tmp_path / "nowhere.h5"), "nowhere.h5")


def test_plot_of_a_missing_file(granufab, tmp_path: Path) -> None:
    target = tmp_path / "p.png"
    arguments = ("plot", tmp_path / "nowhere.h5", "--figure", "rose", "-o", target)
    one_line(granufab(*arguments), "nowhere.h5")
    assert not target.exists()


@pytest.mark.parametrize("verb", ["measure", "info", "fit"])
@pytest.mark.parametrize("content", [b"", b"not a run file\n", b"\x89HDF\r\n\x1a\n" + bytes(600)])
def test_a_file_that_is_not_ours(granufab, tmp_path: Path, verb: str, content: bytes) -> None:
    path = tmp_path / "foreign.h5"
    path.write_bytes(content)
    one_line(granufab(verb, path), "foreign.h5")
    assert path.read_bytes() == content


def test_a_folder_that_cannot_be_written(granufab, case_file, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("in the way", encoding="utf-8")
    one_line(granufab("run", case_file(""), "--out", blocker / "out"), str(blocker))
    one_line(granufab("reproduce", "fig7", "--quick", "--out", blocker / "out"), str(blocker))
    assert blocker.read_text(encoding="utf-8") == "in the way"


def test_a_run_is_not_overwritten_without_force(granufab, case_file, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "run.h5").write_text("precious", encoding="utf-8")
    one_line(granufab("run", case_file(""), "--out", out), "run.h5", "--force")
    assert (out / "run.h5").read_text(encoding="utf-8") == "precious"
    assert [p.name for p in out.iterdir()] == ["run.h5"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rnu"], ("rnu", "'run'")),
        (["new"], ("argument", "simple-shear")),
        (["new", "twist"], ("twist", "shear")),
        (["run"], ("CASE.toml", "--start FILE")),
        (["measure"], ("argument", "FILE")),
        (["reproduce", "fig9"], ("fig9", "fig7")),
        (["reproduce", "fig7", "--seeds", "none"], ("--seeds", "integer")),
        (["doctor", "--verbose"], ("--verbose",)),
    ],
)
def test_bad_usage(granufab, arguments: list[str], words: tuple[str, ...]) -> None:
    one_line(granufab(*arguments), *words, "--help")


@pytest.mark.parametrize(
    ("option", "value"), [("--grains", 0), ("--grains", -5), ("--seeds", 0), ("--seed", -1)]
)
def test_bad_numbers_of_a_reproduction(granufab, tmp_path: Path, option: str, value: int) -> None:
    out = tmp_path / "out"
    words = (option.strip("-"), str(value), "at least")
    one_line(granufab("reproduce", "fig7", option, value, "--out", out), *words)
    assert not out.exists()


def test_a_bad_seed_of_a_run(granufab, case_file, tmp_path: Path) -> None:
    out = tmp_path / "out"
    one_line(granufab("run", case_file(""), "--seed", -1, "--out", out), "sample.seed", "-1")
    assert not out.exists()


def test_without_a_verb_the_help_is_shown(granufab) -> None:
    done = granufab()
    assert done.code == 2
    assert "reproduce" in done.out


def test_help_names_every_verb(granufab) -> None:
    done = granufab("--help")
    assert done.code == 0
    for verb in VERBS:
        assert re.search(rf"\b{verb}\b", done.out)
        assert granufab(verb, "--help").code == 0


def test_version(granufab) -> None:
    import granufab as package

    done = granufab("--version")
    assert done.code == 0
    assert done.out == f"granufab {package.__version__}\n"
