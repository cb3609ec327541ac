"""The shape of what ``reproduce`` and ``run`` leave, with a synthetic simulation in its place."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_run import (
    A_STAR,
    Z_STAR,
    failing_run,
    reluctant_run,
    reproduce_synthetic,
    run_of_a_sample,
    synthetic_run,
    synthetic_sample,
)

from granufab.errors import NotConverged
from granufab.history import SERIES_UNITS
from granufab.reproduce import FIGURES, reproduce
from granufab.reproduce.case_folder import RUN_FILES
from granufab.reproduce.out_folder import prepare_out_folder
from granufab.reproduce.workers import Job, run_jobs
from granufab.simulate.settings import Case, Sample, Stage

FITTED = ("fig5", "fig6", "fig7", "fig8")
HERE = Path(__file__).parent
KEYS = {
    "granufab", "settings", "seed", "criterion", "z_definition", "paths", "fit", "solver",
    "wall_seconds",
}  # fmt: skip
SOLVER_KEYS = {
    "tolerance", "residual_max", "sweeps_mean", "nonconverged_steps", "steps", "overlap_max",
    "contact_updates", "seconds", "inertial_number", "stiffness",
}  # fmt: skip


ENDINGS = (".pdf", ".png", ".json", ".csv")


def test_every_promised_file_of_a_figure_is_there(single: Any) -> None:
    folder, result = single
    promised = {f"fig7{end}" for end in ENDINGS}
    assert {entry.name for entry in folder.iterdir()} == promised | {"summary.json", "runs"}
    stored = json.loads((folder / "fig7.json").read_text())
    assert stored == result
    assert json.loads((folder / "summary.json").read_text()) == {"fig7": stored}
    for path in result["paths"]:
        assert path["runs"] == [f"runs/{path['name']}"]
        files = {entry.name for entry in (folder / "runs" / path["name"]).iterdir()}
        assert files == set(RUN_FILES)


def test_every_promised_file_of_all_is_there(everything: Any) -> None:
    folder, results, _ = everything
    promised = {f"fig{number}{end}" for number in range(1, 9) for end in ENDINGS}
    assert {entry.name for entry in folder.iterdir()} == promised | {"summary.json", "runs"}
    assert json.loads((folder / "summary.json").read_text()) == results
    for name in FIGURES:
        assert json.loads((folder / f"{name}.json").read_text()) == results[name]
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        for path in results[name]["paths"]:
            for run in path["runs"]:
                assert {entry.name for entry in (folder / run).iterdir()} == set(RUN_FILES)


def test_each_simulation_is_run_once_and_shared(everything: Any) -> None:
    folder, results, cases = everything
    bare = [case.model_copy(update={"name": ""}) for case in cases]
    assert len(set(bare)) == len(bare) == 11
    assert sorted(case.name for case in cases) == sorted(
        p.name for p in (folder / "runs").iterdir()
    )
    runs = {
        (name, path["name"]): path["runs"] for name in FIGURES for path in results[name]["paths"]
    }
    dense = runs["fig7", "dense"]
    assert runs["fig6", "dense"] == runs["fig1", "disks"] == runs["fig3", "disks"] == dense
    assert runs["fig2", "disks"] == dense
    assert runs["fig6", "loose"] == runs["fig7", "loose"]
    assert runs["fig1", "spheres"] == runs["fig3", "spheres"]
    assert runs["fig5", "dense"] != dense


def test_all_gives_the_numbers_of_a_single_figure(single: Any, results: Any) -> None:
    alone, among = single[1], results["fig7"]
    assert alone["fit"] == among["fit"]
    for one, two in zip(alone["paths"], among["paths"], strict=True):
        assert {**one, "runs": None} == {**two, "runs": None}


def test_a_figure_that_cannot_be_made_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from granufab.reproduce import engine

    leave = engine._leave

    def without_fig6(recipe: Any, *arguments: Any) -> dict[str, Any]:
        if recipe.figure == "fig6":
            raise NotConverged("no plateau")
        return leave(recipe, *arguments) if recipe.figure == "fig1" else {}

    monkeypatch.setattr(engine, "_leave", without_fig6)
    with pytest.raises(NotConverged, match="fig6: no plateau"):
        reproduce_synthetic("all", tmp_path / "out", grains=50)
    assert (tmp_path / "out" / "fig1.json").exists()
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["fig6"] == {"error": "no plateau"}
    prepare_out_folder("all", FIGURES, tmp_path / "out")  # counts as ours: may be replaced
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("figure", FIGURES)
def test_the_json_has_the_promised_keys(figure: str, results: Any) -> None:
    result = results[figure]
    assert set(result) >= KEYS
    assert set(result["solver"]) >= SOLVER_KEYS
    assert all(result["solver"][key] is not None for key in SOLVER_KEYS)
    if figure in FITTED:
        assert list(result["fit"]) == ["default", "envelope", "lines"]
        assert result["fit"]["default"]["method"] == "critical"
    else:
        assert result["fit"] is None
        assert result["fit_reason"]
    for fit in (result["fit"] or {}).values():
        for name in ("z_min", "z_max"):
            assert fit[name]["low"] <= fit[name]["value"] <= fit[name]["high"]
    for path in result["paths"]:
        assert isinstance(path["z_0"], float)
        for name in ("z_star", "a_star"):
            assert path[name]["low"] <= path[name]["value"] <= path[name]["high"]


@pytest.mark.parametrize("figure", ["fig5", "fig6", "fig7"])
def test_the_fit_gives_back_the_critical_state(figure: str, results: Any) -> None:
    result = results[figure]
    fit = result["fit"]["default"]
    assert fit["z_min"]["value"] == pytest.approx(Z_STAR * (1 - A_STAR / 2), abs=0.02)
    assert fit["z_max"]["value"] == pytest.approx(Z_STAR * (1 + A_STAR / 2), abs=0.02)
    for path in result["paths"]:
        assert path["z_star"]["value"] == pytest.approx(Z_STAR, abs=0.02)
        assert path["a_star"]["value"] == pytest.approx(A_STAR, abs=0.02)


def test_paths_start_where_the_paper_says(results: Any) -> None:
    starts = {name: [p["z_0"] for p in r["paths"]] for name, r in results.items()}
    assert starts["fig5"] == [4.0, 3.3]
    assert starts["fig7"] == starts["fig6"] == [3.7, 3.1]
    assert starts["fig8"] == [3.72] * 5
    grains = {name: r["settings"]["grain_count"] for name, r in results.items()}
    assert grains == dict.fromkeys(FIGURES[:7], 5000) | {"fig8": 13000}


def test_the_series_file_holds_every_path(everything: Any) -> None:
    folder, result = everything[0], everything[1]["fig5"]
    with (folder / "fig5.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0]) == ["path", *SERIES_UNITS]
    counts = {path["name"]: 0 for path in result["paths"]}
    for row in rows:
        counts[row["path"]] += 1
    assert counts == {"dense": 301, "loose": 151}
    assert float(rows[300]["eps_q"]) == pytest.approx(0.0, abs=1e-9)
    assert float(rows[300]["eps_q_total"]) == pytest.approx(0.6)


def test_fig1_and_fig3_look_at_a_plane_and_a_solid_state(results: Any) -> None:
    states = results["fig1"]["states"]
    assert [states[name]["dimension"] for name in ("disks", "spheres")] == [2, 3]
    # The synthetic lattices lose the contacts across the contraction: theory by hand.
    expected = {"disks": ((6.0, 0.0), (4.0, 1.0)), "spheres": ((12.0, 0.0), (8.0, 0.625))}
    for name, states in results["fig3"]["orientation"].items():
        for state, (z, a) in zip(("before", "after"), expected[name], strict=True):
            assert states[state]["z_backbone"] == pytest.approx(z)
            assert states[state]["a_fitted"] == pytest.approx(a, abs=1e-9)
            assert abs(states[state]["a_signed"]) == pytest.approx(a, abs=1e-9)
            shown = states[state]["distribution"]
            assert len(shown["theta"]) == len(shown["E_error"]) == states[state]["bins"]
    # Contacts at ±30° of the contraction, which is θ = 0.
    after = results["fig3"]["orientation"]["disks"]["after"]
    assert after["theta_c_degrees"] == pytest.approx(0.0, abs=1e-6)
    filled = np.array(after["distribution"]["theta"])[np.array(after["distribution"]["E"]) > 0]
    np.testing.assert_allclose(np.degrees(filled), [30.0, 150.0], atol=180 / after["bins"])


def test_fig2_tells_the_angles_of_a_real_grain(results: Any) -> None:
    around = results["fig2"]["environment"]
    assert around["contacts"] == len(set(around["neighbours"])) == 4
    assert sorted(around["angle_to_next_degrees"]) == pytest.approx([60, 60, 120, 120])
    assert around["exclusion_to_next_degrees"] == pytest.approx([60] * 4)  # equal disks
    assert results["fig2"]["texture"]["delta_theta_geometric_degrees"] == pytest.approx(60)
    contact = results["fig2"]["contact"]
    assert contact["branch_length"] == pytest.approx(sum(contact["radii"]))
    np.testing.assert_allclose(contact["contact_vector"], 0.5 * np.array(contact["branch"]))


def test_fig4_finds_the_affine_field_of_an_affine_flow(results: Any) -> None:
    field = results["fig4"]["velocity_field"]
    np.testing.assert_allclose(field["rate"], [[0, 1], [0, 0]], atol=1e-9)
    np.testing.assert_allclose(field["rate_far"], field["rate"], atol=1e-6)
    share = np.array([value for value in field["normal_share"] if value is not None])
    np.testing.assert_allclose(share, 1.0, atol=1e-6)


def test_fig5_measures_the_dip_and_the_reversal(results: Any) -> None:
    result = results["fig5"]
    dip, turn = result["dip"], result["reversal"]
    assert abs(dip["depth"]["value"]) < 0.03  # the synthetic dense path has none
    assert turn["a_signed_plateau"]["value"] == pytest.approx(-A_STAR, abs=0.02)
    # a' = −a* + 2 a* exp(−s/0.025) crosses 0 at 0.025 ln 2.
    assert turn["strain_to_zero"]["value"] == pytest.approx(0.025 * np.log(2), abs=0.003)
    assert turn["z_dip"]["value"] == pytest.approx(0.2, abs=0.05)
    for entry in (dip["depth"], turn["z_dip"], turn["strain_to_zero"]):
        assert entry["low"] <= entry["value"] <= entry["high"]
        assert entry["low"] < entry["high"]


def test_fig8_fits_each_friction(results: Any) -> None:
    fits = results["fig8"]["fits"]
    assert [fit["friction"] for fit in fits] == [0.1, 0.3, 0.5, 0.7, 0.9]
    z_star = [fit["z_star"]["value"] for fit in fits]
    expected = [Z_STAR - 0.25 * (fit["friction"] - 0.4) for fit in fits]
    np.testing.assert_allclose(z_star, expected, atol=0.02)
    chosen = results["fig8"]["fit"]["default"]
    assert chosen["from"] == "mu0.5"
    assert chosen["z_star"] == fits[2]["z_star"]


def test_fig8_shears_one_sample(tmp_path: Path) -> None:
    made: list[Any] = []
    starts: list[Any] = []

    def prepare(sample: Sample, *, progress: Any) -> object:
        made.append(object())
        return made[-1]

    def run(case: Case, *, record: Any, progress: Any, start: Any) -> Any:
        starts.append(start)
        if len(starts) == 5:
            raise NotConverged("enough seen")  # spares the fits
        return synthetic_run(case, record=record, progress=progress)

    with pytest.raises(NotConverged, match=r"path mu0\.9: enough seen"):
        reproduce_synthetic("fig8", tmp_path / "out", grains=50, run_case=run, prepare=prepare)
    assert len(made) == 1
    assert starts == made * 5


def test_workers_wait_for_the_sample_that_they_share(tmp_path: Path) -> None:
    lines: list[str] = []
    sample = Sample(grain_count=50, coordination=3.7)
    alike = [
        Job(case=Case(name=f"mu{k}", sample=sample), folder=tmp_path / f"mu{k}", shared=True)
        for k in range(3)
    ]
    run_jobs(
        alike, workers=2, run_case=run_of_a_sample, prepare=synthetic_sample,
        progress=lambda text, share: lines.append(text),
    )  # fmt: skip
    assert all((job.folder / "summary.json").exists() for job in alike)
    assert lines[-1] == "done"
    lone = Job(case=Case(name="lone", sample=sample), folder=tmp_path / "lone")
    with pytest.raises(NotConverged, match="path lone: started from None"):
        run_jobs([lone], workers=1, run_case=run_of_a_sample, prepare=synthetic_sample)


def test_an_unreachable_start_becomes_the_nearest_one_and_is_said(tmp_path: Path) -> None:
    result = reproduce_synthetic("fig7", tmp_path / "out", grains=50, run_case=reluctant_run)
    loose = result["paths"][1]
    assert loose["z_0_wanted"] == 3.1
    assert loose["z_0"] == 3.5
    assert "wanted z_0 = 3.1, the nearest reachable is 3.50" in loose["warnings"]
    assert result["paths"][0]["warnings"] == []


def test_quick_changes_the_size_and_neither_rate_nor_tolerance(
    tmp_path: Path, results: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    quick = reproduce("fig7", quick=True, run_case=synthetic_run, workers=1)
    assert quick["settings"]["grain_count"] == 1000
    cases = quick["settings"]["cases"].values()
    rate = Stage().inertial_number
    assert {stage["inertial_number"] for case in cases for stage in case["path"]} == {rate}
    assert quick["solver"]["tolerance"] == results["fig7"]["solver"]["tolerance"]
    assert (tmp_path / "granufab-fig7" / "fig7.pdf").stat().st_size > 5000


def test_seeds_repeat_every_path_independently_and_in_worker_processes(tmp_path: Path) -> None:
    lines: list[tuple[str, float]] = []
    result = reproduce(
        "fig7", out=tmp_path / "out", grains=50, seeds=2, workers=2, run_case=synthetic_run,
        progress=lambda text, share: lines.append((text, share)),
    )  # fmt: skip
    assert result["settings"]["grain_count"] == 50
    names = sorted(entry.name for entry in (tmp_path / "out" / "runs").iterdir())
    assert names == ["dense-s1", "dense-s2", "loose-s1", "loose-s2"]
    seeds = [tuple(path["seeds"]) for path in result["paths"]]
    assert seeds[0] == seeds[1]
    assert len(set(seeds[0])) == 2
    assert result["fit"]["default"]["between_seeds"] is not None
    shares = [share for _, share in lines]
    assert shares == sorted(shares)
    assert lines[-1] == ("done", 1.0)
    assert any("shear" in text for text, _ in lines)


def test_a_failed_path_is_named_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(NotConverged) as caught:
        reproduce("fig7", out=tmp_path / "out", run_case=failing_run, workers=2)
    assert str(caught.value).startswith("path loose: step 12 ended")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out" / "fig7.json").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_an_interrupt_ends_every_worker(tmp_path: Path) -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(HERE)!r})\n"
        "from granufab.reproduce import reproduce\n"
        "from synthetic_run import endless_run\n"
        "if __name__ == '__main__':\n"
        "    print('begin', flush=True)\n"
        f"    reproduce('fig7', out={str(tmp_path / 'out')!r}, run_case=endless_run, workers=2,\n"
        "              progress=lambda text, share: print(text, flush=True))\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        # Whoever runs the tests in the background may have told them to ignore interrupts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:
        if "dense: shear" in line and "loose: shear" in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    began = time.monotonic()
    _, errors = process.communicate(timeout=60)
    assert time.monotonic() - began < 8
    assert "KeyboardInterrupt" in errors
    assert _ends(process.pid), "a process of the group is still alive"


def _ends(group: int, patience: float = 5.0) -> bool:
    for _ in range(round(patience / 0.05)):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False
