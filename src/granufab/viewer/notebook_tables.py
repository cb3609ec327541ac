"""Records as small tables of HTML, for notebooks; every text in them is escaped."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from matplotlib.axes import Axes

from granufab.errors import GranufabError
from granufab.fabric import measure
from granufab.fabric.run_definitions import recorded_reach, run_definitions
from granufab.history import Frame, Run
from granufab.packing import Packing
from granufab.plots.limits import critical_marker, limit_lines
from granufab.plots.style import ColumnFigure, new_figure
from granufab.states import AccessibleDomain, AccessibleFit

__all__ = [
    "domain_table",
    "fit_table",
    "frame_table",
    "packing_table",
    "panel_picture",
    "run_table",
]

Row = tuple[str, str, str]
_TEXTS = {
    "z": "z, all grains",
    "z_backbone": "z without rattlers",
    "z_mechanical": "z, mechanical",
    "rattler_fraction": "rattlers",
    "a": "a",
    "a_signed": "a'",
    "q_over_p": "q/p",
    "phi": "φ",
}
_LIMITS = ("z_min", "z_max", "z_star", "a_star")


def run_table(run: Run) -> str:
    """Name, size and definitions of a run, and its last state."""
    rows: list[Row] = [("frames", str(len(run.frames)), "")]
    if not len(run.frames):
        return _table(f"Run {run.name}", rows)
    last = run.frames[-1]
    packing = last.packing
    rule, definition, minimum = run_definitions(run)
    rows += [
        ("grains", str(packing.grains.count), _kind(packing)),
        ("contacts", rule.text, ""),
        ("last ε_q", _number(last.eps_q), "-"),
    ]
    names = (definition, "a_signed", "q_over_p", "phi")
    try:
        state = measure(
            packing, criterion=rule, z_definition=definition, direction=last.direction,
            minimum=minimum, reach=recorded_reach(run),
        )  # fmt: skip
    except GranufabError as error:
        return _table(f"Run {run.name}", rows, str(error))
    return _table(f"Run {run.name}", rows + _values(state, names), state["missing"])


def frame_table(frame: Frame) -> str:
    """Where a state lies on its path, and its fabric."""
    rows: list[Row] = [
        ("ε_q", _number(frame.eps_q), "-"),
        ("∫|dε_q|", _number(frame.eps_q_total), "-"),
        ("stage", str(frame.stage), ""),
    ]
    return _state("Frame", frame.packing, rows, frame.direction)


def packing_table(packing: Packing) -> str:
    """Size and fabric of a packing, under the criterion that its data allow."""
    return _state("Packing", packing, [], None)


def _state(title: str, packing: Packing, rows: list[Row], direction: Any) -> str:
    contacts = packing.contacts
    rows = [*rows, ("grains", str(packing.grains.count), _kind(packing))]
    rows.append(("pairs listed", "none" if contacts is None else str(contacts.count), ""))
    rule = "listed" if contacts is None or contacts.force is None else "force"
    try:
        state = measure(packing, criterion=rule, direction=direction)
    except GranufabError as error:
        return _table(title, rows, str(error))
    counted = state["contact_count"]
    rows.append(("contacts", "–" if counted is None else str(int(counted)), rule))
    signed = () if direction is None else ("a_signed",)
    names = ("z", "z_backbone", "rattler_fraction", "a", *signed, "q_over_p", "phi")
    return _table(title, rows + _values(state, names), state["missing"])


def fit_table(fit: AccessibleFit) -> str:
    """Limits and critical state with their intervals, and the domain as a picture."""
    header = ("", "value", "low", "high")
    rows = []
    for name in _LIMITS:
        one = getattr(fit, name)
        rows.append((_symbol(name), _number(one.value), _number(one.low), _number(one.high)))
    title = f"Accessible states, {fit.dimension}D, fitted by {fit.method}"
    note = f"intervals of {fit.level:.0%}"
    return _beside(_table(title, rows, note, header), _picture(fit))


def domain_table(domain: AccessibleDomain) -> str:
    """Limits and critical state of a domain, and its picture."""
    rows = [(_symbol(name), _number(getattr(domain, name)), "-") for name in _LIMITS]
    title = f"Accessible states, {domain.dimension}D"
    return _beside(_table(title, rows), _picture(domain))


def panel_picture(panel: Axes) -> bytes | None:
    """PNG of the figure that a function of ``granufab.plots`` has returned a panel of.

    Panels of other figures are left to matplotlib, which shows those of pyplot by itself.
    """
    figure = panel.get_figure(root=True)
    return figure.png() if isinstance(figure, ColumnFigure) else None


def _kind(packing: Packing) -> str:
    return "disks" if packing.dimension == 2 else "spheres"


def _symbol(name: str) -> str:
    letter, _, index = name.partition("_")
    return f"{letter}{'*' if index == 'star' else '_' + index}"


def _values(state: Mapping[str, Any], names: Sequence[str]) -> list[Row]:
    return [(_TEXTS[name], _number(state.get(name)), "-") for name in names]


def _number(value: Any) -> str:
    if value is None or not math.isfinite(float(value)):
        return "–"
    return f"{float(value):.4g}"


def _table(
    title: str, rows: Sequence[Sequence[str]], note: Any = None, header: Sequence[str] = ()
) -> str:
    """A caption, rows of cells, and a line below; all of them are plain text."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="text-align: left">{escape(cell)}</td>' for cell in row)
        + "</tr>"
        for row in rows
    )  # fmt: skip
    below = "" if not note else f"<div><small>{escape(str(note))}</small></div>"
    caption = (
        f'<caption style="text-align: left; white-space: nowrap"><b>{escape(title)}</b></caption>'
    )
    top = f"<thead><tr>{head}</tr></thead>" if head else ""
    return f"<div><table>{caption}{top}<tbody>{body}</tbody></table>{below}</div>"


def _beside(table: str, picture: str) -> str:
    return f'<div style="display: flex; gap: 1em; align-items: start">{table}{picture}</div>'


def _picture(limits: AccessibleFit | AccessibleDomain) -> str:
    """The domain on (z, a) as an image of vectors."""
    figure, (panel,) = new_figure()
    domain = limits.domain if isinstance(limits, AccessibleFit) else limits
    wide = 0.15 * (domain.z_max - domain.z_min)
    panel.set_xlim(domain.z_min - wide, domain.z_max + wide)
    panel.set_ylim(0, 1.25 * domain.a_star)
    limit_lines(panel, limits, scaled=False)
    critical_marker(panel, limits, scaled=False)
    panel.set_xlabel("$z$ [-]")
    panel.set_ylabel("$a$ [-]")
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    text = base64.b64encode(stream.getvalue()).decode()
    return f'<img alt="accessible domain" width="340" src="data:image/svg+xml;base64,{text}">'
