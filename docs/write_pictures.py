"""Write docs/pictures/viewer: the page on runs made here, at two sizes, light and dark.

Needs granufab[dev], and a Chromium (.ci/chromium). The runs are kept in build/pictures, made anew
with --force; they take about a minute.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "viewer"))

from browser import FLAGS, Sight, end_of, opened, program  # noqa: E402

from granufab import read  # noqa: E402
from granufab.viewer import ViewedRun  # noqa: E402
from granufab.viewer.server import serving  # noqa: E402

WORK, OUT = ROOT / "build" / "pictures", ROOT / "docs" / "pictures" / "viewer"
SIZES, THEMES = ((1280, 720), (1920, 1080)), ("light", "dark")
MOST_BYTES, MOST_TOGETHER = 150_000, 4_000_000
QUICK = {"path.0.inertial_number": 1e-3, "path.0.strain": 0.24, "record.frame_interval": 0.012}
CASES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "loose": ("shear", {**QUICK, "sample.grain_count": 220, "sample.friction": 0.6}),
    "dense": ("shear", {**QUICK, "sample.grain_count": 220, "sample.seed": 2}),
    "spheres": ("triaxial", {
        "sample.grain_count": 300, "path.0.inertial_number": 2e-3, "path.0.strain": 0.3,
        "record.frame_interval": 0.02,
    }),
}  # fmt: skip


@dataclass(frozen=True)
class View:
    """A page to take pictures of: files, what the address says, and a place to click."""

    files: tuple[str, ...]
    choice: Mapping[str, Any] = field(default_factory=dict)
    pick: tuple[float, float] | None = None


VIEWS = {
    "disks": View(("loose/run.h5",), {"frame": 8, "lines": "strong"}, pick=(0.46, 0.52)),
    "spheres": View(("spheres/run.h5",), {"frame": 9}),
    "several": View(("loose/run.h5", "dense/run.h5"), {"frame": 6, "plane": "az"}),
    "path": View(("loose/run.h5", "dense/run.h5"), {"frame": 12, "large": "path"}),
    "rose": View(("loose/run.h5",), {"frame": 4, "large": "rose"}),
    "changes": View(("dense/run.h5",), {"frame": 2, "lines": "changes", "tab": "changes"}),
    "foreign": View(("foreign/disks.xyz",), {}),
}


def granufab(*arguments: object) -> str:
    """What a verb prints, in a process of its own."""
    command = [sys.executable, "-c", "from granufab.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def make_runs(work: Path, *, force: bool) -> None:
    """The runs of CASES, and states of one of them as another program would give them."""
    work.mkdir(parents=True, exist_ok=True)
    for name, (template, changes) in CASES.items():
        if (work / name / "run.h5").exists() and not force:
            continue
        case = work / f"{name}.toml"
        settings = [item for key, value in changes.items() for item in ("--set", f"{key}={value}")]
        case.write_text(granufab("new", template))
        granufab("run", case, "--out", work / name, "--force", *settings)
    foreign = work / "foreign" / "disks.xyz"
    if force or not foreign.exists():
        foreign.parent.mkdir(exist_ok=True)
        granufab("export", work / "loose" / "run.h5", "-o", foreign, "--force")


def viewed(path: Path) -> ViewedRun:
    """A run under the name that its folder has."""
    return ViewedRun("/".join(path.parts[-2:]), [path], lambda: read(path))


@contextmanager
def browsing() -> Iterator[Any]:
    """A browser of this system."""
    from playwright.sync_api import sync_playwright

    path = program()
    if path is None:
        sys.exit("write_pictures: no Chromium; .ci/chromium installs one")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


def show(browser: Any, address: str, view: View, theme: str, size: tuple[int, int]) -> bytes:
    """A screenshot of a view, once everything in it is drawn."""
    hashed = "&".join(f"{name}={value}" for name, value in view.choice.items())
    sight, context = opened(browser, f"{address}#{hashed}", theme, size)
    sight.shown(rf"0/{view.choice.get('frame', '[0-9]+')}/.*")
    sight.page.wait_for_timeout(1500)  # plotly moves labels into place
    if view.pick is not None:
        pick(sight, *view.pick)
    picture = sight.page.screenshot()
    context.close()
    end_of(sight)
    return picture


def pick(sight: Sight, x: float, y: float) -> None:
    """Pick the first grain from a place on, given as shares of the packing's canvas."""
    canvas = sight.page.locator("#packing canvas").first
    box = canvas.bounding_box()
    for step in range(12):
        canvas.click(position={"x": x * box["width"] + 7 * step, "y": y * box["height"]})
        sight.page.wait_for_timeout(100)
        if "grain" in sight.text("#picked"):
            return


def small(picture: bytes) -> bytes:
    """The picture in as many colours as MOST_BYTES allows."""
    content = picture
    with Image.open(io.BytesIO(picture)) as image:
        for colours in (192, 128, 96, 64, 48, 32, 24):
            held = io.BytesIO()
            few = image.convert("RGB").quantize(  # keeps rare colours: thin lines stay themselves
                colours, Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE
            )
            few.save(held, "PNG", optimize=True)
            content = held.getvalue()
            if len(content) <= MOST_BYTES:
                return content
    raise SystemExit(f"write_pictures: a picture of {len(content)} bytes, {MOST_BYTES} at most")


def main() -> None:
    """Make the runs, take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--force", action="store_true", help="make the runs anew")
    parser.add_argument("--only", nargs="*", default=list(VIEWS), choices=list(VIEWS))
    given = parser.parse_args()
    make_runs(WORK, force=given.force)
    OUT.mkdir(parents=True, exist_ok=True)
    with browsing() as browser:
        for name in given.only:
            view = VIEWS[name]
            with serving([viewed(WORK / file) for file in view.files]) as address:
                for size in SIZES:
                    for theme in THEMES:
                        path = OUT / f"{name}-{size[1]}-{theme}.png"
                        path.write_bytes(small(show(browser, address, view, theme, size)))
                        print(path.relative_to(ROOT), path.stat().st_size)
    together = sum(path.stat().st_size for path in OUT.glob("*.png"))
    if together > MOST_TOGETHER:
        sys.exit(f"write_pictures: {together} bytes together, {MOST_TOGETHER} at most")


if __name__ == "__main__":
    main()
