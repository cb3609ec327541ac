"""The table of docs/claims.md: every claim of the paper that has a number or a trend, and ours."""

from __future__ import annotations

from typing import Any

import numpy as np
from figures_page import Row, against, interval, number, table

Result = dict[str, Any]
HEADER = ("", "where", "the paper", "granufab, 95 %", "verdict", "page", "command")


def rows(figures: dict[str, Result], triaxial: Result) -> list[Row]:
    """One row for each claim, in the paper's order."""
    parts = (
        *(_orientations(figures["fig3"]), _velocities(figures["fig4"])),
        *(_paths(figures["fig5"]), _reversal(figures["fig5"]), _circles(figures["fig6"])),
        *(_domain(figures["fig7"]), _frictions(figures["fig8"]), _spheres(triaxial)),
    )
    return [row for part in parts for row in part]


def page(figures: dict[str, Result], triaxial: Result) -> str:
    """The table and the count of its verdicts."""
    found = rows(figures, triaxial)
    counts = {
        word: sum(row[4].startswith(word) for row in found)
        for word in ("agrees", "differs", "not seen")
    }
    assert sum(counts.values()) == len(found), [row[4] for row in found]
    told = ", ".join(f"{count} {word}" for word, count in counts.items())
    shown = [tuple(cell.replace("*", "\\*") for cell in row) for row in found]
    return f"{len(found)} claims: {told}.\n\n" + table(shown, HEADER)


def _row(claim: str, where: str, paper: str, ours: str, verdict: str) -> Row:
    """With the page and the command of the figure that the claim is tried on."""
    name = where.partition(" ")[0].lower()
    link = f"[{name}](figures.md)"
    return (claim, where, paper, ours, verdict, link, f"`granufab reproduce {name}`")


def _agreement(holds: bool, otherwise: str) -> str:
    return "agrees" if holds else otherwise


def _orientations(result: Result) -> list[Row]:
    out = []
    for name, states in result["orientation"].items():
        before, after = states["before"], states["after"]
        a, error = before["a_fitted"], 1.96 * before["a_error"]
        told = f"a {a:.3f} ({a - error:.3f} to {a + error:.3f})"
        verdict = _agreement(a - error < 0 < a + error, "differs: anisotropic")
        out.append(_row(f"isotropic before shearing, {name}", "Fig3", "a = 0", told, verdict))
        share = 100 * after["share_above_2_corrected"]
        out.append(
            _row(
                f"higher orders of E(θ) may be neglected after it, {name}",
                "Fig3",
                "second order fits",
                f"modes 4 and 6: {share:.0f} % of the power; reduced χ² {after['misfit']:.1f}",
                _agreement(share < 10, "differs: they are not small"),
            )
        )
    return out


def _velocities(result: Result) -> list[Row]:
    field = result["velocity_field"]
    far, rate, error = (np.array(field[k], float) for k in ("rate_far", "rate", "rate_far_error"))
    off = float(np.nanmax(np.abs(far - rate)))
    worst = float(np.nanmax(np.abs(far - rate) / np.maximum(error, 1e-3)))
    names = ("distance", "normal_share", "normal_share_error", "pair_count")
    distance, share, spread, count = (np.array(field[key], float) for key in names)
    known = (count >= 20) & np.isfinite(share) & np.isfinite(spread)
    disturbed = known & (np.abs(share - 1) > np.maximum(2 * spread, 0.1))
    reach = float(distance[disturbed].max())
    return [
        _row(
            "the far field of relative velocities is the imposed gradient",
            "Fig4",
            "uniform",
            f"off by {off:.3f} ε̇_q at most, {worst:.1f} standard errors",
            _agreement(off < 0.05, "differs by more than 5 %"),
        ),
        _row(
            "how far a grain disturbs it",
            "Fig4",
            "of the order of ⟨ℓ⟩",
            f"to {reach:.1f} ⟨ℓ⟩",
            _agreement(reach < 2.6, "differs: farther"),
        ),
    ]


def _state(result: Result, where: str, z_star: float, a_star: float) -> list[Row]:
    out = []
    for path in result["paths"]:
        for symbol, key, paper in (("z*", "z_star", z_star), ("a*", "a_star", a_star)):
            ours, verdict = interval(path[key]), against(path[key], paper)
            verdict = verdict.replace("within the interval", "").strip()
            out.append(_row(f"{symbol}, {path['name']} start", where, f"{paper}", ours, verdict))
    return out


def _one_state(result: Result, where: str) -> Row:
    dense, loose = (path["z_star"] for path in result["paths"][:2])
    meet = dense["low"] <= loose["high"] and loose["low"] <= dense["high"]
    ours = f"z* {interval(dense)}, {interval(loose)}"
    claim = "dense and loose starts reach one critical state"
    return _row(claim, where, "one", ours, _agreement(meet, "differs: two"))


def _paths(result: Result) -> list[Row]:
    dip = result["dip"]["depth"]
    return [
        *_state(result, "Fig5", 3.65, 0.20),
        _one_state(result, "Fig5"),
        _row(
            "z of the dense start first falls below z*",
            "Fig5",
            "a low value, then z*",
            f"by {interval(dip)}",
            _agreement(dip["low"] > 0, "not seen beyond the scatter"),
        ),
    ]


def _reversal(result: Result) -> list[Row]:
    back, a_star = result["reversal"], result["paths"][0]["a_star"]
    plateau, fall = back["a_signed_plateau"], back["z_dip"]
    meet = -a_star["high"] <= plateau["high"] and plateau["low"] <= -a_star["low"]
    return [
        _row(
            "reversed, a' passes zero and reaches −a*",
            "Fig5",
            "−a*",
            f"{interval(plateau)}; zero after ε_q = {number(back['strain_to_zero']['value'])}",
            _agreement(meet, "differs"),
        ),
        _row(
            "reversed, z falls, then returns",
            "Fig5",
            "falls",
            f"by {interval(fall)}",
            _agreement(fall["low"] > 0, "not seen beyond the scatter"),
        ),
    ]


def _circles(result: Result) -> list[Row]:
    fit = result["fit"]["default"]
    low, high = fit["z_min"]["value"] / 4, fit["z_max"]["value"] / 4
    ends = [c["centre"] + sign * c["radius"] for c in result["mohr"]["circles"] for sign in (-1, 1)]
    inside = all(low - 0.01 <= end <= high + 0.01 for end in ends)
    told = f"{min(ends):.3f} to {max(ends):.3f}; limits {low:.3f}, {high:.3f}"
    claim = "Mohr circles lie between the limit states"
    return [_row(claim, "Fig6", "inside", told, _agreement(inside, "differs: outside"))]


def _domain(result: Result) -> list[Row]:
    fit = result["fit"]["default"]
    out = [*_state(result, "Fig7", 3.35, 0.24), _one_state(result, "Fig7")]
    for name, paper in (("z_min", 2.948), ("z_max", 3.752)):
        verdict = against(fit[name], paper).replace("within the interval", "").strip()
        out.append(_row(name, "Fig7 (20)", f"{paper}", interval(fit[name]), verdict))
    beyond, worst = fit["outside_significant"], fit["outside_worst"]
    out.append(
        _row(
            "all states lie inside the domain",
            "Fig7 (19)",
            "inside, or on its limit",
            f"{100 * beyond:.1f} % outside by more than two standard deviations, worst {worst:.2f}",
            _agreement(beyond < 0.05, "differs: fluctuations leave it"),
        )
    )
    return out


def _frictions(result: Result) -> list[Row]:
    fits = result["fits"]
    names = ("z_star", "a_star", "z_max")
    z, a, top = (np.array([fit[name]["value"] for fit in fits]) for name in names)
    slopes = np.array([fit["approach"]["slope"] for fit in fits if fit["approach"]])
    product = z * a

    def span(values: np.ndarray) -> str:
        return f"{values.min():.2f} to {values.max():.2f}"

    flat = bool(np.ptp(product) < 0.05 * product.mean())
    within = bool(top.min() >= 3.65 and top.max() <= 3.85)
    along = bool(np.all(np.abs(slopes - 2) < 0.2))
    return [
        _row(
            "z* falls with µ",
            "Fig8",
            "falls",
            f"{z[0]:.2f} to {z[-1]:.2f} for µ = 0.1 to 0.9",
            _agreement(bool((np.diff(z) < 0).all()), "differs"),
        ),
        _row(
            "a* rises with µ",
            "Fig8",
            "rises",
            f"{a[0]:.2f} to {a[-1]:.2f}",
            _agreement(bool((np.diff(a) > 0).all()), "differs"),
        ),
        _row(
            "a* z* hardly depends on µ",
            "Fig8",
            "a* nearly as 1/z*",
            f"{span(product)}; from µ = 0.3 on {span(product[1:])}",
            _agreement(flat, "differs at the lowest µ"),
        ),
        _row(
            "z_max",
            "Fig8",
            "3.7 to 3.8",
            span(top),
            _agreement(within, "differs: varies more, with µ"),
        ),
        _row(
            "paths follow gain-saturation lines, az = s (z_max − z)",
            "Fig8",
            "s = 2",
            f"s = {span(slopes)}, the straight part before 90 % of a*z*",
            _agreement(along, "not seen: less steep at large µ"),
        ),
    ]


def _spheres(triaxial: Result) -> list[Row]:
    out = []
    command = "`python benchmarks/triaxial.py OUT`"
    names = (("z_min", 4.0), ("z_max", 6.0), ("z_star", 4.6), ("a_star", 0.35))
    symbols = {"z_min": "z_min", "z_max": "z_max", "z_star": "z*", "a_star": "a*"}
    for path in triaxial["paths"]:
        if path["mode"] != "compression":
            continue
        for name, paper in names:
            verdict = against(path[name], paper).replace("within the interval", "").strip()
            claim = f"spheres, {symbols[name]}, {path['start']} start"
            where, text = "(21), (22)", f"{paper:g}, an example"
            link = "[spheres](triaxial.md)"
            out.append((claim, where, text, interval(path[name]), verdict, link, command))
    return out
