"""What leaves the page: pictures of every panel, and the page itself as one file."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from browser import Sight, decoded, share_changed
from page_data import Subject

Look = Callable[..., Sight]
PANELS = ("packing", "rose", "mohr", "path", "series", "changes")
SVG = "{http://www.w3.org/2000/svg}"


def saved(sight: Sight, panel: str, kind: str) -> tuple[str, bytes]:
    """Name and content of the picture that a panel's button saves."""
    button = sight.page.locator(f"#{panel} button.save[data-type={kind}]").first
    with sight.page.expect_download() as waited:
        button.dispatch_event("click")
    path = waited.value.path()
    return waited.value.suggested_filename, Path(path).read_bytes()


def ink(picture: Any) -> float:
    """Share of the pixels that differ from the most common colour; one in nine is looked at."""
    part = picture[::3, ::3].reshape(-1, 3).astype(int)
    colours, counts = np.unique(part @ [65536, 256, 1], return_counts=True)
    ground = colours[np.argmax(counts)] // [65536, 256, 1] % 256
    return float(np.mean(np.abs(part - ground).max(axis=-1) > 40))


def rendered(sight: Sight, svg: bytes) -> Any:
    """The pixels of an SVG file as a browser draws it by itself, without any network."""
    page = sight.page.context.new_page()
    text = base64.b64encode(svg).decode()
    page.set_content(f'<img src="data:image/svg+xml;base64,{text}" style="width:800px">')
    page.wait_for_function("() => document.images[0].complete")
    assert page.evaluate("() => document.images[0].naturalWidth") > 100
    found = decoded(page.locator("img").screenshot())
    page.close()
    return found


@pytest.mark.parametrize(("theme", "panels"), [("light", PANELS), ("dark", PANELS[:2])])
def test_every_panel_is_saved_as_a_picture(
    look_at: Look, disks: Subject, theme: str, panels: tuple[str, ...]
) -> None:
    sight = look_at(f"{disks.address}#frame=7", theme=theme)
    sight.shown("0/7/.*")
    for panel in panels:
        sight.bring(panel)
        name, content = saved(sight, panel, "png")
        assert re.fullmatch(rf"[\w.-]*{panel}[\w.-]*\.png", name)
        picture = decoded(content)
        assert min(picture.shape[:2]) >= 300, panel
        assert 0.005 < ink(picture) < 0.98, panel
        name, content = saved(sight, panel, "svg")
        assert re.fullmatch(rf"[\w.-]*{panel}[\w.-]*\.svg", name)
        root = ElementTree.fromstring(content)
        assert root.tag == f"{SVG}svg"
        marks = [one for one in root.iter() if one.tag in (f"{SVG}path", f"{SVG}circle")]
        assert len(marks) > (50 if panel == "packing" else 10)
        assert not re.search(rb"(href|src)\s*=\s*[\"'](?!data:|#)", content)
        assert not list(root.iter(f"{SVG}script"))
        drawn = rendered(sight, content)
        assert 0.005 < ink(drawn) < 0.98, panel
        # Both are the same picture: as dark, and as full.
        assert abs(float(picture.mean()) - float(drawn.mean())) < 30, panel
        if theme == "dark":
            assert np.median(picture) < 100, panel
        else:
            assert np.median(picture) > 155 or panel == "packing", panel


def test_the_saved_picture_is_of_this_frame(look_at: Look, disks: Subject) -> None:
    sight = look_at(f"{disks.address}#frame=2")
    sight.shown("0/2/.*")
    early = {panel: saved(sight, panel, "png")[1] for panel in ("packing", "rose", "series")}
    sight.frame(3)
    for panel, content in early.items():
        later = saved(sight, panel, "png")[1]
        assert share_changed(decoded(content), decoded(later)) > 0.0005, panel


@pytest.fixture(scope="module")
def exported(run_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a run as one file."""
    from granufab.cli import main

    pytest.importorskip("plotly", reason="the export needs the extra view")
    path = tmp_path_factory.mktemp("export") / "report.html"
    with pytest.raises(SystemExit) as ended:
        main(["view", str(run_file), "--export", str(path)])
    assert ended.value.code == 0
    return path


def test_the_exported_page_opens_from_disk(look_at: Look, disks: Subject, exported: Path) -> None:
    sight = look_at(exported.as_uri())
    sight.shown("0/11/.*")
    for frame in (11, 3):
        sight.frame(frame)
        values = disks.state(frame)["values"]
        numbers = sight.numbers()
        assert len(numbers) >= 5
        assert numbers == {name: values[name] for name in numbers}
    first = {panel: sight.pixels(f"#{panel}") for panel in PANELS[:-1]}
    served = look_at(f"{disks.address}#frame=3")
    served.shown("0/3/.*")
    assert numbers == served.numbers()
    assert share_changed(first["packing"], served.pixels("#packing")) < 0.03
    sight.frame(1)
    for panel in first:
        assert share_changed(first[panel], sight.pixels(f"#{panel}")) > 0.0005, panel


def test_the_exported_page_asks_nothing_and_polls_nothing(look_at: Look, exported: Path) -> None:
    sight = look_at(exported.as_uri())
    sight.shown("0/11/.*")
    asked: list[str] = []
    sight.page.on("request", lambda request: asked.append(request.url))
    sight.page.wait_for_timeout(2500)
    sight.frame(3)
    assert [url for url in asked if not url.startswith(("blob:", "data:"))] == []
