"""A saved page holds what the server would send, says what it left out, and loads nothing."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from saved_file import SavedFile
from sheared_run import sheared_frames, write_run

from granufab.errors import InvalidSettings, MissingData
from granufab.history import Run
from granufab.viewer import ViewedRun, fit_data, frame_buffer, series_data, state_data, unpack
from granufab.viewer.export import save_page, saved_page
from granufab.viewer.saved_rules import saved_rules
from granufab.viewer.state_data import interval_data

pytest.importorskip("plotly", reason="saved pages need the extra view")
Look = Callable[[Path], ViewedRun]


@pytest.fixture(scope="module")
def saved(run_file: Path, sphere_file: Path) -> tuple[list[ViewedRun], bytes]:
    from granufab import read

    runs = [
        ViewedRun(str(path), [path], lambda path=path: read(path))
        for path in (run_file, sphere_file)
    ]
    return runs, saved_page(runs).content


def check_frame(viewed: ViewedRun, file: SavedFile, run: int, frame: int) -> None:
    """Every criterion of a frame against the server's, each value within half its step."""
    state = viewed.frame(frame)
    before = viewed.frame(frame - 1) if frame else None
    rules = saved_rules(viewed.choice(None, None), viewed.frame(0))
    for place, rule in enumerate(rules):
        wanted_header, wanted = unpack(frame_buffer(state, rule.choice, before=before))
        header, found = file.frame(run, frame, place)
        for name in ("criterion", "contact_count", "cell", "origin", "eps_q", "direction"):
            assert header[name] == wanted_header[name]
        mean = wanted_header["mean_normal_force"]
        assert header["mean_normal_force"][rule.choice.z_definition] == mean
        steps, exact = header["steps"], 1e-5
        for name in ("pair", "image", "held", "contact_number", "radius", "number"):
            assert np.array_equal(found[name], wanted[name]), (rule.choice.criterion.text, name)
        off = np.abs(found["position"] - wanted["position"]).max(axis=0)
        assert np.all(off <= 0.5 * np.array(steps["position"]) + exact)
        for name in ("velocity", "spin"):
            off = np.abs(found[name] - wanted[name]).max()
            assert off <= 0.5001 * steps[name]
        if not wanted_header["contact_count"]:
            continue
        gaps = steps[f"{rule.pairs}_gap"]
        assert np.abs(found["gap"] - wanted["gap"]).max() <= 0.5001 * gaps + 1e-7
        if mean is not None and "force" in wanted:
            off = np.abs(found["force"] - mean * wanted["force"]).max()
            assert off <= 0.5001 * steps["force"] + mean * exact
        turned = np.abs(found["normal"] - wanted["normal"]).max()
        assert turned <= 2 * float(np.linalg.norm(steps["position"])) + exact
        if place == 0 and before is not None:
            assert header["changes"] == wanted_header["changes"]
            assert np.array_equal(found["gained"], wanted["gained"])
            assert np.array_equal(found["lost_pair"], wanted["lost_pair"])


def test_frames_are_those_of_the_server_within_the_stated_steps(
    saved: tuple[list[ViewedRun], bytes],
) -> None:
    runs, content = saved
    file = SavedFile(content)
    for run, frame in ((0, 0), (0, 6), (0, 11), (1, 3)):
        check_frame(runs[run], file, run, frame)


def test_numbers_are_exactly_those_of_the_server(
    saved: tuple[list[ViewedRun], bytes],
) -> None:
    runs, content = saved
    file = SavedFile(content)
    for run, frame in ((0, 7), (1, 2)):
        viewed = runs[run]
        found = file.states(run, frame)
        rules = saved_rules(viewed.choice(None, None), viewed.frame(0))
        assert len(found["states"]) == 2 + len(rules)  # three definitions of z under its own
        for place, rule in enumerate(rules):
            for definition in rule.definitions:
                wanted = state_data(viewed.run, viewed.frame(frame), rule.under(definition))
                state = found["states"][f"{place} {definition}"]
                for name in ("values", "point", "mohr", "criterion", "z_definition", "missing"):
                    assert state[name] == wanted[name]
                if wanted["rose"] is None:
                    assert state["rose"] is None
                    continue
                for name in ("a", "a_error", "z", "unit"):
                    assert state["rose"][name] == wanted["rose"][name]
                every = slice(None, None, 1 if place < 2 else 2)
                for name in ("theta", "E", "low", "high"):
                    curve = wanted["rose"]["curve"][name][every]
                    assert state["rose"]["curve"][name] == pytest.approx(curve, rel=1e-5)
        interval = interval_data(viewed.frame(frame - 1), viewed.frame(frame), rules[0].choice)
        assert file.interval(run, frame) == json.loads(json.dumps(interval))


def test_the_slider_runs_through_states_that_the_file_holds(
    saved: tuple[list[ViewedRun], bytes],
) -> None:
    runs, content = saved
    file = SavedFile(content)
    sliders = file.states(0, 4)["criterion"]
    criteria = file.frame(0, 4)[0]["criteria"]
    for kind in ("force", "gap"):
        assert len(sliders[kind]["threshold"]) == 9
        rise = np.diff([one["contact_count"] for one in criteria if one["kind"] == kind])
        assert np.all(rise <= 0 if kind == "force" else rise >= 0)
        assert rise.any()
        choice = runs[0].choice(f"{kind}:{sliders[kind]['threshold'][6]!r}", None)
        state = state_data(runs[0].run, runs[0].frame(4), choice)
        assert sliders[kind]["z"][6] == state["point"]["z"]
    choices = file.contents["choices"]
    assert choices[""] == ["z_backbone", "z", "z_mechanical"]
    assert choices["gap"] == choices["force"] == choices["listed"] == ["z_backbone"]


def test_series_fits_and_words_are_in_the_file(saved: tuple[list[ViewedRun], bytes]) -> None:
    runs, content = saved
    contents = SavedFile(content).contents
    for viewed, one in zip(runs, contents["runs"], strict=True):
        assert one["series"] == series_data(viewed)
        assert one["overview"]["frames"]["eps_q"] == [place.eps_q for place in viewed.places()]
    assert contents["fits"]["z"] == fit_data(runs, z_definition="z")
    assert any("exact" in line for line in contents["saved"]["lines"])


def test_pairs_are_searched_where_the_data_list_too_few(tmp_path: Path) -> None:
    """No reach is known of these: gaps come from positions, forces from the list."""
    frames = [replace(frame, remap=None) for frame in sheared_frames(2, 3)]
    viewed = ViewedRun("made-up", [], lambda: Run(series_source=_no_series, frames=frames))
    file = SavedFile(saved_page([viewed]).content)
    lists = {rule["list"] for rule in file.frame(0, 1)[0]["criteria"]}
    assert lists == {"listed", "near"}
    check_frame(viewed, file, 0, 1)


def test_a_state_without_contacts_is_saved(tmp_path: Path) -> None:
    frames = [
        replace(frame, packing=replace(frame.packing, contacts=None, cell=None))
        for frame in sheared_frames(2, 2)
    ]
    viewed = ViewedRun("bare", [], lambda: Run(series_source=_no_series, frames=frames))
    file = SavedFile(saved_page([viewed]).content)
    assert "" in file.contents["choices"]
    assert "listed" not in file.contents["choices"]
    states = file.states(0, 1)["states"]
    assert states["0 z_backbone"]["values"]["z"] is None
    assert states["0 z_backbone"]["missing"]
    assert states["8 z_backbone"]["values"]["z"] is not None  # a gap, from positions


def _no_series() -> Any:
    from granufab.history import series_dataset

    return series_dataset([], {})


def test_thinning_keeps_the_ends_and_is_said(view_of: Look, run_file: Path) -> None:
    viewed = view_of(run_file)
    whole = saved_page([viewed])
    limit = len(whole.content) - 60_000
    thinned = saved_page([viewed], most=limit)
    assert len(thinned.content) <= limit
    kept = SavedFile(thinned.content).contents["runs"][0]["overview"]["frames"]["number"]
    assert 2 < len(kept) < 12
    assert (kept[0], kept[-1]) == (0, 11)
    assert np.ptp(np.diff(kept)) <= 1
    assert any(f"{len(kept)} of 12 frames" in line for line in thinned.lines)
    # What was gained and lost is counted between frames that are there.
    changes = SavedFile(thinned.content).frame(0, 1)[0]["changes"]
    assert changes["since_eps_q"] == viewed.frame(kept[0]).eps_q
    with pytest.raises(InvalidSettings, match="first and last"):
        saved_page([viewed], most="4MB")
    for wrong in ("fish", "0", "-3MB", "5 parsec", "1e400"):
        with pytest.raises(InvalidSettings, match="size"):
            saved_page([viewed], most=wrong)


def test_a_part_of_the_frames(view_of: Look, run_file: Path) -> None:
    page = saved_page([view_of(run_file)], frames=slice(2, 11, 3))
    file = SavedFile(page.content)
    assert file.contents["runs"][0]["overview"]["frames"]["number"] == [2, 5, 8]
    assert any("3 of 12" in line for line in page.lines)
    with pytest.raises(InvalidSettings, match=r"holds frames 0\.\.11"):
        saved_page([view_of(run_file)], frames=slice(30, None))
    with pytest.raises(InvalidSettings, match="step"):
        saved_page([view_of(run_file)], frames=slice(None, None, -1))


def test_nothing_is_loaded_from_elsewhere(saved: tuple[list[ViewedRun], bytes]) -> None:
    text = saved[1].decode()
    tags = re.findall(r"<(?:script|link|img|iframe)\b[^>]*>", _without_plotly(text))
    assert [tag for tag in tags if re.search(r"(?:src|href)=", tag)] == [
        '<link rel="icon" href="data:,">'
    ]
    assert "/page/" not in re.sub(r"base64,[A-Za-z0-9+/=]*", "", _without_plotly(text))
    assert "default-src 'none'" in text
    # Each script may run by its nonce alone, and every module that one imports is there.
    assert all("nonce=" in tag or "text/plain" in tag for tag in tags if tag.startswith("<script"))
    modules = _modules(text)
    wanted = re.findall(r'from "([^"]*)"', "".join(modules.values()))
    assert wanted
    assert set(wanted) <= set(modules)
    assert 'import "granufab/main.js";' in text


def _without_plotly(text: str) -> str:
    from granufab.viewer.page_files import PLOTLY, page_files

    charts = page_files()[PLOTLY].content.decode()
    assert charts in text
    return text.replace(charts, "")


def _modules(text: str) -> dict[str, str]:
    import base64

    found = re.search(r'<script type="importmap"[^>]*>(.*?)</script>', text)
    assert found is not None
    addresses = json.loads(found[1])["imports"]
    return {
        name: base64.b64decode(one.partition("base64,")[2]).decode()
        for name, one in addresses.items()
    }


def test_hostile_names_are_inert(tmp_path: Path) -> None:
    nasty = '</script><img src=x onerror="alert(1)">&quot;'
    frames = list(sheared_frames(2, 2))
    run = Run(series_source=_no_series, frames=frames, name=nasty)
    text = saved_page([ViewedRun(nasty, [], lambda: run)]).content.decode()
    assert "<img" not in _without_plotly(text)
    assert SavedFile(text.encode()).contents["runs"][0]["overview"]["path"] == nasty
    title = re.search(r"<title>(.*?)</title>", text)
    assert title is not None
    assert "&lt;img" in title[1]


def test_scripts_that_name_their_own_end_stay_whole() -> None:
    from granufab.viewer.page_files import PageFile
    from granufab.viewer.single_page import page_parts

    index = (
        '<!doctype html><html><head><meta charset="utf-8"><title>t</title></head><body>'
        '<script src="/page/plotly.min.js"></script>'
        '<script type="module" src="/page/main.js"></script></body></html>'
    )
    charts = 'const a = "</script><!-- x", b = "</SCRIPT >";'
    files = {
        name: PageFile(content=text.encode(), type="")
        for name, text in {
            "index.html": index,
            "plotly.min.js": charts,
            "main.js": 'import { a } from "./other.js";\nexport const b = 1;',
            "other.js": "export const a = '</script>';",
        }.items()
    }
    text = b"".join(page_parts(files, "t")).decode()
    assert len(re.findall("</script", text, re.IGNORECASE)) == 3
    assert "<!--" not in text
    assert r'"<\/script>\x3c!-- x"' in text
    assert _modules(text)["granufab/main.js"].startswith('import { a } from "granufab/other.js";')


def test_files_are_kept_unless_forced(view_of: Look, run_file: Path, tmp_path: Path) -> None:
    page = saved_page([view_of(run_file)], frames=slice(0, 1))
    path = tmp_path / "report.html"
    save_page(page, path)
    assert path.read_bytes() == page.content
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(InvalidSettings, match="exists already"):
        save_page(page, path)
    assert path.read_text(encoding="utf-8") == "mine"
    save_page(page, path, force=True)
    assert path.read_bytes() == page.content
    assert [one.name for one in tmp_path.iterdir()] == ["report.html"]


def test_the_verb(run_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from granufab.cli import main

    def call(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main(["view", *map(str, arguments)])
        out, err = capsys.readouterr()
        return int(ended.value.code or 0), out, err

    path = tmp_path / "report.html"
    code, out, _ = call(run_file, "--export", path, "--frames", "::4")
    assert code == 0
    assert out.startswith(f"wrote {path}, ")
    assert "3 of 12 frames" in out
    assert SavedFile(path.read_bytes()).contents["runs"][0]["overview"]["frame_count"] == 3
    again = (run_file, "--export", path)
    for arguments, words in (
        (again, "exists already; choose another name, or --force"),
        ((run_file, "--export", tmp_path / "report.pdf"), ".html"),
        ((run_file, "--export", tmp_path / "n.html", "--most", "fish"), "size 'fish'"),
        ((run_file, "--most", "5MB"), "--most is for --export"),
        ((run_file, "--export", tmp_path / "n.html", "--frames", "50:"), "holds frames 0..11"),
        ((run_file, "--export", run_file / "n.html", "--frames", ":1"), "cannot be written"),
        ((run_file, "--frames", "0:2"), "--frames is for other programs' data"),
    ):
        code, out, err = call(*arguments)
        assert (code, out) == (2, "")
        assert words in err
        said = [line for line in err.splitlines() if not line.startswith(("saving", "measuring"))]
        assert len(said) == 1
    assert sorted(one.name for one in tmp_path.iterdir()) == ["report.html"]
    code, _, _ = call(*again, "--frames", "0:1", "--force")
    assert code == 0


def test_no_server_is_loaded(run_file: Path, tmp_path: Path) -> None:
    program = (
        "import sys\nfrom granufab.cli import main\n"
        "try:\n    main()\nfinally:\n"
        "    print(*{'starlette', 'uvicorn'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "view", str(run_file), "--frames", "0:1",
         "--export", str(tmp_path / "report.html")],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not {"starlette", "uvicorn"} & set(done.stderr.split())


def test_an_interruption_leaves_no_file(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While frames are read, and while the file is written."""
    import os

    from granufab.cli import main
    from granufab.viewer import saved_run

    def interrupted(*arguments: object, **options: object) -> Any:
        raise KeyboardInterrupt

    for module, name in ((saved_run, "saved_frame"), (os, "fsync")):
        with monkeypatch.context() as patch, pytest.raises(SystemExit) as ended:
            patch.setattr(module, name, interrupted)
            main(
                ["view", str(run_file), "--frames", ":1", "--export", str(tmp_path / "report.html")]
            )
        assert ended.value.code == 3
        assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_in_a_line(
    run_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    import errno
    import os

    from granufab.cli import main

    def full(number: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch, pytest.raises(SystemExit) as ended:
        patch.setattr(os, "fsync", full)
        main(["view", str(run_file), "--frames", ":1", "--export", str(tmp_path / "report.html")])
    assert ended.value.code == 1
    last = capsys.readouterr().err.splitlines()[-1]
    assert "report.html: cannot be written (No space left on device)" in last
    assert list(tmp_path.iterdir()) == []


def test_without_the_charts_it_says_what_to_install(
    view_of: Look, run_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(MissingData, match=r"install granufab\[view\]"):
        saved_page([view_of(run_file)])


def tiled(frame: Any, times: int) -> Any:
    """A state repeated side by side, with the forces it has."""
    packing = frame.packing
    cell, grains, contacts = packing.cell, packing.grains, packing.contacts
    moves = [(i, j) for i in range(times) for j in range(times)]
    count = grains.count
    shift = np.repeat(np.array(moves) @ cell.matrix.T, count, axis=0)
    row = {move: k for k, move in enumerate(moves)}
    image = np.rint(
        np.linalg.solve(
            cell.matrix,
            (
                contacts.branch
                - (grains.position[contacts.pair[:, 1]] - grains.position[contacts.pair[:, 0]])
            ).T,
        ).T
    ).astype(int)
    pairs = []
    for k, move in enumerate(moves):
        other = [row[tuple((np.array(move) + turn) % times)] for turn in image]
        second = contacts.pair[:, 1] + count * np.array(other)
        pairs.append(np.column_stack([contacts.pair[:, 0] + count * k, second]))

    def repeated(values: Any) -> Any:
        return None if values is None else np.tile(values, (times**2,) + (1,) * (values.ndim - 1))

    big = replace(
        packing,
        grains=replace(
            grains,
            position=np.tile(grains.position, (times**2, 1)) + shift,
            radius=repeated(grains.radius) * (1 + 1e-9 * np.arange(count * times**2)),
            mass=repeated(grains.mass),
            velocity=repeated(grains.velocity),
            spin=repeated(grains.spin),
            number=None,
        ),
        contacts=replace(
            contacts,
            pair=np.concatenate(pairs),
            **{
                name: repeated(getattr(contacts, name))
                for name in ("normal", "branch", "gap", "force")
            },
            image=None,
        ),
        cell=replace(cell, matrix=times * cell.matrix),
    )
    random = np.random.default_rng(round(1000 * frame.eps_q))
    noisy = replace(
        big.grains,
        velocity=random.standard_normal(big.grains.velocity.shape),
        spin=random.standard_normal(big.grains.spin.shape),
    )
    return replace(frame, packing=replace(big, grains=noisy))


def test_a_grain_takes_few_bytes(tmp_path: Path) -> None:
    """20 MB less the page, over 60 frames of 5,000 disks, leave 50 bytes for a grain and frame."""
    frames = [tiled(frame, 3) for frame in sheared_frames(2, 3)]
    run = Run(series_source=_no_series, frames=frames)
    sizes = [
        len(saved_page([ViewedRun("r", [], lambda: run)], frames=slice(0, end)).content)
        for end in (1, 3)
    ]
    states = 60_000  # of the numbers under all criteria, whatever the number of grains
    assert (sizes[1] - sizes[0]) / 2 < states + 50 * 900


@pytest.mark.slow
def test_sixty_frames_of_five_thousand_disks_fit(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    write_run(path, [tiled(frame, 7) for frame in sheared_frames(2, 60)])
    from granufab import read

    viewed = ViewedRun(str(path), [path], lambda: read(path))
    page = saved_page([viewed])
    contents = SavedFile(page.content).contents
    assert viewed.frame(0).packing.grains.count == 4900
    assert contents["runs"][0]["overview"]["frame_count"] == 60
    assert len(page.content) <= 20_000_000
