"""How fast the packing of the viewer is drawn, in the browser's own clock.

For each file and each renderer: milliseconds from a frame's data to its picture and from the
request of a frame to the last panel, and pictures per second while the packing is zoomed, moved
and turned. A picture counts when its pixels can be read, so the work of the graphics
unit, or of the processor that stands in for it, is in it.

    python benchmarks/viewer.py RUN.h5 [MORE.h5 ...] [--seconds 3] [--software]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from granufab import read
from granufab.viewer import ViewedRun
from granufab.viewer.server import serving

SIZE = {"width": 1280, "height": 720}
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
DEVICE = """() => {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return null;
  const more = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(more ? more.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
}"""
STEP = """(frame) => new Promise((done) => {
  const page = document.documentElement;
  const slider = document.getElementById("frame");
  const seen = page.dataset.shown;
  const started = performance.now();
  new MutationObserver((_, watch) => {
    if (page.dataset.shown === seen) return;
    watch.disconnect();
    requestAnimationFrame(() => done([Number(page.dataset.drawn), performance.now() - started]));
  }).observe(page, { attributes: true });
  slider.value = frame;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
})"""
MOVE = """([kind, seconds]) => new Promise((done) => {
  const canvas = document.getElementById("canvas");
  const box = canvas.getBoundingClientRect();
  const always = { bubbles: true, cancelable: true, pointerId: 1 };
  const at = (x, y) => ({ clientX: box.left + x, clientY: box.top + y, ...always });
  const middle = [box.width / 2, box.height / 2];
  const stamps = [];
  if (kind !== "zoom") canvas.dispatchEvent(new PointerEvent("pointerdown", at(...middle)));
  const move = (now) => {
    stamps.push(now);
    const turn = stamps.length / 15;
    if (kind === "zoom") {
      const deltaY = -60 * Math.cos(turn);
      canvas.dispatchEvent(new WheelEvent("wheel", { ...at(...middle), deltaY }));
    } else {
      const to = at(middle[0] + 90 * Math.sin(turn), middle[1] + 40 * (1 - Math.cos(turn)));
      canvas.dispatchEvent(new PointerEvent("pointermove", { ...to, shiftKey: kind === "pan" }));
    }
    if (now - stamps[0] < 1000 * seconds) requestAnimationFrame(move);
    else {
      if (kind !== "zoom") canvas.dispatchEvent(new PointerEvent("pointerup", at(...middle)));
      canvas.dispatchEvent(new MouseEvent("dblclick", at(...middle)));
      const gaps = stamps.slice(1).map((stamp, k) => stamp - stamps[k]).sort((a, b) => a - b);
      const whole = stamps.at(-1) - stamps[0];
      done({ per_second: (1000 * gaps.length) / whole, slowest_ms: gaps.at(-1) });
    }
  };
  requestAnimationFrame(move);
})"""


def measured(
    page: Page, address: str, *, dimension: int, seconds: float, renderer: str
) -> dict[str, Any]:
    """One file under one renderer."""
    page.goto("about:blank")
    page.goto(f"{address}#renderer={renderer}")
    page.wait_for_selector("html[data-shown]", state="attached", timeout=60_000)
    last = int(page.get_attribute("#frame", "max") or 0)
    steps = [page.evaluate(STEP, frame) for frame in range(max(last - 6, 0), last)]
    page.wait_for_timeout(400)
    kinds = ["zoom", "pan", *["turn"] * (dimension == 3)]
    moves = {kind: page.evaluate(MOVE, [kind, seconds]) for kind in kinds}
    drawn, change = ([round(value, 1) for value in column] for column in zip(*steps, strict=True))
    return {
        "asked": renderer,
        "renderer": page.get_attribute("#packing", "data-renderer"),
        "drawn_ms": spread(drawn),
        "change_ms": spread(change),
        **{
            kind: {name: round(value, 1) for name, value in found.items()}
            for kind, found in moves.items()
        },
    }


def spread(values: list[float]) -> dict[str, float]:
    """Median and ends: on a machine with other work the least is the nearest to the cost."""
    return {"median": statistics.median(values), "least": min(values), "largest": max(values)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--software", action="store_true", help="draw on the processor")
    parser.add_argument("--chromium", default="/usr/bin/chromium")
    given = parser.parse_args()
    report: dict[str, Any] = {"cores": os.cpu_count(), "machine": platform.machine(), **SIZE}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=given.chromium, args=["--no-sandbox", *SOFTWARE * given.software]
        )
        page = browser.new_page(viewport=SIZE)  # pyright: ignore[reportArgumentType]
        report |= {"browser": browser.version, "device": page.evaluate(DEVICE), "files": []}
        for path in given.files:
            run = read(path)
            grains = next(iter(run.frames)).packing
            viewed = ViewedRun(path, [Path(path)], lambda run=run: run)
            with serving([viewed]) as address:
                for renderer in ("webgl2", "canvas2d", "chosen"):
                    options = {"dimension": grains.dimension, "renderer": renderer}
                    found = measured(page, address, seconds=given.seconds, **options)
                    words = {"dimension": grains.dimension, "grains": grains.grains.count}
                    report["files"].append(words | found)
        browser.close()
    json.dump(report, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
