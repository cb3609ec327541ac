"""The numbers in the sentences of docs/peers.md are those of its rows, not only in its tables."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

DOCS = Path(__file__).resolve().parents[2] / "docs"
SETTINGS = {
    *("0.8", "1.2", "0.4", "0.2", "0.45", "0.15", "0.05", "0.5"),  # of the job
    *("0.14", "0.01", "0.02", "0.03", "0.06", "0.08"),  # its window, scatter, round differences
    *("0.28", "0.35"),  # ms of a step, from its seconds and sweeps, in words "about"
}


def _sentences() -> list[str]:
    text = (DOCS / "peers.md").read_text(encoding="utf-8")
    for what in (r"<!-- measured table.*?<!-- end of .*?-->", r"```.*?```", r"`[^`]*`"):
        text = re.sub(what, "", text, flags=re.DOTALL)
    return re.findall(r"(?<![\w.])[−+]?\d+\.\d+", text)


def _known() -> Iterator[float]:
    """Measures, costs, differences and ratios, of each sample and of means over samples."""
    data = json.loads((DOCS / "peers.json").read_text(encoding="utf-8"))
    groups: dict[tuple, list[dict]] = {}
    for row in data["rows"]:
        keys = ("grains", "rate", "program", "kappa", "residual", "time_step_setting", "role")
        groups.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    sets = [*groups.values(), *([row] for row in data["rows"])]
    for rows in sets:
        for name in ("z_backbone", "z", "cpu_seconds", "load_before"):
            yield float(np.mean([row[name] for row in rows]))
        yield float(np.mean([1e6 * row["cpu_seconds"] / row["steps"] for row in rows]))
    for ours, theirs in itertools.product(sets, sets):
        if theirs[0]["program"] != "LAMMPS" or ours[0]["rate"] != theirs[0]["rate"]:
            continue
        seeds = {row["seed"]: row for row in theirs}
        pairs = [(row, seeds[row["seed"]]) for row in ours if row["seed"] in seeds]
        if pairs:
            yield float(np.mean([a["z_backbone"] - b["z_backbone"] for a, b in pairs]))
            yield float(np.mean([b["cpu_seconds"] / a["cpu_seconds"] for a, b in pairs]))


def test_every_number_of_the_sentences_is_one_of_the_rows() -> None:
    known = np.array(list(_known()))
    words = [word for word in _sentences() if word not in SETTINGS]
    assert len(words) > 30
    lost = []
    for word in words:
        value = float(word.replace("−", "-"))
        digits = len(word.partition(".")[2])
        near = np.abs(known - value) <= 0.51 * 10.0**-digits
        if word[0] not in "+−":
            near |= np.abs(np.abs(known) - value) <= 0.51 * 10.0**-digits
        if not near.any():
            lost.append(word)
    assert not lost
