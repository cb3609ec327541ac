"""Write the measured tables into the documentation pages, between markers.

python benchmarks/pages.py convergence|accuracy|peers|critical|triaxial|benchmarks OUT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
BEGIN, END = "<!-- measured table: {name} -->", "<!-- end of {name} -->"


def insert(page: str, name: str, table: str) -> None:
    """Replace the text between the markers ``name`` of a page."""
    path = DOCS / page
    text = path.read_text()
    begin, end = BEGIN.format(name=name), END.format(name=name)
    head, _, rest = text.partition(begin)
    _, _, tail = rest.partition(end)
    path.write_text(f"{head}{begin}\n{table}\n{end}{tail}")


def peers(folder: Path) -> None:
    """The biaxial job by LAMMPS and by granufab."""
    sys.path.insert(0, str(Path(__file__).resolve().parent / "peers"))
    from peers_table import report

    data = json.loads((folder / "peers.json").read_text())
    (DOCS / "peers.json").write_text(json.dumps(data, indent=1) + "\n")
    machine = data["machine"]
    theirs = sorted({row["version"] for row in data["rows"] if row["program"] == "LAMMPS"})
    on = f"One core of {machine['cpu']}; Python {machine['python']}, numba {machine['numba']}; "
    text = on + ", ".join(theirs) + ".\n\n" + report(data["rows"], data["kappas"])
    insert("peers.md", "peers", text)


def critical(folder: Path) -> None:
    """Critical states by friction and criterion."""
    data = json.loads((folder / "critical-states.json").read_text())
    (DOCS / "critical-states.json").write_text(json.dumps(data, indent=1))
    names = ("z", "z_backbone", "a_signed", "az", "q_over_p", "phi")
    lines = [
        "| µ | criterion | z | z_backbone | a | a·z_backbone | q/p | φ |",
        "|" + "---|" * 8,
    ]
    for row in data["rows"]:
        cells = [f"{row[n]['value']:.3f} ± {row[n]['error'] or 0:.3f}" for n in names]
        lines.append(f"| {row['mu']} | {row['criterion']} | " + " | ".join(cells) + " |")
    insert("critical-states.md", "critical states", "\n".join(lines))


def triaxial(folder: Path) -> None:
    """Critical states of spheres, and extension predicted from compression."""
    data = json.loads((folder / "triaxial.json").read_text())
    (DOCS / "triaxial.json").write_text(json.dumps(data, indent=1))

    def interval(entry: dict[str, float]) -> str:
        return f"{entry['value']:.3f} ({entry['low']:.3f} to {entry['high']:.3f})"

    fitted = ("z_star", "a_star", "z_min", "z_max")
    header = ("start", "loading", "z_0", "z*", "\\|a*\\|", "z_min", "z_max", "q/p", "φ", "rattlers")
    lines = ["| " + " | ".join((*header, "unconverged")) + " |"]
    lines.append("|" + "---|" * 11)
    for path in data["paths"]:
        cells = [path["start"], path["mode"], f"{path['z_0']:.2f}"]
        cells += [interval(path[name]) for name in fitted]
        cells += [f"{path['q_over_p']:.3f}", f"{path['phi']:.3f}"]
        cells.append(f"{100 * path['rattler_fraction']:.1f} %")
        solver = path["solver"]
        cells.append(f"{solver['nonconverged_steps']} of {solver['steps']}")
        lines.append("| " + " | ".join(cells) + " |")
    insert("triaxial.md", "triaxial", "\n".join(lines))
    lines = ["| | predicted | measured, dense | measured, loose |", "|" + "---|" * 4]
    for mode in ("extension", "b = 0.5"):
        for name, sign in (("z_star", "z*"), ("a_star", "\\|a*\\|")):
            row = [f"{mode}, {sign}", interval(data["predicted"][f"{mode} {name}"])]
            for start in ("dense", "loose"):
                found = [p for p in data["paths"] if (p["start"], p["mode"]) == (start, mode)]
                row.append(interval(found[0][name]) if found else "–")
            lines.append("| " + " | ".join(row) + " |")
    insert("triaxial.md", "prediction", "\n".join(lines))
    lines = ["| criterion | z* | \\|a*\\| | z_min | z_max | extension predicted | measured |"]
    lines.append("|" + "---|" * 7)
    for row in data["criteria"]:
        cells = [row["criterion"], *(f"{row[k]:.3f}" for k in ("z_star", "a_star"))]
        cells += [f"{row[k]:.2f}" for k in ("z_min", "z_max")]
        cells += ["{:.3f}, {:.3f}".format(*row[k]) for k in ("predicted", "measured")]
        lines.append("| " + " | ".join(cells) + " |")
    insert("triaxial.md", "criteria", "\n".join(lines))


def convergence(folder: Path) -> None:
    """Table and figures of the convergence study."""
    from convergence_report import write

    insert("convergence.md", "convergence", write(folder, DOCS))


def accuracy(folder: Path) -> None:
    """What a tight residual costs."""
    from accuracy import table

    rows = json.loads((folder / "accuracy.json").read_text())
    (DOCS / "accuracy.json").write_text(json.dumps(rows, indent=1) + "\n")
    insert("convergence.md", "accuracy", table(rows))


def benchmarks(folder: Path) -> None:
    """Tables of the long benchmark."""
    from benchmarks_page import tables

    data = json.loads((folder / "benchmarks.json").read_text())
    (DOCS / "benchmarks.json").write_text(json.dumps(data, indent=1) + "\n")
    for name, text in tables(data).items():
        insert("benchmarks.md", name, text)


if __name__ == "__main__":
    pages = {
        "peers": peers, "critical": critical, "convergence": convergence, "triaxial": triaxial,
        "benchmarks": benchmarks, "accuracy": accuracy,
    }  # fmt: skip
    pages[sys.argv[1]](Path(sys.argv[2]))
