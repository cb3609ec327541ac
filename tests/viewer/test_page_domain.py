"""The accessible domain follows its handles, and several runs lie over one another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from browser import Sight
from numpy.typing import NDArray
from page_data import Subject
from test_page import rings

Look = Callable[..., Sight]
HANDLE = "#path [role=slider][data-limit={}]"


def limits(sight: Sight) -> tuple[float, float]:
    """z_min and z_max of the two states of the Mohr plane, of which G = z/4 in 2D."""
    ends = [trace["x"] for trace in sight.traces("mohr") if len(trace.get("x") or []) == 2]
    assert len(ends) == 1
    return 4 * ends[0][0], 4 * ends[0][1]


def border(slopes: list[float], z_min: float, z_max: float, z: NDArray[Any]) -> NDArray[Any]:
    """The largest anisotropy, as docs/viewer.md writes it."""
    return np.minimum(slopes[0] * (1 - z_min / z), slopes[1] * (z_max / z - 1))


def follows(sight: Sight, subject: Subject, z_min: float, z_max: float, *, az: bool) -> None:
    """The border of the domain, its critical state and the critical circle are those of limits."""
    slopes = subject.domain()["slopes"]
    curves = [(np.array(t["x"]), np.array(t["y"])) for t in sight.traces("path") if closed(t)]
    wanted = [border(slopes, z_min, z_max, z) * (z if az else 1) for z, _ in curves]
    near = [np.abs(np.abs(y) - w).max() < 1e-9 for (_, y), w in zip(curves, wanted, strict=True)]
    assert any(near)
    z = curves[near.index(True)][0]
    assert (z.min(), z.max()) == pytest.approx((z_min, z_max), abs=1e-9)
    star = (slopes[0] * z_min + slopes[1] * z_max) / (slopes[0] + slopes[1])
    a = float(border(slopes, z_min, z_max, np.array(star))) * (star if az else 1)
    stars = [(t["x"][0], abs(t["y"][0])) for t in sight.traces("path") if len(t["x"]) == 1]
    assert pytest.approx((star, a), abs=1e-9) in stars
    circles = [np.array(t["x"]) for t in sight.traces("mohr") if len(t.get("x") or []) > 20]
    ends = [(float(x.min()), float(x.max())) for x in circles]
    assert pytest.approx((z_min / 4, z_max / 4), abs=1e-9) in ends


def closed(trace: dict[str, Any]) -> bool:
    """Whether a curve is long, whole, and ends without anisotropy."""
    x, y = trace.get("x") or [], trace.get("y") or []
    whole = len(x) == len(y) > 10 and None not in x and None not in y
    return whole and abs(y[0]) < 1e-9 and abs(y[-1]) < 1e-9


def value(sight: Sight, limit: str) -> float:
    return float(sight.page.locator(HANDLE.format(limit)).get_attribute("aria-valuenow"))


def drag(sight: Sight, limit: str, by: float) -> None:
    """Move a handle sideways with the pointer."""
    box = sight.page.locator(HANDLE.format(limit)).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    sight.page.mouse.move(x, y)
    sight.page.mouse.down()
    for share in (0.3, 0.7, 1.0):
        sight.page.mouse.move(x + share * by, y)
    sight.page.mouse.up()


@pytest.mark.parametrize("plane", ["a", "az"])
def test_a_dragged_handle_moves_the_domain(look_at: Look, disks: Subject, plane: str) -> None:
    sight = look_at(f"{disks.address}#plane={plane}")
    sight.shown("0/11/.*")
    fitted = disks.domain()
    before = (fitted["z_min"], fitted["z_max"])
    assert limits(sight) == pytest.approx(before, abs=1e-9)
    follows(sight, disks, *before, az=plane == "az")
    for limit, by in (("z_min", 24), ("z_max", -24), ("z_min", -40)):
        drag(sight, limit, by)
        place = 0 if limit == "z_min" else 1

        def check(before=before, place=place, limit=limit, by=by) -> None:
            now = limits(sight)
            assert (now[place] - before[place]) * by > 0
            assert now[1 - place] == pytest.approx(before[1 - place], abs=1e-9)
            assert now[place] == pytest.approx(value(sight, limit), abs=1e-3)
            follows(sight, disks, *now, az=plane == "az")

        sight.eventually(check)
        now = limits(sight)
        before = now
    drag(sight, "z_min", 900)  # never beyond the other one

    def crossing() -> None:
        now = limits(sight)
        assert before[0] < now[0] < now[1] == pytest.approx(before[1], abs=1e-9)
        follows(sight, disks, *now, az=plane == "az")

    sight.eventually(crossing)
    assert sight.now().startswith("0/11/")


def moved_from(sight: Sight, before: tuple[float, float]) -> tuple[float, float]:
    """The limits, once they are others and the chart stands."""
    return sight.wait(lambda: limits(sight), lambda found: found != pytest.approx(before, abs=1e-9))


def test_arrow_keys_move_the_handles(look_at: Look, disks: Subject) -> None:
    sight = look_at(f"{disks.address}#frame=6")
    sight.shown("0/6/.*")
    for limit, key, sign in (("z_min", "ArrowRight", 1), ("z_max", "ArrowLeft", -1)):
        before, shown = limits(sight), value(sight, limit)
        place = 0 if limit == "z_min" else 1
        sight.page.focus(HANDLE.format(limit))
        for _ in range(3):
            sight.page.keyboard.press(key)

        def check(before=before, place=place, limit=limit, sign=sign, shown=shown) -> None:
            now = limits(sight)
            assert sign * (now[place] - before[place]) > 0
            assert sign * (value(sight, limit) - shown) > 0
            assert now[place] == pytest.approx(value(sight, limit), abs=1e-3)
            follows(sight, disks, *now, az=False)

        sight.eventually(check)
        assert sight.stays().startswith("0/6/")  # the keys belong to the handle
    again = look_at(disks.address + sight.ask("() => location.hash"))
    again.shown("0/6/.*")
    assert limits(again) == pytest.approx(limits(sight), abs=1e-9)
    again.page.click("#fitted")
    fitted = disks.domain()
    assert moved_from(again, limits(sight)) == pytest.approx((fitted["z_min"], fitted["z_max"]))


def test_both_planes_show_the_path(look_at: Look, disks: Subject) -> None:
    sight = look_at(f"{disks.address}#frame=3")
    sight.shown("0/3/.*")
    run = disks.runs[0].run
    z, a = (np.array(run.series[name]) for name in ("z_backbone", "a_signed"))
    point = disks.state(3)["point"]
    for plane, wanted, mark in (("az", a * z, point["az"]), ("a", a, point["a"])):
        sight.page.select_option("#plane", plane)
        sight.wait(lambda y=wanted: line(sight, z, y), what=f"the path in {plane}")
        near = pytest.approx((point["z"], mark), abs=1e-9)
        sight.wait(lambda: rings(sight), lambda found, near=near: found == [near])


def line(sight: Sight, x: NDArray[Any], y: NDArray[Any]) -> bool:
    """Whether the path has a curve through these points."""
    return any(
        "lines" in (trace.get("mode") or "")
        and trace["x"] == pytest.approx(x.tolist(), abs=1e-9)
        and trace["y"] == pytest.approx(y.tolist(), abs=1e-9)
        for trace in sight.traces("path")
        if len(trace["x"]) == len(x) and None not in trace["y"]
    )


def test_several_runs_lie_over_one_another(look_at: Look, two_runs: Subject) -> None:
    sight = look_at(two_runs.address)
    sight.shown("0/11/.*")
    for viewed in two_runs.runs:
        series = viewed.run.series
        assert line(sight, np.array(series["z_backbone"]), np.array(series["a_signed"]))
    colours = {
        trace["line"]["color"]
        for trace in sight.traces("path")
        if len(trace["x"]) in (40, 30) and "lines" in trace["mode"]
    }
    assert len(colours) == 2
    words = sight.ask("() => document.querySelector('#path').textContent")
    assert "disks0" in words
    assert "second0" in words
    # Each run has a mark: the state, and of the other run the record nearest in strain.
    sight.frame(2)
    second = two_runs.runs[1].run.series
    near = int(np.argmin(np.abs(np.array(second["eps_q"]) - two_runs.strain(2))))
    own = two_runs.state(2)["point"]
    other = float(second["z_backbone"][near]), float(second["a_signed"][near])
    assert set(rings(sight)) == {(own["z"], own["a"]), other}
