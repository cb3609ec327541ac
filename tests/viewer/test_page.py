"""One choice of frame and criterion moves the whole page, and its numbers are those of Python."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Sight, share_changed
from page_data import Subject

Look = Callable[..., Sight]
PANELS = ("packing", "rose", "mohr", "path", "series", "changes")
LEAST = {
    "packing": 0.05,
    "rose": 0.01,
    "mohr": 0.005,
    "path": 0.001,
    "series": 0.001,
    "changes": 0.01,
}
"""Share of the pixels that another frame changes; of a ring and a line it is small."""


def coordinates(trace: dict[str, Any]) -> list[float]:
    """All numbers of a curve or of its points."""
    found: list[float] = []
    for name in ("x", "y", "r", "theta"):
        values = trace.get(name) or []
        found += [value for value in values if isinstance(value, int | float)]
    return found


def drawn(sight: Sight, panel: str) -> list[list[float]]:
    return [coordinates(trace) for trace in sight.traces(panel)]


def holds(curves: list[list[float]], wanted: list[float]) -> bool:
    """Whether one curve goes through all the wanted numbers."""
    return any(
        len(curve) > 0
        and all(np.min(np.abs(np.array(curve) - value)) < 1e-9 for value in wanted)
        for curve in curves
    )  # fmt: skip


def circle(curve: dict[str, Any]) -> tuple[float, float] | None:
    """Centre and radius of a curve that is a circle about the first axis."""
    x, y = np.array(curve.get("x") or [0.0]), np.array(curve.get("y") or [0.0])
    if len(x) < 20 or len(x) != len(y) or None in x or None in y:
        return None
    centre = 0.5 * float(x.min() + x.max())
    radius = np.hypot(x - centre, y)
    return (centre, float(radius.mean())) if np.ptp(radius) < 1e-9 else None


def cursors(sight: Sight) -> list[float]:
    """Where upright lines stand in the series."""
    found = sight.ask(
        "() => [...document.querySelectorAll('#series .cursor')].map((one) => one.dataset.value)"
    )
    return [float(value) for value in found]


def rings(sight: Sight) -> list[tuple[float, float]]:
    """The states that the path marks."""
    found = sight.ask(
        """() => [...document.querySelectorAll("#path .overlay .ring")]
             .map((one) => [one.dataset.z, one.dataset.y])"""
    )
    return [(float(z), float(y)) for z, y in found]


def agree(sight: Sight, subject: Subject, frame: int, criterion: str | None = None) -> None:
    """Every chart shows the numbers that Python gives for a frame."""
    state = subject.state(frame, criterion)
    wanted = state["mohr"]["circles"][0]
    circles = [found for trace in sight.traces("mohr") if (found := circle(trace))]
    assert any(found == pytest.approx(tuple(wanted), abs=1e-9) for found in circles)
    assert (state["point"]["z"], state["point"]["a"]) in rings(sight)
    if sight.page.locator("#rose").is_visible():
        assert holds(drawn(sight, "rose"), state["rose"]["E"])
        return
    interval = subject.interval(frame, criterion)
    for name in ("gain", "loss"):
        counts = np.array([float(value) for value in interval[name] if value])
        assert len(counts)
        curves = drawn(sight, "changes")
        assert holds(curves, list(counts)) or holds(curves, list(-counts))


def test_the_slider_moves_every_panel(look_at: Look, disks: Subject) -> None:
    sight = look_at(disks.address)
    sight.shown("0/11/.*")
    for panels in (("packing", "rose", "mohr", "path", "series"), ("changes",)):
        sight.bring(panels[-1])
        seen, numbers = [], []
        for frame in (1, 3):
            sight.frame(frame)
            agree(sight, disks, frame)
            assert cursors(sight) == [disks.strain(frame)]
            numbers.append(sight.numbers())
            seen.append({panel: sight.pixels(f"#{panel}") for panel in panels})
        assert all(numbers[0][name] != numbers[1][name] for name in ("z_backbone", "a_signed"))
        for panel in panels:
            assert share_changed(seen[0][panel], seen[1][panel]) > LEAST[panel], panel


def test_numbers_are_those_of_measure(
    look_at: Look, disks: Subject, run_file: Path, output_of: Callable[..., Any]
) -> None:
    sight = look_at(disks.address)
    sight.shown("0/11/.*")
    for frame in (7, 0):
        sight.frame(frame)
        (wanted,) = output_of("measure", run_file, "--frame", frame, "--json")
        found = sight.numbers()
        assert len(found) >= 5
        assert found == {name: wanted[name] for name in found}


def test_the_definition_of_z_is_followed(look_at: Look, disks: Subject) -> None:
    sight = look_at(disks.address)
    sight.shown("0/11/.*")
    for definition in ("z", "z_mechanical"):
        sight.page.select_option("#definition", definition)
        values = disks.state(11, None, definition)["values"]
        sight.wait(
            lambda name=definition: sight.numbers().get(name),
            lambda found, wanted=values[definition]: found == wanted,
            definition,
        )
        mark = (values[definition], values["a_signed"])
        sight.wait(lambda: rings(sight), lambda found, mark=mark: mark in found)
    sight.frame(6)
    state = disks.state(6, None, "z_mechanical")
    assert sight.numbers()["z_mechanical"] == state["values"]["z_mechanical"]


@pytest.mark.parametrize("kind", ["force", "gap"])
def test_dragging_the_criterion_changes_z_as_python_says(
    look_at: Look, disks: Subject, kind: str
) -> None:
    sight = look_at(f"{disks.address}#frame=8")
    sight.shown("0/8/.*")
    track = disks.thresholds(8, kind)
    sight.page.select_option("#kind", kind)
    sight.shown(f"0/8/{kind}:.*")
    box = sight.page.locator("#threshold").bounding_box()
    y = box["y"] + 0.5 * box["height"]
    sight.page.mouse.move(box["x"] + 0.5 * box["width"], y)
    sight.page.mouse.down()
    found = {}
    for share in (0.3, 0.8, 0.88):
        sight.page.mouse.move(box["x"] + share * box["width"], y)
        level = sight.ask("() => Number(document.querySelector('#threshold').value)")
        assert 0 < level < len(track)
        sight.wait(
            lambda: threshold_of(sight),
            lambda now, wanted=track[level]: now == pytest.approx(wanted, rel=1e-9),
        )
        criterion = sight.now().split("/", 2)[2]
        agree(sight, disks, 8, criterion)
        values = disks.state(8, criterion)["values"]
        numbers = sight.numbers()
        assert numbers == {name: values[name] for name in numbers}
        found[track[level]] = numbers["z_backbone"]
    sight.page.mouse.up()
    assert len(found) == 3
    rising = [found[threshold] for threshold in sorted(found)]
    assert rising == sorted(rising, reverse=kind == "force")
    assert len(set(rising)) > 1


def threshold_of(sight: Sight) -> float:
    """The threshold of the criterion that is drawn."""
    return float(sight.now().partition(":")[2] or "nan")


def test_keys_step_and_play_runs(look_at: Look, disks: Subject) -> None:
    sight = look_at(f"{disks.address}#frame=5")
    sight.shown("0/5/.*")
    for key, frame in (
        ("ArrowRight", 6), ("ArrowLeft", 5), ("ArrowLeft", 4), ("Home", 0), ("ArrowLeft", 0),
        ("End", 11),
    ):  # fmt: skip
        sight.page.keyboard.press(key)
        sight.shown(f"0/{frame}/.*")
        assert sight.ask("() => Number(document.querySelector('#frame').value)") == frame
        assert sight.numbers()["a_signed"] == disks.state(frame)["values"]["a_signed"]
    sight.page.click("#play")
    seen = {sight.shown(f"0/{frame}/.*") for frame in (0, 3, 5)}
    assert len(seen) == 3
    sight.page.click("#play")
    sight.page.wait_for_timeout(800)  # what was under way
    sight.stays()


def test_the_address_restores_the_state(look_at: Look, two_runs: Subject) -> None:
    first = look_at(two_runs.address)
    first.shown("0/11/.*")
    first.page.select_option("#run", "1")
    first.shown("1/6/.*")
    first.frame(2, run=1)
    first.page.select_option("#kind", "gap")
    first.shown("1/2/gap:.*")
    first.slide("#threshold", 9)
    old = first.now()
    place = first.wait(first.now, lambda now: now != old)
    for name, value in (("colour", "spin"), ("lines", "changes"), ("plane", "az")):
        first.page.select_option(f"#{name}", value)
    first.page.click("#theme")
    hashed = first.until("() => location.hash", wanted=lambda text: "dark" in text)
    second = look_at(two_runs.address + hashed)
    second.shown(place.replace("+", r"\+"))
    for name in ("run", "frame", "kind", "threshold", "colour", "lines", "plane", "definition"):
        value = f"() => document.getElementById('{name}').value"
        assert second.ask(value) == first.ask(value), name
    assert second.numbers() == first.numbers()
    assert drawn(second, "path") == drawn(first, "path")
    assert share_changed(first.pixels("#packing canvas"), second.pixels("#packing canvas")) < 0.01
    assert luminance(second, "body") < 90


def luminance(sight: Sight, selector: str) -> float:
    """Mean brightness of what is seen, 0 to 255."""
    return float(sight.pixels(selector).mean())


def test_light_and_dark_are_seen(look_at: Look, disks: Subject) -> None:
    sight = look_at(disks.address)
    sight.shown("0/11/.*")
    for panel in (*PANELS, "numbers"):
        sight.bring(panel)
        light = luminance(sight, f"#{panel}")
        sight.page.click("#theme")
        dark = sight.wait(
            lambda panel=panel: luminance(sight, f"#{panel}"),
            lambda found, light=light: light - found > 60,
            panel,
        )
        assert np.ptp(sight.pixels(f"#{panel}")) > 60, panel  # ink is seen on it
        assert dark < 128 < light
        sight.page.click("#theme")
        sight.wait(
            lambda panel=panel: luminance(sight, f"#{panel}"),
            lambda found, light=light: abs(found - light) < 1,
            panel,
        )
    again = look_at(disks.address, theme="dark")
    again.shown("0/11/.*")
    assert luminance(again, "#mohr") < 100


def test_without_the_token_the_page_is_refused(look_at: Look, disks: Subject) -> None:
    sight = look_at(disks.address)
    sight.shown("0/11/.*")
    context = sight.page.context.browser.new_context()
    bare = context.new_page()
    for address in (disks.address.partition("?")[0], disks.address[:-1] + "_"):
        answer = bare.goto(address)
        assert answer.status == 403
        assert "token" in bare.inner_text("body")
        assert bare.locator("#packing").count() == 0
    context.close()
