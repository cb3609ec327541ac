"""The tables of docs/figures.md from what was kept of ``granufab reproduce all``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Row = tuple[str, ...]
Result = dict[str, Any]


def number(value: float | None, digits: int = 3) -> str:
    """A number, or a dash."""
    return "–" if value is None else f"{value:.{digits}f}"


def interval(estimate: dict[str, float] | None, digits: int = 3) -> str:
    """Value and 95 % interval."""
    if estimate is None:
        return "–"
    value, low, high = (f"{estimate[key]:.{digits}f}" for key in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


def against(estimate: dict[str, float] | None, paper: float) -> str:
    """Whether the paper's value lies in our interval, and how far it lies off."""
    if estimate is None:
        return "not measured"
    if estimate["low"] <= paper <= estimate["high"]:
        return "agrees within the interval"
    return f"differs by {estimate['value'] - paper:+.2f}"


def table(rows: list[Row], header: Row) -> str:
    """A Markdown table."""
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def compared(rows: list[Row]) -> str:
    """A table of quantity, the paper's, ours and verdict."""
    return table(rows, ("", "the paper", "granufab", "verdict"))


def fig1(result: Result) -> str:
    """The two samples."""
    rows = [
        (
            name,
            f"{state['grain_count']:.0f}",
            number(state["eps_q"], 2),
            f"{state['contact_count']:.0f}",
            number(state["z_backbone"]),
            f"{100 * state['rattler_fraction']:.1f} %",
            number(state["a_signed"]),
            number(state["phi"]),
        )
        for name, state in result["states"].items()
    ]
    return table(rows, ("sample", "grains", "ε_q", "contacts", "z", "rattlers", "a'", "φ"))


def fig2(result: Result) -> str:
    """Angles round one grain, and exclusions of all."""
    grain, whole = result["environment"], result["texture"]
    angles = zip(grain["angle_to_next_degrees"], grain["exclusion_to_next_degrees"], strict=True)
    text = ", ".join(f"{angle:.0f} ({least:.0f})" for angle, least in angles)
    # Contacts overlap by 1e-4 d or so, which lets angles fall short by as little.
    room = min(grain["room_to_next_degrees"])
    verdict = (
        "no angle is below its δθ" if room > -0.1 else f"an angle is {-room:.2f}° below its δθ"
    )
    return compared(
        [
            ("angles between successive contacts, and δθ [degree]", "–", text, verdict),
            (
                "mean δθ of the sizes [degree]",
                "–",
                number(whole["delta_theta_geometric_degrees"], 1),
                "60 for equal disks",
            ),
            (
                "z_steric = 2π/δθ, δθ the 1 % quantile of the angles",
                "–",
                number(whole["z_steric"], 2),
                "6 for equal disks; above it, as small neighbours need less room",
            ),
        ]
    )


def fig3(result: Result) -> str:
    """Harmonics before and after."""
    rows = []
    for name, states in result["orientation"].items():
        for state, data in states.items():
            left = data["share_above_2_corrected"]
            noisy = abs(data["a_fitted"]) < 3 * data["a_error"]
            rows.append(
                (
                    f"{name}, {state}",
                    "isotropic" if state == "before" else "second order is enough",
                    f"z {data['z_fitted']:.3f}, a {data['a_fitted']:.3f} ± {data['a_error']:.3f}, "
                    f"reduced χ² {data['misfit']:.2f}",
                    "isotropic within noise"
                    if noisy
                    else f"modes 4 and 6 hold {100 * left:.1f} % of the power",
                )
            )
    return compared(rows) + "\n\n" + amplitudes(result)


def amplitudes(result: Result) -> str:
    """Amplitude of each mode after shearing."""
    rows = []
    for name, states in result["orientation"].items():
        after = states["after"]
        pairs = zip(after["amplitude"], after["amplitude_error"], strict=True)
        rows.append((f"{name}, after", *(f"{size:.2f} ± {error:.2f}" for size, error in pairs)))
    return table(rows, ("amplitude over that of mode 0", "mode 2", "mode 4", "mode 6"))


def fig4(result: Result) -> str:
    """Far field and where it ends."""
    field = result["velocity_field"]
    rate, far, error = (np.array(field[k], float) for k in ("rate", "rate_far", "rate_far_error"))
    off = np.nanmax(np.abs(far - rate) / np.maximum(error, 1e-3))
    columns = ("distance", "normal_share", "normal_share_error", "pair_count")
    distance, share, spread, count = (np.array(field[key], float) for key in columns)
    known = (count >= 20) & np.isfinite(share) & np.isfinite(spread)
    disturbed = known & (np.abs(share - 1) > np.maximum(2 * spread, 0.1))
    reach = float(distance[disturbed].max()) if disturbed.any() else 0.0
    shells = known & (distance > 1.3)
    flux = share[shells] * count[shells] / distance[shells]
    uneven = float(flux.std() / flux.mean())
    near = known & (np.abs(distance - 1.0) < 0.11)
    contact = float(np.average(share[near], weights=count[near]))
    gradient = np.array2string(far, precision=3, suppress_small=True).replace("\n", "")
    return compared(
        [
            (
                "velocity gradient of the far field over ε̇_q",
                "uniform",
                gradient,
                f"imposed one within {off:.1f} standard errors",
            ),
            (
                "relative velocity along the branch over its affine value, at a distance of ⟨ℓ⟩",
                "modified",
                number(contact, 2),
                "grains in contact hardly approach" if contact < 0.5 else "weakly hindered",
            ),
            (
                "farthest distance where it is off by more than 10 % and 2 errors",
                "of the order of ⟨ℓ⟩ from the grain",
                f"{reach:.2f} ⟨ℓ⟩",
                "agrees" if reach < 2.6 else "farther than the paper says",
            ),
            (
                "scatter of that ratio times the density of pairs, beyond 1.3 ⟨ℓ⟩",
                "–",
                f"{100 * uneven:.0f} %",
                "the flux of pairs hardly depends on distance" if uneven < 0.15 else "it varies",
            ),
        ]
    )


def _critical_rows(result: Result, z_star: float, a_star: float) -> list[Row]:
    rows = []
    for path in result["paths"]:
        name = f"{path['name']}, z_0 = {path['z_0']:.3f}"
        for symbol, key, paper in (("z*", "z_star", z_star), ("a*", "a_star", a_star)):
            ours = interval(path[key])
            rows.append((f"{symbol}, {name}", f"≈ {paper}", ours, against(path[key], paper)))
    return rows


def fig5(result: Result) -> str:
    """Critical state, dip, reversal."""
    dip, back = result["dip"], result["reversal"]
    rows = _critical_rows(result, 3.65, 0.20)
    shown = dip["depth"]["low"] > 0
    rows.append(
        (
            "z of the dense start below z* before ε_q = 0.1",
            "dips, then returns",
            f"depth {interval(dip['depth'])}",
            "a dip" if shown else "no dip beyond the scatter",
        )
    )
    plateau, late = back["a_signed_plateau"], back["z_dip"]
    zero = "never" if back["strain_to_zero"] is None else interval(back["strain_to_zero"])
    a_star = next(path["a_star"]["value"] for path in result["paths"] if path["name"] == "dense")
    missing = a_star + plateau["value"]
    rows += [
        (
            "a' after the reversal",
            "falls to zero, reaches −a*",
            f"zero after {zero}, plateau {interval(plateau)}",
            "agrees" if abs(missing) < 0.05 else f"differs from −a* by {missing:+.2f}",
        ),
        (
            "z after the reversal",
            "declines, then returns",
            f"depth {interval(late)}",
            "agrees" if late["low"] > 0 else "no dip beyond the scatter",
        ),
    ]
    return compared(rows)


def fig6(result: Result) -> str:
    """Circles between the limits."""
    mohr, fit = result["mohr"], result["fit"]["default"]
    low, high = (fit[key]["value"] / 4 for key in ("z_min", "z_max"))
    rows: list[Row] = []
    for circle in mohr["circles"]:
        left, right = (circle["centre"] + sign * circle["radius"] for sign in (-1, 1))
        # The limits are themselves known to a few thousandths only.
        inside = low - 0.01 <= left and right <= high + 0.01
        rows.append(
            (
                f"G_2, G_1 at ε_q = {mohr['eps_q']}, z = {circle['z']:.2f}, a = {circle['a']:.2f}",
                "between L1 and L2",
                f"{left:.3f}, {right:.3f}; L1 {low:.3f}, L2 {high:.3f}",
                "inside" if inside else "outside",
            )
        )
    sine = np.sin(np.radians(mohr["tangent_angle_degrees"]))
    half = fit["a_star"]["value"] / 2
    rows.append(
        (
            "sin α of the cone, and a*/2",
            "equal",
            f"{sine:.3f}, {half:.3f}",
            "equal, by construction" if abs(sine - half) < 1e-6 else "differ",
        )
    )
    return compared(rows)


def fig7(result: Result) -> str:
    """Critical state and limits."""
    rows = _critical_rows(result, 3.35, 0.24)
    fit = result["fit"]["default"]
    for key, paper in (("z_min", 2.948), ("z_max", 3.752)):
        text = f"{paper} (from its z*, a*)"
        rows.append((key, text, interval(fit[key]), against(fit[key], paper)))
    beyond = f"{100 * fit['outside_significant']:.1f} %"
    rows.append(
        (
            "states outside the domain by more than 2 standard deviations",
            "none drawn",
            beyond,
            f"worst by {fit['outside_worst']:.2f} contacts a grain",
        )
    )
    return compared(rows)


def fig8(result: Result) -> str:
    """By friction."""
    fits = result["fits"]
    header = ("µ", "z*", "a*", "a\\*z\\*", "z_min", "z_max", "approach: slope, z_max")
    rows = [
        (
            f"{fit['friction']:g}",
            interval(fit["z_star"], 2),
            interval(fit["a_star"], 2),
            number(fit["z_star"]["value"] * fit["a_star"]["value"], 2),
            interval(fit["z_min"], 2),
            interval(fit["z_max"], 2),
            _line(fit["approach"]),
        )
        for fit in fits
    ]
    z_star, a_star, z_max = (
        np.array([fit[key]["value"] for fit in fits]) for key in ("z_star", "a_star", "z_max")
    )
    verdicts: list[Row] = [
        ("z* with µ", "falls", f"{z_star[0]:.2f} to {z_star[-1]:.2f}", _trend(z_star, -1)),
        ("a* with µ", "rises", f"{a_star[0]:.2f} to {a_star[-1]:.2f}", _trend(a_star, 1)),
        (
            "z_max",
            "3.7 to 3.8",
            f"{z_max.min():.2f} to {z_max.max():.2f}",
            "agrees" if z_max.min() > 3.6 and z_max.max() < 3.9 else "varies more, with µ",
        ),
    ]
    return table(rows, header) + "\n\n" + compared(verdicts)


def _line(approach: dict[str, float] | None) -> str:
    """Slope and intercept of the approach."""
    return "–" if approach is None else f"{approach['slope']:.2f}, {approach['z_max']:.2f}"


def _trend(values: np.ndarray, sign: int) -> str:
    steps = sign * np.diff(values)
    if (steps > 0).all():
        return "agrees"
    return f"agrees in {(steps > 0).sum()} of {len(steps)} steps"


PAGES: dict[str, Callable[[Result], str]] = {
    "fig1": fig1, "fig2": fig2, "fig3": fig3, "fig4": fig4,
    "fig5": fig5, "fig6": fig6, "fig7": fig7, "fig8": fig8,
}  # fmt: skip


def settings_line(result: Result) -> str:
    """What the figure was made with."""
    cases = list(result["settings"]["cases"].values())
    case = cases[0]
    rate = case["path"][0]["inertial_number"]
    friction = sorted({item["material"]["friction"] for item in cases})
    solver = result["solver"]
    missed = 100 * solver["nonconverged_steps"] / max(solver["steps"], 1)
    return (
        f"{case['sample']['grain_count']} grains a sample, I = {rate:g}, "
        f"µ = {', '.join(f'{mu:g}' for mu in friction)}, residual {solver['tolerance']:g} "
        f"({missed:.2f} % of {solver['steps']} steps above it), k/p = {solver['stiffness']:.1e}, "
        f"contact criterion {result['criterion']}, z: `{result['z_definition']}`, "
        f"seed {result['seed']}, {result['settings']['seeds']} sample(s) of each path."
    )


def tables(results: dict[str, Result]) -> dict[str, str]:
    """The text between each pair of the page's markers."""
    return {
        name: f"{page(results[name])}\n\n{settings_line(results[name])}"
        for name, page in PAGES.items()
    }
