"""Write the measured tables into the documentation pages, between markers.

python benchmarks/pages.py PAGE OUT   # keeps the numbers of OUT as docs/*.json, writes the tables
python benchmarks/pages.py PAGE docs  # writes the tables from the numbers that were kept
python benchmarks/pages.py all docs   # the same for every page
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent.parent / "docs"
BEGIN, END = "<!-- measured table: {name} -->", "<!-- end of {name} -->"


def insert(page: str, name: str, table: str) -> None:
    """Replace the text between the markers ``name`` of a page."""
    path = DOCS / page
    text = path.read_text(encoding="utf-8")
    begin, end = BEGIN.format(name=name), END.format(name=name)
    head, found, rest = text.partition(begin)
    _, ended, tail = rest.partition(end)
    assert found and ended, f"{page} has no table {name}"
    path.write_text(f"{head}{begin}\n{table}\n{end}{tail}", encoding="utf-8")


def insert_cell(page: str, name: str, text: str) -> None:
    """Replace a number within a line, or a cell of a table, between its marks."""
    path = DOCS / page
    begin, end = f"<!-- counted: {name} -->", "<!-- end -->"
    head, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, ended, tail = rest.partition(end)
    assert found and ended, f"{page} has no place {name}"
    path.write_text(f"{head}{begin}{text}{end}{tail}", encoding="utf-8")


def kept(folder: Path, name: str) -> Any:
    """What ``folder/name`` holds, copied into the documentation."""
    data = json.loads((folder / name).read_text(encoding="utf-8"))
    if folder.resolve() != DOCS.resolve():
        text = json.dumps(data, indent=1) + "\n"
        (DOCS / name).write_text(text, encoding="utf-8")
    return data


def peers(folder: Path) -> None:
    """The biaxial job by LAMMPS and by granufab."""
    sys.path.insert(0, str(Path(__file__).resolve().parent / "peers"))
    from peers_table import present, report

    data = kept(folder, "peers.json")
    machine = data["machine"]
    theirs = sorted({row["version"] for row in data["rows"] if row["program"] == "LAMMPS"})
    on = f"One core of {machine['cpu']}; Python {machine['python']}, numba {machine['numba']}; "
    text = on + ", ".join(theirs) + ".\n\n" + report(data["rows"], data["kappas"])
    insert("peers.md", "peers", text)
    insert("peers.md", "present", present(data.get("present", []), data["rows"]))


def critical(folder: Path) -> None:
    """Critical states by friction and criterion."""
    data = kept(folder, "critical-states.json")
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
    data = kept(folder, "triaxial.json")

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
    """Table and figures of the convergence study; the figures need its runs."""
    from convergence_report import markdown, write

    if folder.resolve() == DOCS.resolve():
        text = markdown(kept(folder, "convergence.json")).rstrip()
    else:
        text = write(folder, DOCS)
    insert("convergence.md", "convergence", text)


def accuracy(folder: Path) -> None:
    """What a tight residual costs."""
    from accuracy import table

    insert("convergence.md", "accuracy", table(kept(folder, "accuracy.json")))


def benchmarks(folder: Path) -> None:
    """Tables of the long benchmark."""
    from benchmarks_page import tables

    for name, text in tables(kept(folder, "benchmarks.json")).items():
        insert("benchmarks.md", name, text)


def figures(folder: Path) -> None:
    """The paper's figures, from the folder of ``granufab reproduce all``."""
    from figures_page import tables
    from kept_figures import gathered

    if folder.resolve() == DOCS.resolve():
        results = kept(folder, "figures.json")
    else:
        results = gathered(folder)
        text = json.dumps(results, indent=1) + "\n"
        (DOCS / "figures.json").write_text(text, encoding="utf-8")
        for name in results:
            shutil.copy(folder / f"{name}.png", DOCS / "images" / f"{name}.png")
    for name, text in tables(results).items():
        insert("figures.md", name, text)


def claims(folder: Path) -> None:
    """The paper, claim by claim."""
    from claims_page import page

    text = page(kept(folder, "figures.json"), kept(folder, "triaxial.json"))
    insert("claims.md", "claims", text)


def performance(folder: Path) -> None:
    """What things cost."""
    from performance_page import page

    text = page(kept(folder, "benchmarks.json"), kept(folder, "peers.json"))
    insert("performance.md", "performance", text)


def reliability(folder: Path) -> None:
    """What the reliability tests counted."""
    from reliability_page import cells, tables

    entries = kept(folder, "reliability.json")
    for name, text in cells(entries).items():
        insert_cell("reliability.md", name, text)
    for name, text in tables(entries).items():
        insert("reliability.md", name, text)


def paper(folder: Path) -> None:
    """The short paper on the program."""
    from claims_page import rows
    from paper_page import cells

    names = ("figures", "critical-states", "triaxial", "peers", "reliability")
    data = {name: kept(folder, f"{name}.json") for name in names}
    count = len(rows(data["figures"], data["triaxial"]))
    for name, text in {**cells(data), "claims": str(count)}.items():
        insert_cell("../paper/paper.md", name, text)


def main(name: str, folder: Path) -> None:
    """One page, or all of them."""
    pages = {
        "peers": peers, "critical": critical, "convergence": convergence, "triaxial": triaxial,
        "benchmarks": benchmarks, "accuracy": accuracy, "figures": figures, "claims": claims,
        "performance": performance, "reliability": reliability,
        "paper": paper,
    }  # fmt: skip
    for one in pages if name == "all" else [name]:
        pages[one](folder)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
