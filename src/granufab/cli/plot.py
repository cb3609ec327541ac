"""``granufab plot``: a figure of one or several runs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

import typer

from granufab.errors import GranufabError, InvalidSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from granufab.history import Run

__all__ = ["check_figure", "plot"]

Name = Literal["path", "zaz", "series", "mohr", "rose", "network", "homogeneity"]
Definition = Literal["z", "z_backbone", "z_mechanical"]
HOMOGENEITY_STRAIN = 0.1
ENDINGS = (".pdf", ".png", ".svg", ".eps", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")


def plot(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN", help="Run files.")],
    figure: Annotated[Name, typer.Option(help="What is drawn.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="PDF, PNG, SVG…, by its ending.")
    ],
    frame: Annotated[
        int, typer.Option(metavar="K", help="State for mohr, rose, network; default the last.")
    ] = -1,
    criterion: Annotated[
        str, typer.Option(metavar="force|gap:δ|listed", help="Contacts for mohr, rose, network.")
    ] = "force",
    z_definition: Annotated[Definition, typer.Option(help="Which z.")] = "z_backbone",
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
) -> None:
    """Draw a run: its (z, a) path, series, Mohr circle, rose, network or strain map."""
    from granufab.io import read

    check_figure(output, force)
    loaded = {str(file): read(file) for file in runs}
    if figure in ("path", "zaz", "series"):
        panel = _draw_paths(figure, list(loaded.values()), z_definition)
    else:
        panel = _draw_states(figure, loaded, frame, criterion, z_definition)
    cast("Figure", panel.figure).savefig(output, dpi=300)


def check_figure(output: Path, force: bool) -> None:
    """Refuse a figure that cannot be written: ending, existing file, missing folder."""
    if output.suffix.lower() not in ENDINGS:
        raise InvalidSettings(f"-o {output}: the name must end in one of {', '.join(ENDINGS)}")
    if output.exists() and not force:
        raise InvalidSettings(
            f"{output}: exists already; choose another name, or --force to replace it"
        )
    if not output.parent.is_dir():
        raise InvalidSettings(f"{output}: there is no folder {output.parent}")


def _draw_paths(figure: str, runs: list[Run], z_definition: Any) -> Axes:
    from granufab import plots

    if figure == "series":
        return plots.series(runs, columns=(z_definition, "a_signed"))[0]
    draw = plots.path if figure == "path" else plots.zaz
    return draw(runs, domain=_domain(runs, z_definition), z_definition=z_definition)


def _domain(runs: list[Run], z_definition: str) -> Any:
    """The fitted domain, or None with a word on standard error where the runs do not give one."""
    from granufab.cli.fit import fit_series
    from granufab.reproduce.symmetry import described_series

    try:
        return fit_series([described_series(run) for run in runs], "critical", z_definition)[0]
    except GranufabError as error:
        print(f"granufab: drawn without limit lines: {error}", file=sys.stderr)
        return None


def _draw_states(
    figure: str, runs: dict[str, Run], frame: int, criterion: str, z_definition: Any
) -> Axes:
    from granufab import fabric, plots, states

    packings = {}
    for name, run in runs.items():
        count = len(run.frames)
        if not -count <= frame < count:
            raise InvalidSettings(f"--frame {frame}: {name} holds frames 0..{count - 1}")
        packings[name] = run.frames[frame].packing
    if figure in ("network", "homogeneity") and len(packings) > 1:
        raise InvalidSettings(f"--figure {figure} draws one run, got {len(packings)}")
    if figure == "homogeneity":
        return _draw_homogeneity(next(iter(runs.values())), frame)
    if figure == "network":
        return plots.network(*packings.values(), criterion=criterion)
    networks = {
        name: fabric.select_network(packing, criterion=criterion, z_definition=z_definition)
        for name, packing in packings.items()
    }
    if figure == "rose":
        roses = {
            name: fabric.orientation(item.contacts, z=item.z) for name, item in networks.items()
        }
        return plots.rose(roses if len(roses) > 1 else next(iter(roses.values())))
    circles = {}
    for name, item in networks.items():
        a = fabric.anisotropy(fabric.fabric_tensor(item.contacts))
        circles[name] = states.mohr(item.z, a, dimension=packings[name].dimension)
    domain = _domain(list(runs.values()), z_definition)
    return plots.mohr(circles, domain=domain)


def _draw_homogeneity(run: Run, frame: int) -> Axes:
    """Local strain over the last 0.1 of ε_q before the frame."""
    from granufab import fabric, plots
    from granufab.history import frame_before

    before = frame_before(run.frames, frame, HOMOGENEITY_STRAIN)
    if before is None:
        raise InvalidSettings(
            f"--figure homogeneity needs {HOMOGENEITY_STRAIN} of ε_q in one stage before the "
            "frame; choose a later --frame"
        )
    return plots.homogeneity(fabric.local_strain(before.packing, run.frames[frame].packing))
