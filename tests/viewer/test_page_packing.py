"""The packing is drawn as it is: areas, places and words are those of the frame."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from browser import Sight, share_changed
from numpy.typing import NDArray
from page_data import Subject

from granufab.viewer import frame_buffer, unpack

Look = Callable[..., Sight]
CANVAS = "#packing canvas"
RENDERERS = ("webgl2", "canvas2d")


def opened(look_at: Look, subject: Subject, renderer: str, more: str = "", frame: int = 7) -> Sight:
    sight = look_at(f"{subject.address}#frame={frame}&renderer={renderer}{more}")
    sight.shown(f"0/{frame}/.*")
    sight.until(
        "() => document.querySelector('#packing').dataset.renderer",
        wanted=lambda found: found == renderer,
    )
    return sight


def frame_of(subject: Subject, frame: int = 7) -> tuple[Any, dict[str, NDArray[Any]]]:
    one = subject.runs[0]
    return unpack(
        frame_buffer(one.frame(frame), one.choice(None, None), before=one.frame(frame - 1))
    )


def coarse(picture: NDArray[Any], size: int = 40) -> NDArray[Any]:
    """Mean brightness of size × size parts of the picture."""
    grey = picture.mean(axis=-1)
    high, wide = (length // size * size for length in grey.shape)
    parts = grey[:high, :wide].reshape(size, high // size, size, wide // size)
    return parts.mean(axis=(1, 3))


def test_the_fallback_draws_the_same_packing(look_at: Look, disks: Subject) -> None:
    seen = {}
    for renderer in RENDERERS:
        sight = opened(look_at, disks, renderer, "&colour=contact_number&lines=force")
        seen[renderer] = coarse(sight.pixels(CANVAS)).ravel()
        sight.frame(3)
        seen[renderer + " 3"] = coarse(sight.pixels(CANVAS)).ravel()
    same = np.corrcoef(seen["webgl2"], seen["canvas2d"])[0, 1]
    other = np.corrcoef(seen["webgl2"], seen["canvas2d 3"])[0, 1]
    assert same > 0.95
    assert other < same - 0.1


@pytest.mark.parametrize("renderer", RENDERERS)
def test_every_colour_and_every_line_is_another_picture(
    look_at: Look, disks: Subject, renderer: str
) -> None:
    sight = opened(look_at, disks, renderer)
    for field in ("colour", "lines"):
        values = sight.ask(
            f"() => [...document.querySelector('#{field}').options].map((o) => o.value)"
        )
        assert len(values) >= 5
        seen = []
        for value in values:
            sight.page.select_option(f"#{field}", value)
            sight.page.wait_for_timeout(120)
            seen.append(sight.pixels(CANVAS))
        for place, one in enumerate(seen):
            for k, other in enumerate(seen[:place]):
                assert share_changed(one, other) > 0.002, (values[place], values[k])


def pick(sight: Sight, x: float, y: float) -> str:
    """What the page says of the place of the canvas."""
    sight.page.locator(CANVAS).first.click(position={"x": x, "y": y})
    return sight.text("#picked")


def picked_grains(sight: Sight, steps: int = 9) -> list[tuple[float, float, dict[str, str]]]:
    """Places of a grid over the middle of the canvas and the grains that lie there."""
    box = sight.page.locator(CANVAS).first.bounding_box()
    found = []
    for x in np.linspace(0.3, 0.7, steps) * box["width"]:
        for y in np.linspace(0.35, 0.65, steps) * box["height"]:
            said = re.match(r"grain (\d+)\b.*?R = ([\d.e+-]+)", pick(sight, x, y), re.DOTALL)
            if said:
                found.append((x, y, {"number": said[1], "radius": said[2]}))
    return found


def plane(
    sight: Sight, header: Any, arrays: dict[str, NDArray[Any]]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The linear map from places of the canvas to the plane of the grains, and its shift."""
    inside = arrays["position"] @ np.linalg.inv(np.array(header["cell"]["vectors"]))
    central = np.all(np.abs(inside - 0.5) < 0.4, axis=1)
    place = {number: k for k, number in enumerate(arrays["number"].astype(int)) if central[k]}
    hits = [(x, y, place.get(int(grain["number"]))) for x, y, grain in picked_grains(sight)]
    seen = np.array([(x, y, 1.0) for x, y, k in hits if k is not None])
    centre = np.array([arrays["position"][k] for *_, k in hits if k is not None])
    assert len(seen) > 15
    solved = np.linalg.lstsq(seen, centre, rcond=None)[0]
    off = np.linalg.norm(seen @ solved - centre, axis=1)
    assert off.max() < 1.1 * arrays["radius"].max()  # every place lies in the grain that is named
    return solved[:2], solved[2]


@pytest.mark.parametrize("renderer", RENDERERS)
def test_what_is_picked_is_what_lies_there(look_at: Look, disks: Subject, renderer: str) -> None:
    sight = opened(look_at, disks, renderer)
    header, arrays = frame_of(disks)
    linear, shift = plane(sight, header, arrays)
    # The plane is shown as it is: one scale, x to the right, y up.
    scale = linear[0, 0]
    assert scale > 0
    assert linear == pytest.approx(np.array([[scale, 0.0], [0.0, -scale]]), abs=0.08 * scale)
    back = np.linalg.inv(linear)
    inside = arrays["position"] @ np.linalg.inv(np.array(header["cell"]["vectors"]))
    for k in np.flatnonzero(np.all(np.abs(inside - 0.5) < 0.3, axis=1))[:4]:
        words = pick(sight, *((arrays["position"][k] - shift) @ back))
        assert re.search(rf"grain {int(arrays['number'][k])}\b", words)
        radius = re.search(r"R = ([\d.e+-]+)", words)
        assert radius
        assert float(radius[1]) == pytest.approx(float(arrays["radius"][k]), rel=2e-3)
        assert f"{arrays['contact_number'][k]} contact" in words


def test_zoom_and_back(look_at: Look, disks: Subject) -> None:
    sight = opened(look_at, disks, "webgl2")
    whole = sight.pixels(CANVAS)
    box = sight.page.locator(CANVAS).first.bounding_box()
    sight.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    sight.page.mouse.wheel(0, -600)
    sight.page.wait_for_timeout(250)
    near = sight.pixels(CANVAS)
    assert share_changed(whole, near) > 0.1
    sight.page.mouse.down()
    sight.page.mouse.move(
        box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2 + 30, steps=4
    )
    sight.page.mouse.up()
    sight.page.wait_for_timeout(250)
    moved = sight.pixels(CANVAS)
    assert share_changed(near[:-30, :-60], moved[30:, 60:]) < 0.25 * share_changed(near, moved)
    sight.page.click("#whole")
    sight.page.mouse.move(5, 5)
    sight.page.wait_for_timeout(250)
    assert share_changed(whole, sight.pixels(CANVAS)) < 0.002
