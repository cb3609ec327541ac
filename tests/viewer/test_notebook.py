"""What a notebook shows: the saved page in a frame of its own, records as tables of plain text."""

from __future__ import annotations

import html
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from saved_file import SavedFile
from sheared_run import sheared_frames

import granufab
from granufab.errors import InvalidSettings
from granufab.history import Run, series_dataset
from granufab.notebook_hook import register
from granufab.states import AccessibleDomain, AccessibleFit
from granufab.viewer import notebook_tables as tables


@pytest.fixture(scope="module")
def shown(run_file: Path) -> Any:
    pytest.importorskip("plotly", reason="saved pages need the extra view")
    return granufab.view(run_file, frames=slice(0, 2), height=500)


def test_the_cell_holds_the_page_and_nothing_else(shown: Any) -> None:
    text = shown._repr_html_()
    found = re.fullmatch(r'<iframe ([^>]*?)srcdoc="([^"]*)"></iframe>', text)
    assert found is not None
    assert html.unescape(found[2]).encode() == shown.page.content
    assert 'height="500"' in found[1]
    sandbox = re.search(r'sandbox="([^"]*)"', found[1])
    assert sandbox is not None
    assert set(sandbox[1].split()) == {"allow-scripts", "allow-downloads"}
    assert "2 of 12 frames" in repr(shown)


def test_the_page_is_saved(shown: Any, tmp_path: Path) -> None:
    path = shown.save(tmp_path / "page.html")
    assert path.read_bytes() == shown.page.content
    with pytest.raises(InvalidSettings, match="exists already"):
        shown.save(path)
    assert shown.save(path, force=True) == path


def test_runs_paths_and_lists_are_taken(run_file: Path, sphere_file: Path) -> None:
    pytest.importorskip("plotly", reason="saved pages need the extra view")
    several = [granufab.read(run_file), str(sphere_file)]
    page = granufab.view(several, frames=slice(0, 1)).page
    runs = SavedFile(page.content).contents["runs"]
    assert [one["overview"]["dimension"] for one in runs] == [2, 3]
    for wrong, words in (([], "empty list"), ([3], "got a int")):
        with pytest.raises(InvalidSettings, match=words):
            granufab.view(wrong)


def fitted(run: Run) -> AccessibleFit:
    names = ("eps_q", "z_backbone", "a_signed")
    return granufab.fit_accessible_states(*(run.series[name].to_numpy() for name in names))


def cells(text: str) -> dict[str, list[str]]:
    """The rows of a table by their first cells."""
    rows = re.findall(r"<tr>(.*?)</tr>", text)
    found = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows]
    return {
        html.unescape(row[0]): [html.unescape(cell) for cell in row[1:]] for row in found if row
    }


def test_a_run_shows_its_last_state(run_file: Path) -> None:
    run = granufab.read(run_file)
    found = cells(tables.run_table(run))
    table = granufab.fabric.measure_run(run).isel(frame=-1)
    assert found["grains"] == ["100", "disks"]
    assert found["contacts"][0] == "force"
    for text, name in (
        ("z without rattlers", "z_backbone"), ("a'", "a_signed"), ("q/p", "q_over_p"),
        ("φ", "phi"),
    ):  # fmt: skip
        assert found[text] == [f"{float(table[name]):.4g}", "-"]


def test_states_show_their_fabric_and_say_what_lacks() -> None:
    frame = next(sheared_frames(3, 1))
    values = granufab.measure(frame.packing, direction=frame.direction)
    for text in (tables.frame_table(frame), tables.packing_table(frame.packing)):
        found = cells(text)
        assert found["grains"] == ["216", "spheres"]
        assert found["z, all grains"] == [f"{values['z']:.4g}", "-"]
        assert found["contacts"] == [f"{values['contact_count']:.0f}", "force"]
    assert "a'" in cells(tables.frame_table(frame))
    bare = replace(frame.packing, contacts=None)
    assert "contacts" in tables.packing_table(bare).partition("<small>")[2]


def test_names_are_text() -> None:
    nasty = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    run = Run(series_source=series_dataset([], {}), frames=list(sheared_frames(2, 1)), name=nasty)
    for one in (run, replace(run, frames=[])):
        text = tables.run_table(one)
        assert "<script" not in text
        assert "<img" not in text
        assert html.escape(nasty) in text


def test_limits_show_intervals_and_a_picture(run_file: Path) -> None:
    domain = AccessibleDomain(z_min=3.0, z_max=3.8)
    text = tables.domain_table(domain)
    assert cells(text)["z*"] == [f"{domain.z_star:.4g}", "-"]
    assert "data:image/svg+xml;base64," in text
    fit = fitted(granufab.read(run_file))
    found = cells(tables.fit_table(fit))
    assert found["z_min"] == [f"{x:.4g}" for x in (fit.z_min.value, fit.z_min.low, fit.z_min.high)]


class _Formatter:
    """What IPython's formatters do with functions registered by name."""

    def __init__(self) -> None:
        self.known: dict[tuple[str, str], Callable[[Any], Any]] = {}

    def for_type_by_name(self, module: str, name: str, function: Callable[[Any], Any]) -> None:
        self.known[module, name] = function

    def __call__(self, value: Any) -> Any:
        for kind in type(value).__mro__:
            if (kind.__module__, kind.__name__) in self.known:
                return self.known[kind.__module__, kind.__name__](value)
        return None


def test_records_and_panels_are_registered_where_a_notebook_runs(
    monkeypatch: pytest.MonkeyPatch, run_file: Path
) -> None:
    formatters = {"text/html": _Formatter(), "image/png": _Formatter()}
    display = SimpleNamespace(formatters=formatters)
    module = SimpleNamespace(get_ipython=lambda: SimpleNamespace(display_formatter=display))
    monkeypatch.setitem(sys.modules, "IPython", module)
    assert register()
    run = granufab.read(run_file)
    frame, domain = run.frames[0], AccessibleDomain(z_min=3.0, z_max=3.8)
    for one in (run, frame, frame.packing, domain, fitted(run)):
        assert formatters["text/html"](one).startswith("<div")
    panel = granufab.plots.path(run)
    assert formatters["image/png"](panel).startswith(b"\x89PNG")
    assert panel.figure._repr_png_().startswith(b"\x89PNG")
    from matplotlib.figure import Figure

    assert formatters["image/png"](Figure().add_subplot()) is None  # not ours to show
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not register()


def test_ipython_shows_them(run_file: Path) -> None:
    shell = pytest.importorskip("IPython.core.interactiveshell", reason="needs IPython")
    try:
        format_ = shell.InteractiveShell.instance().display_formatter.format
        assert register()
        run = granufab.read(run_file)
        assert format_(run)[0]["text/html"] == tables.run_table(run)
        assert "image/png" in format_(granufab.plots.path(run))[0]
    finally:
        shell.InteractiveShell.clear_instance()
