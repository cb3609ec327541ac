"""What ``granufab plot`` can draw: one table, one small function per figure."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from granufab.cli.foreign import frame_place
from granufab.errors import GranufabError, InvalidSettings, MissingData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from granufab.history import Frame, Run

__all__ = ["FIGURES", "Drawing", "Request"]

HOMOGENEITY_STRAIN = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What the command line asked for.

    Attributes:
        figure: its name, for messages.
        runs: by the name of their file.
        index: number of the state, counted from the end where negative.
        criterion: contact criterion.
        z_definition: which z.
    """

    figure: str
    runs: Mapping[str, Run]
    index: int
    criterion: str
    z_definition: Any

    @property
    def run(self) -> Run:
        """The one run."""
        return next(iter(self.runs.values()))

    @property
    def labels(self) -> dict[str, str]:
        """Text of the legend by file: the runs' names, or the files where these are alike."""
        names = {file: run.name for file, run in self.runs.items()}
        distinct = all(names.values()) and len(set(names.values())) == len(names)
        return names if distinct else {file: file for file in names}

    def frame(self, name: str) -> Frame:
        """The wanted state of a run.

        Raises:
            InvalidSettings: it has no such state.
        """
        run = self.runs[name]
        return run.frames[frame_place(run, name, self.index)]

    @property
    def place(self) -> int:
        """Place of the wanted state of the one run."""
        return frame_place(self.run, next(iter(self.runs)), self.index)

    @property
    def state(self) -> Frame:
        """The wanted state of the one run."""
        return self.frame(next(iter(self.runs)))

    def window(self) -> tuple[int, tuple[float, float]]:
        """Stage of the wanted state, and the later half of ∫|dε_q| of that stage up to it."""
        end = self.state
        if end.eps_q_total != end.eps_q_total:
            raise MissingData(
                f"--figure {self.figure}: the strain of this data is unknown; give --strain"
            )
        begin = min(f.eps_q_total for f in self.run.frames if f.stage == end.stage)
        return end.stage, (0.5 * (begin + end.eps_q_total), end.eps_q_total)

    def contacts(self) -> dict[str, Any]:
        """Keywords of the measures on contacts."""
        return {"criterion": self.criterion, "z_definition": self.z_definition}


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A figure.

    Attributes:
        draw: makes it and returns a panel of it.
        several: whether several runs can be drawn into it.
        whole: it draws whole paths, not a state.
    """

    draw: Callable[[Request], Axes]
    several: bool = False
    whole: bool = False

    def __call__(self, request: Request) -> Axes:
        """Draw it.

        Raises:
            InvalidSettings: several runs for a figure of one, or a state that is not there.
        """
        if len(request.runs) > 1 and not self.several:
            raise InvalidSettings(
                f"--figure {request.figure} draws one run, got {len(request.runs)}"
            )
        for name in () if self.whole else request.runs:
            request.frame(name)
        return self.draw(request)


def _domain(request: Request) -> Any:
    """The fitted domain, or None with a word on standard error where the runs do not give one."""
    from granufab.fabric import with_series
    from granufab.reproduce.series_fit import fit_series
    from granufab.reproduce.symmetry import described_series

    series = [described_series(with_series(run)) for run in request.runs.values()]
    try:
        return fit_series(series, "critical", request.z_definition)[0]
    except GranufabError as error:
        print(f"granufab: drawn without limit lines: {error}", file=sys.stderr)
        return None


def _path(request: Request) -> Axes:
    from granufab import plots

    return plots.path(
        list(request.runs.values()), domain=_domain(request), z_definition=request.z_definition
    )


def _zaz(request: Request) -> Axes:
    from granufab import plots

    return plots.zaz(
        list(request.runs.values()), domain=_domain(request), z_definition=request.z_definition
    )


def _series(request: Request) -> Axes:
    from granufab import plots

    runs = list(request.runs.values())
    return plots.series(runs, columns=(request.z_definition, "a_signed"))[0]


def _network_of(request: Request, name: str) -> Any:
    from granufab import fabric

    return fabric.select_network(request.frame(name).packing, **request.contacts())


def _mohr(request: Request) -> Axes:
    from granufab import fabric, plots, states

    circles = {}
    for name, label in request.labels.items():
        network = _network_of(request, name)
        tensor = fabric.enriched_tensor(fabric.fabric_tensor(network.contacts), network.z)
        circles[label] = states.MohrCircle.from_tensor(tensor)
    return plots.mohr(circles, domain=_domain(request))


def _rose(request: Request) -> Axes:
    from granufab import fabric, plots

    roses = {}
    for name, label in request.labels.items():
        network = _network_of(request, name)
        roses[label] = fabric.orientation(network.contacts, z=network.z)
    return plots.rose(roses if len(roses) > 1 else next(iter(roses.values())))


def _network(request: Request) -> Axes:
    from granufab import plots

    packing = request.state.packing
    draw = plots.network if packing.dimension == 2 else plots.network_3d
    return draw(packing, criterion=request.criterion)


def _homogeneity(request: Request) -> Axes:
    """Local strain over the last 0.1 of ε_q before the frame."""
    from granufab import fabric, plots
    from granufab.history import frame_before

    before = frame_before(request.run.frames, request.place, HOMOGENEITY_STRAIN)
    if before is None:
        raise InvalidSettings(
            f"--figure homogeneity needs {HOMOGENEITY_STRAIN} of ε_q in one stage before the "
            "frame; choose a later --frame"
        )
    return plots.homogeneity(fabric.local_strain(before.packing, request.state.packing))


def _velocity(request: Request) -> Axes:
    from granufab import fabric, plots

    stage, strain = request.window()
    field = fabric.velocity_field(
        request.run, window=1, stage=stage, strain=strain, criterion=request.criterion
    )
    return plots.velocity_panels(field)[0]


def _fluctuations(request: Request) -> Axes:
    from granufab import fabric, plots

    stage, strain = request.window()
    return plots.fluctuations(
        fabric.fluctuations(request.run, stage=stage, strain=strain),
        fabric.fluctuation_spectrum(request.run, stage=stage, strain=strain),
    )[0]


def _balance(request: Request) -> Axes:
    from granufab import fabric, plots

    data = fabric.balance_run(request.run, criterion=request.criterion)
    return plots.balance(data, window=request.window()[1])[0]


def _branches(request: Request) -> Axes:
    from granufab import fabric, plots

    return plots.branches(fabric.branches(request.state, **request.contacts()))[0]


def _forces(request: Request) -> Axes:
    from granufab import fabric, plots

    return plots.force_density(fabric.force_statistics(request.state, **request.contacts()))


def _texture(request: Request) -> Axes:
    from granufab import fabric, plots

    return plots.texture(fabric.texture(request.state, **request.contacts()))[0]


def _sff(request: Request) -> Axes:
    from granufab import fabric, plots

    data = fabric.stress_force_fabric(request.state, **request.contacts())
    return plots.stress_force_fabric(data)[0]


def _criterion(request: Request) -> Axes:
    from granufab import fabric, plots

    curves = fabric.criterion_curves(
        request.run, frame=request.place, z_definition=request.z_definition
    )
    return plots.criterion_curves(curves)[0]


FIGURES: dict[str, Drawing] = {
    "path": Drawing(draw=_path, several=True, whole=True),
    "zaz": Drawing(draw=_zaz, several=True, whole=True),
    "series": Drawing(draw=_series, several=True, whole=True),
    "mohr": Drawing(draw=_mohr, several=True),
    "rose": Drawing(draw=_rose, several=True),
    "network": Drawing(draw=_network),
    "homogeneity": Drawing(draw=_homogeneity),
    "velocity": Drawing(draw=_velocity),
    "fluctuations": Drawing(draw=_fluctuations),
    "balance": Drawing(draw=_balance),
    "branches": Drawing(draw=_branches),
    "forces": Drawing(draw=_forces),
    "texture": Drawing(draw=_texture),
    "sff": Drawing(draw=_sff),
    "criterion": Drawing(draw=_criterion),
}
"""Every figure by its name on the command line."""
