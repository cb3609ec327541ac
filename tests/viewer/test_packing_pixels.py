"""The pixels of the packing against the plane geometry that numpy knows; what a click finds."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import Viewer
from numpy.typing import NDArray

from granufab import read
from granufab.viewer import ViewedRun, frame_buffer, unpack

RENDERERS = ("webgl2", "canvas2d")
CANVAS = "#packing canvas"
FRAME = 7
SPHERES, LAST = 1, 3
FILLED = 0.96
"""Share of the canvas that the cell fills."""

Look = Callable[..., Any]


class Scene:
    """A frame in the plane of the screen, as the page should show it, in pixels from the corner."""

    def __init__(self, sight: Any, path: Path, frame: int = FRAME, room: float = 1.0) -> None:
        run = ViewedRun(str(path), [path], lambda: read(path))
        block = frame_buffer(run.frame(frame), run.choice(None, None), before=run.frame(frame - 1))
        self.header, self.arrays = unpack(block)
        self.box = sight.page.locator(CANVAS).first.bounding_box()
        low, high = np.array(self.header["low"]), np.array(self.header["high"])
        wide = np.array([self.box["width"], self.box["height"]])
        self.middle, self.half = 0.5 * (low + high), 0.5 * wide
        self.scale = FILLED * np.min(wide / (room * (high - low)))
        self.vectors = np.array(self.header["cell"]["vectors"])

    def screen(self, place: NDArray[Any]) -> NDArray[Any]:
        return self.half + self.scale * (place - self.middle) * [1, -1]

    def pixels(self) -> NDArray[Any]:
        """Places of the middles of the pixels, shape (height, width, 2)."""
        x = np.arange(int(self.box["width"])) + 0.5
        y = np.arange(int(self.box["height"])) + 0.5
        grid = np.stack(np.meshgrid(x, y), axis=-1)
        return self.middle + (grid - self.half) / self.scale * [1, -1]

    def clearance(self) -> NDArray[Any]:
        """Distance of each pixel from the nearest rim, < 0 inside, any image counted [pixels]."""
        places = self.pixels()
        found = np.full(places.shape[:2], np.inf)
        steps = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
        for shift in steps @ self.vectors:
            for centre, radius in zip(
                self.arrays["position"] + shift, self.arrays["radius"], strict=True
            ):
                far = np.hypot(*np.moveaxis(places - centre, -1, 0)) - radius
                np.minimum(found, far, out=found)
        return found * self.scale

    def inside_cell(self, margin: float) -> NDArray[np.bool_]:
        """Pixels in the cell, at least a margin [pixels] from its edges."""
        inverse = np.linalg.inv(self.vectors)
        part = self.pixels() @ inverse
        room = margin / self.scale * np.linalg.norm(inverse, axis=0)
        return np.all((part > room) & (part < 1 - room), axis=-1)


def opened(
    look_at: Look, viewer: Viewer, renderer: str, *, more: str = "", place: str = f"0/{FRAME}"
) -> Any:
    run, frame = place.split("/")
    sight = look_at(f"{viewer.address}#run={run}&frame={frame}&renderer={renderer}{more}")
    sight.shown(f"{place}/.*")
    assert sight.ask("() => document.querySelector('#packing').dataset.renderer") == renderer
    return sight


def colour(sight: Any, name: str) -> NDArray[Any]:
    """A colour of the theme, 0 to 255."""
    text = sight.ask(
        "(name) => getComputedStyle(document.documentElement).getPropertyValue(name)", f"--{name}"
    ).strip()
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)])


def like(picture: NDArray[Any], wanted: NDArray[Any], within: int = 6) -> NDArray[np.bool_]:
    return np.abs(picture - wanted).max(axis=-1) <= within


def click(sight: Any, place: NDArray[Any]) -> str:
    sight.page.locator(CANVAS).first.click(position={"x": float(place[0]), "y": float(place[1])})
    return str(sight.text("#picked"))


@pytest.mark.parametrize("renderer", RENDERERS)
def test_every_pixel_in_the_cell_is_grain_or_empty_as_it_should_be(
    look_at: Look, viewer: Viewer, run_file: Path, renderer: str
) -> None:
    sight = opened(look_at, viewer, renderer, more="&colour=none&lines=none")
    scene, picture = Scene(sight, run_file), sight.pixels(CANVAS)
    clear, inside = scene.clearance(), scene.inside_cell(3)
    grain, empty = inside & (clear < -2), inside & (clear > 1.5)
    assert grain.sum() > 10_000
    assert empty.sum() > 1_000
    back = like(picture, colour(sight, "panel"))
    assert back[empty].all()
    assert not back[grain].any()
    # All of one colour, but for the rims of disks that overlap.
    assert like(picture, colour(sight, "grain"))[grain].mean() > 0.95
    # The border cuts: beyond it nothing is drawn.
    beyond = ~scene.inside_cell(-3)
    assert back[beyond].all()


@pytest.mark.parametrize("renderer", RENDERERS)
def test_all_images_continue_the_packing_beyond_the_cell(
    look_at: Look, viewer: Viewer, run_file: Path, renderer: str
) -> None:
    sight = opened(look_at, viewer, renderer, more="&colour=none&lines=none&images=all")
    scene, picture = Scene(sight, run_file, room=1.5), sight.pixels(CANVAS)
    clear = scene.clearance()
    beyond = ~scene.inside_cell(-25)
    empty = like(picture, colour(sight, "panel"))
    assert not empty[beyond & (clear < -2)].any()
    assert empty[beyond & (clear > 1.5)].all()
    contrast = np.abs(picture - colour(sight, "panel")).max(axis=-1)
    inside = scene.inside_cell(3) & (clear < -2)
    assert contrast[beyond & (clear < -2)].mean() < 0.75 * contrast[inside].mean()


@pytest.mark.parametrize("run", ["0/7", f"{SPHERES}/{LAST}"])
def test_both_renderers_agree_where_there_are_grains(
    look_at: Look, viewer: Viewer, run: str
) -> None:
    masks = {}
    for renderer in RENDERERS:
        sight = opened(
            look_at, viewer, renderer, place=run, more="&lines=none&colour=contact_number"
        )
        masks[renderer] = like(sight.pixels(CANVAS), colour(sight, "panel"), 40)
    assert 0.05 < masks["webgl2"].mean() < 0.95
    assert np.mean(masks["webgl2"] != masks["canvas2d"]) < 0.01


def test_rattlers_are_blue_and_only_they(look_at: Look, viewer: Viewer, run_file: Path) -> None:
    sight = opened(look_at, viewer, "webgl2", more="&colour=rattler&lines=none")
    scene, picture = Scene(sight, run_file), sight.pixels(CANVAS)
    at = np.rint(scene.screen(scene.arrays["position"]) - 0.5).astype(int)
    inside = scene.inside_cell(4)[at[:, 1], at[:, 0]]
    blue = like(picture, colour(sight, "weak"))[at[:, 1], at[:, 0]]
    held = scene.arrays["held"].astype(bool)
    assert 0 < held[inside].sum() < inside.sum()
    assert np.array_equal(blue[inside], ~held[inside])


@pytest.mark.parametrize("renderer", RENDERERS)
def test_a_contact_is_picked_on_its_line(
    look_at: Look, viewer: Viewer, run_file: Path, renderer: str
) -> None:
    sight = opened(look_at, viewer, renderer, more="&lines=contact")
    scene = Scene(sight, run_file)
    arrays = scene.arrays
    within = ~arrays["image"].any(axis=1)
    for c in np.flatnonzero(within)[:: max(within.sum() // 5, 1)]:
        i, j = arrays["pair"][c]
        ri, rj = arrays["radius"][[i, j]]
        point = arrays["position"][i] + ri / (ri + rj) * arrays["branch"][c]
        words = click(sight, scene.screen(point))
        numbers = re.match(r"contact (\d+) – (\d+)", words)
        assert numbers, words
        assert {*map(int, numbers.groups())} == {*arrays["number"][[i, j]].astype(int)}
        force = re.search(r"fₙ = ([\d.e−-]+)", words)
        assert force
        size = float(force[1].replace("−", "-"))
        assert size == pytest.approx(arrays["normal_force"][c], rel=6e-3, abs=1e-3)
        assert ("strong" in words) == (arrays["normal_force"][c] > 1)
    sight.page.select_option("#lines", "none")
    assert click(sight, scene.screen(arrays["position"][3])).startswith(
        f"grain {int(arrays['number'][3])} "
    )


def test_the_mark_follows_its_grain(look_at: Look, viewer: Viewer, run_file: Path) -> None:
    sight = opened(look_at, viewer, "webgl2", more="&lines=none&colour=none")
    first = Scene(sight, run_file)
    centre = first.arrays["position"] @ np.linalg.inv(first.vectors) - 0.5
    k = int(np.argmin(np.abs(centre).max(axis=1)))
    before = click(sight, first.screen(first.arrays["position"][k]))
    number = first.arrays["number"][k]
    for frame in (FRAME, FRAME + 1):
        sight.frame(frame)
        words = sight.text("#picked")
        assert words.startswith(f"grain {int(number)} ")
        scene = Scene(sight, run_file, frame)
        own = int(np.flatnonzero(scene.arrays["number"] == number)[0])
        marked = like(sight.pixels(CANVAS), colour(sight, "mark"), 40)
        place = scene.pixels() - scene.arrays["position"][own]
        rim = np.abs(np.hypot(*np.moveaxis(place, -1, 0)) - scene.arrays["radius"][own])
        assert marked.sum() > 50
        assert (rim[marked] * scene.scale).max() < 3
    assert sight.text("#picked") != before  # the velocity is another one


@pytest.mark.parametrize("renderer", RENDERERS)
def test_pictures_to_keep(look_at: Look, viewer: Viewer, run_file: Path, renderer: str) -> None:
    image = pytest.importorskip("PIL.Image", reason="reads the saved picture")
    sight = opened(look_at, viewer, renderer, more="&lines=contact&images=none")
    scene = Scene(sight, run_file)
    saved = {}
    for kind in ("svg", "png"):
        with sight.page.expect_download() as waiting:
            sight.page.locator(f"#packing button.save[data-type={kind}]").click()
        saved[kind] = Path(waiting.value.path()).read_bytes()
    text = saved["svg"].decode()
    assert text.count("<circle") == scene.header["grain_count"]
    crossing = int(scene.arrays["image"].any(axis=1).sum())
    lines = scene.header["contact_count"] + crossing + 4  # the cell has four edges
    assert len(re.findall(r"M[-\d.]+ [-\d.]+L", text)) == lines
    assert "<image" not in text
    with image.open(io.BytesIO(saved["png"])) as picture:
        pixels = np.asarray(picture.convert("RGB"), dtype=np.int16)
    seen = sight.pixels(CANVAS)
    assert pixels.shape[1] == 2 * seen.shape[1]
    large = pixels[: 2 * seen.shape[0]].reshape(seen.shape[0], 2, seen.shape[1], 2, 3)
    assert np.abs(large.mean(axis=(1, 3)) - seen).mean() < 4


def test_a_lost_context_comes_back(look_at: Look, viewer: Viewer) -> None:
    sight = opened(look_at, viewer, "webgl2", more="&lines=none")
    whole = sight.pixels(CANVAS)
    sight.ask(
        """() => {
          const gl = document.querySelector("#packing canvas").getContext("webgl2");
          const more = gl.getExtension("WEBGL_lose_context");
          more.loseContext();
          setTimeout(() => more.restoreContext(), 100);
        }"""
    )
    sight.page.wait_for_timeout(600)
    assert sight.ask("() => document.querySelector('#packing').dataset.renderer") == "webgl2"
    assert np.abs(sight.pixels(CANVAS) - whole).max() <= 2


def test_a_context_lost_for_good_gives_way_to_the_other_renderer(
    look_at: Look, viewer: Viewer
) -> None:
    sight = opened(look_at, viewer, "webgl2", more="&lines=none")
    whole = sight.pixels(CANVAS)
    sight.ask(
        """() => document.querySelector("#packing canvas").getContext("webgl2")
             .getExtension("WEBGL_lose_context").loseContext()"""
    )
    sight.until(
        "() => document.querySelector('#packing').dataset.renderer",
        wanted=lambda name: name == "canvas2d",
    )
    assert np.mean(np.abs(sight.pixels(CANVAS) - whole).max(axis=-1) > 40) < 0.02
