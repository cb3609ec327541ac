"""A Chromium of this system, without any network but the server of the viewer."""

from __future__ import annotations

import io
import os
import re
import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray

__all__ = ["Sight", "chromium", "end_of", "look_at", "program"]

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--force-color-profile=srgb", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)  # fmt: skip
PATIENCE = 30.0
"""Seconds until something that should appear counts as missing; nothing is timed by it."""


def program() -> str | None:
    """Path of the browser: GRANUFAB_CHROMIUM, else the first of NAMES that the system has."""
    named = os.environ.get("GRANUFAB_CHROMIUM")
    return named or next((path for name in NAMES if (path := shutil.which(name))), None)


@dataclass
class Sight:
    """A page that is looked at, and all that went wrong in it.

    Attributes:
        page: Playwright's page.
        foreign: addresses asked for that are neither the page's own nor data within it.
        errors: exceptions and errors on the console.
    """

    page: Any
    foreign: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def ask(self, words: str, given: Any = None) -> Any:
        """What a JavaScript function gives in the page."""
        return self.page.evaluate(words, given)

    def until(self, words: str, given: Any = None, wanted: Callable[[Any], Any] = bool) -> Any:
        """The value of a JavaScript function once it is as wanted; fails with the last value."""
        return self.wait(lambda: self.ask(words, given), wanted, words)

    def wait(
        self, found: Callable[[], Any], wanted: Callable[[Any], Any] = bool, what: str = "it"
    ) -> Any:
        """What a function finds once it is as wanted; fails with the last that was found."""
        end, last = time.monotonic() + PATIENCE, None
        while time.monotonic() < end:
            last = found()
            if wanted(last):
                return last
            self.page.wait_for_timeout(15)
        words = self.ask("() => document.body.innerText.slice(-300)")
        raise AssertionError(f"{what} stayed {last!r}; errors {self.errors}; page: {words}")

    def shown(self, wanted: str) -> str:
        """Wait until all is drawn of the wanted "run/frame/criterion" (a regular expression)."""
        return self.wait(self.now, lambda text: re.fullmatch(wanted, text), f"not {wanted}: shown")

    def now(self) -> str:
        """What is drawn: "run/frame/criterion"."""
        return self.ask("() => document.documentElement.dataset.shown || ''")

    def eventually(self, check: Callable[[], None]) -> None:
        """Check until all holds; what still fails in the end is raised."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                check()
                return
            except AssertionError:
                if time.monotonic() > end:
                    raise
            self.page.wait_for_timeout(30)

    def stays(self) -> str:
        """What is drawn, the same before and after a while in which the page asks for news."""
        before = self.now()
        self.page.wait_for_timeout(2000)
        assert self.now() == before
        return before

    def bring(self, panel: str) -> None:
        """Open the tab of a panel that shares its place with another."""
        if self.page.locator(f"#{panel}").is_hidden():
            self.page.locator(f"[role=tab][data-tab={panel}]:visible").click()
            self.page.locator(f"#{panel}").wait_for(state="visible")
            self.wait(lambda: self.traces(panel) or self.text(f"#{panel} .reason"), what=panel)

    def frame(self, number: int, *, run: int = 0) -> None:
        """Set the slider of the frames and wait until all is drawn."""
        self.slide("#frame", number)
        self.shown(f"{run}/{number}/.*")

    def slide(self, selector: str, value: float) -> None:
        """Set a slider as a pointer would: the value, then the events."""
        self.ask(
            """([selector, value]) => {
              const field = document.querySelector(selector);
              field.value = value;
              for (const name of ["input", "change"])
                field.dispatchEvent(new Event(name, { bubbles: true }));
            }""",
            [selector, value],
        )

    def numbers(self) -> dict[str, float | None]:
        """The exact numbers of the page by name."""
        found = self.ask(
            """() => Object.fromEntries([...document.querySelectorAll("#numbers [data-name]")]
                 .map((one) => [one.dataset.name, one.dataset.value]))"""
        )
        return {name: read_number(text) for name, text in found.items()}

    def traces(self, panel: str) -> list[dict[str, Any]]:
        """The curves of a panel's charts as plotly holds them."""
        return [trace for data in self._charts(panel, "data") for trace in data]

    def layouts(self, panel: str) -> list[dict[str, Any]]:
        """The layout of each chart of a panel."""
        return self._charts(panel, "layout")

    def _charts(self, panel: str, part: str) -> list[Any]:
        return self.ask(
            """([panel, part]) => {
              const place = document.getElementById(panel);
              return [place, ...place.querySelectorAll("*")].filter((one) => one._fullLayout)
                .map((one) => JSON.parse(JSON.stringify(one[part])));
            }""",
            [panel, part],
        )

    def pixels(self, selector: str) -> NDArray[np.int16]:
        """What is seen of an element, shape (height, width, 3)."""
        return decoded(self.page.locator(selector).first.screenshot(animations="disabled"))

    def text(self, selector: str) -> str:
        """The words of an element."""
        return str(self.page.locator(selector).first.inner_text())


def read_number(text: str) -> float | None:
    """A number of the page; None where it is unknown."""
    return None if text in ("", "null", "undefined") else float(text)


def decoded(picture: bytes) -> NDArray[np.int16]:
    """The pixels of a PNG file, shape (height, width, 3)."""
    from PIL import Image

    with Image.open(io.BytesIO(picture)) as image:
        return np.asarray(image.convert("RGB"), dtype=np.int16)


def share_changed(one: NDArray[np.int16], other: NDArray[np.int16]) -> float:
    """Share of the pixels of two pictures of one size that clearly differ."""
    assert one.shape == other.shape
    return float(np.mean(np.abs(one - other).max(axis=-1) > 24))


@pytest.fixture(scope="package")
def chromium() -> Iterator[Any]:
    """One browser for all tests of a package."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="tests in the browser need the package playwright"
    )
    path = program()
    if path is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed (.ci/chromium)")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def look_at(chromium: Any) -> Iterator[Callable[..., Sight]]:
    """Opens pages, each in a context of its own; in the end none has asked or failed anything."""
    seen: list[tuple[Sight, Any]] = []

    def look(address: str, *, theme: str = "light", size: tuple[int, int] = (1280, 720)) -> Sight:
        sight, context = opened(chromium, address, theme, size)
        seen.append((sight, context))
        return sight

    yield look
    for sight, context in seen:
        context.close()
        end_of(sight)


def end_of(sight: Sight) -> None:
    """Nothing elsewhere was asked for, and nothing failed."""
    assert sight.foreign == []
    assert sight.errors == []


def opened(
    browser: Any, address: str, theme: str = "light", size: tuple[int, int] = (1280, 720)
) -> tuple[Sight, Any]:
    """A page in a new context that reaches its own address alone."""
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, color_scheme=theme, accept_downloads=True
    )
    parts = urlsplit(address)
    own = f"{parts.scheme}://{parts.netloc}/" if parts.netloc else address.partition("#")[0]
    sight = Sight(context.new_page())

    def watch(request: Any) -> None:
        if not request.url.startswith((own, "data:", "blob:")):
            sight.foreign.append(request.url)

    context.set_default_timeout(1000 * PATIENCE)
    context.route(lambda url: not url.startswith((own, "data:", "blob:")), lambda r: r.abort())
    context.on("request", watch)
    sight.page.on("pageerror", lambda error: sight.errors.append(str(error)))
    sight.page.on(
        "console", lambda said: sight.errors.append(said.text) if said.type == "error" else None
    )
    sight.page.goto(address)
    return sight, context
